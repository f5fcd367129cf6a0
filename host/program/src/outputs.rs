//! The files that a command reads and writes. A command declares its inputs and its outputs, and [`Declared::check`]
//! refuses, before any work, an output that would destroy something: an input, another output, or a file that a running
//! program writes. The check also refuses an output that cannot be written, and a name that says another format.
//!
//! Two paths are the same file if they lead to the same place, through links too, or to the same file of the system
//! (hard links). Devices, pipes and the names of the standard streams are no files that can be destroyed.
//!
//! Outputs that grow during the work are locked themselves, by the code that writes them (`host::log`, `host::solve`,
//! `study::stress::jobs`). Of an output that replaces a file at the end, the older file is locked meanwhile; two programs
//! that make the same new file both succeed, and the later one's file stays. All locks are the system's advisory locks:
//! they end with the process, however it ends.

use host::atomic_file::{self, folder_of};
use host::run::TickOutputs;
use host::scene::LoadedScene;
use host::scene::spec::Body;
use host::solve::frames::FrameFolder;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::os::fd::AsFd;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

/// The format of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// A picture; the ending says in which of the formats.
    Picture,
    /// A distribution: a table, or a drawing of it.
    Distribution,
    /// One value of JSON.
    Json,
    /// A line of JSON for each cell of a study, appended to those that are there.
    JsonLines,
    /// A log of ticks.
    Mcap,
    /// A table.
    Csv,
    /// A table that grows row by row.
    Rows,
    /// A scene.
    Toml,
    /// A script for the shell.
    Script,
    /// A mesh; the ending says in which of the formats.
    Mesh,
    /// A text for people.
    Text,
    /// Several files in one.
    Archive,
}

/// The endings that say a format. A file may have any other ending, or none.
const KNOWN_ENDINGS: [&str; 29] = [
    "svg", "svgz", "png", "jpg", "jpeg", "gif", "webp", "bmp", "tif", "tiff", "pdf", "ps", "eps",
    "html", "json", "jsonl", "ndjson", "csv", "tsv", "toml", "mcap", "bag", "msh", "vtk", "vtu",
    "pvd", "obj", "md", "tar",
];

impl Format {
    /// The endings of the format. The first one is the usual one.
    fn endings(self) -> &'static [&'static str] {
        match self {
            Self::Picture => &["svg", "png"],
            Self::Distribution => &["csv", "svg", "png"],
            Self::Json => &["json"],
            Self::JsonLines => &["jsonl", "ndjson", "json"],
            Self::Mcap => &["mcap"],
            Self::Csv | Self::Rows => &["csv"],
            Self::Toml => &["toml"],
            Self::Script => &["sh"],
            Self::Mesh => &["msh", "vtk", "vtu"],
            Self::Text => &["md", "txt"],
            Self::Archive => &["tar"],
        }
    }

    /// Whether the file grows during the work.
    fn grows(self) -> bool {
        matches!(self, Self::Mcap | Self::JsonLines | Self::Rows)
    }

    /// Whether the file is written from beginning to end, so that it may be a stream or a pipe.
    fn streams(self) -> bool {
        !matches!(self, Self::Mcap | Self::JsonLines)
    }

    /// Refuses a name that says another format.
    fn check(self, flag: &'static str, path: &Path) -> Result<(), OutputError> {
        let Some(ending) = path.extension().and_then(|ending| ending.to_str()) else {
            return Ok(());
        };
        let lower = ending.to_ascii_lowercase();
        let lower = lower.as_str();
        if self.endings().contains(&lower) || !KNOWN_ENDINGS.contains(&lower) {
            return Ok(());
        }
        let drawn = [
            "svgz", "jpg", "jpeg", "gif", "webp", "bmp", "tif", "tiff", "pdf", "ps", "eps",
        ];
        let advice = match self {
            Self::Picture if drawn.contains(&lower) => {
                "; a program such as rsvg-convert or Inkscape converts the SVG"
            }
            _ => "",
        };
        Err(OutputError::Ending {
            flag,
            path: path.to_owned(),
            allowed: format!(".{}{advice}", self.endings().join(" or .")),
        })
    }
}

/// Why a command may not write its outputs. The first part names the argument and the path.
#[derive(Debug, thiserror::Error)]
pub(super) enum OutputError {
    /// The output is also an input.
    #[error(
        "{flag} {}: would overwrite {input}, which the command reads{}; give the output another name",
        path.display(), as_well(path, other)
    )]
    Input {
        flag: &'static str,
        path: PathBuf,
        input: &'static str,
        other: PathBuf,
    },
    /// Two outputs are one file.
    #[error(
        "{flag} {}: {other_flag} writes to the same file{}; give each output a file of its own",
        path.display(), as_well(path, other)
    )]
    Twice {
        flag: &'static str,
        path: PathBuf,
        other_flag: &'static str,
        other: PathBuf,
    },
    /// The output is the file into which the program prints.
    #[error(
        "{flag} {}: the {stream} goes to this file; give the output a file of its own{}",
        path.display(), if *direct { ", or /dev/stdout to have both in one file" } else { "" }
    )]
    Printed {
        flag: &'static str,
        path: PathBuf,
        stream: &'static str,
        direct: bool,
    },
    /// Another program writes to the file.
    #[error(
        "{flag} {}: another program is writing to this path; give each program a file of its own",
        path.display()
    )]
    Busy { flag: &'static str, path: PathBuf },
    /// The ending of the file says another format.
    #[error("{flag} {}: found the ending of another format, allowed: {allowed}", path.display())]
    Ending {
        flag: &'static str,
        path: PathBuf,
        allowed: String,
    },
    /// The path leads to a folder, and the output is a file.
    #[error("{flag} {}: this is a folder; give a file", path.display())]
    Folder { flag: &'static str, path: PathBuf },
    /// The path leads to a file, and the output is a folder.
    #[error("{flag} {}: this is not a folder; give a folder, which may be new", path.display())]
    NoFolder { flag: &'static str, path: PathBuf },
    /// The folder of the file does not exist.
    #[error("{flag} {}: the folder {} does not exist; create it first", path.display(), folder.display())]
    MissingFolder {
        flag: &'static str,
        path: PathBuf,
        folder: PathBuf,
    },
    /// The path leads to a pipe, and the output needs a file.
    #[error(
        "{flag} {}: this is a pipe; the command needs a file, as it does not write from beginning to end",
        path.display()
    )]
    Pipe { flag: &'static str, path: PathBuf },
    /// The system refuses to write there.
    #[error("{flag} {}: cannot write to this path: {source}", path.display())]
    System {
        flag: &'static str,
        path: PathBuf,
        source: io::Error,
    },
}

impl OutputError {
    /// The exit code: 2 for an argument that is wrong, 1 for one that may serve at another time.
    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::Busy { .. } | Self::System { .. } => 1,
            _ => 2,
        }
    }
}

/// The other name of a file, if it has one.
fn as_well(path: &Path, other: &Path) -> String {
    if path == other {
        String::new()
    } else {
        format!(" as {}", other.display())
    }
}

/// A file that the command reads.
struct Input {
    what: &'static str,
    path: PathBuf,
}

/// The kind of output that the command writes at a path.
enum Kind {
    File(Format),
    /// A folder, and whether the command may write a file of a name there.
    Folder(Box<dyn Fn(&str) -> bool>),
}

struct Output {
    flag: &'static str,
    path: PathBuf,
    kind: Kind,
}

/// The inputs and outputs of a command.
#[derive(Default)]
pub(super) struct Declared {
    inputs: Vec<Input>,
    outputs: Vec<Output>,
}

impl Declared {
    /// A file that the command reads. `what` names it in messages.
    pub(super) fn input(mut self, what: &'static str, path: Option<&Path>) -> Self {
        self.inputs.extend(path.map(|path| Input {
            what,
            path: path.to_owned(),
        }));
        self
    }

    /// The scene file, and the files that the scene names. The built-in scene is no file.
    pub(super) fn scene(mut self, path: Option<&Path>, loaded: &LoadedScene) -> Self {
        let Some(path) = path else {
            return self;
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        let named = loaded.files.keys().map(|name| Input {
            what: "a file that the scene names",
            path: folder.join(name),
        });
        self.inputs.extend(named);
        self.input("the scene", Some(path))
    }

    /// A file that the argument `flag` requests.
    pub(super) fn file(
        mut self,
        flag: &'static str,
        path: Option<&PathBuf>,
        format: Format,
    ) -> Self {
        self.outputs.extend(path.map(|path| Output {
            flag,
            path: path.clone(),
            kind: Kind::File(format),
        }));
        self
    }

    /// The outputs that are made of ticks.
    pub(super) fn ticks(self, ticks: &TickOutputs) -> Self {
        let curve = ticks.force_displacement.as_ref();
        self.file("--csv", ticks.csv.as_ref(), Format::Rows).file(
            "--force-displacement",
            curve,
            Format::Picture,
        )
    }

    /// The folder of the frames of a solve.
    pub(super) fn frames(
        self,
        flag: &'static str,
        path: Option<&PathBuf>,
        bodies: &[Body],
    ) -> Self {
        let names: Vec<String> = bodies.iter().map(|body| body.name.clone()).collect();
        self.folder(flag, path, move |file| {
            FrameFolder::may_write(file, names.iter().map(String::as_str))
        })
    }

    /// A folder that the argument `flag` requests. `writes` tells whether the command may write a file of a name there.
    pub(super) fn folder(
        mut self,
        flag: &'static str,
        path: Option<&PathBuf>,
        writes: impl Fn(&str) -> bool + 'static,
    ) -> Self {
        self.outputs.extend(path.map(|path| Output {
            flag,
            path: path.clone(),
            kind: Kind::Folder(Box::new(writes)),
        }));
        self
    }

    /// Checks all outputs. The command keeps what is returned until it has written its outputs.
    ///
    /// # Errors
    /// The first fault. No file has been changed; at most, a folder has been created.
    pub(super) fn check(self) -> Result<Held, OutputError> {
        for output in &self.outputs {
            self.check_names(output)?;
        }
        for output in &self.outputs {
            self.check_place(output)?;
        }
        // The folders first: a file may go into one of them.
        let (folders, files): (Vec<_>, Vec<_>) = self
            .outputs
            .iter()
            .partition(|output| matches!(output.kind, Kind::Folder(_)));
        let mut held = Held::default();
        for output in folders.into_iter().chain(files) {
            held.locked.extend(hold(output)?);
            held.pipes.extend(hold_pipe(output)?);
        }
        Ok(held)
    }

    /// Refuses an output whose name is that of something else.
    fn check_names(&self, output: &Output) -> Result<(), OutputError> {
        let (flag, path) = (output.flag, &output.path);
        if let Some(input) = self
            .inputs
            .iter()
            .find(|input| output.destroys(&input.path))
        {
            return Err(OutputError::Input {
                flag,
                path: path.clone(),
                input: input.what,
                other: input.path.clone(),
            });
        }
        // A folder destroys a file in it, but no file a folder: both orders count.
        let other = self.outputs.iter().find(|other| {
            other.flag != flag && (output.destroys(&other.path) || other.destroys(path))
        });
        if let Some(other) = other {
            return Err(OutputError::Twice {
                flag,
                path: path.clone(),
                other_flag: other.flag,
                other: other.path.clone(),
            });
        }
        let Kind::File(format) = &output.kind else {
            return Ok(());
        };
        // Files that are written from beginning to end may go to the stream itself.
        let streamed = atomic_file::stream(path).is_some() && format.streams();
        if !streamed && let Some(stream) = printed_to(path) {
            return Err(OutputError::Printed {
                flag,
                path: path.clone(),
                stream,
                direct: stream == OUTPUT && format.streams(),
            });
        }
        format.check(flag, path)
    }

    /// Refuses a path at which the output cannot be.
    fn check_place(&self, output: &Output) -> Result<(), OutputError> {
        let (flag, path) = (output.flag, output.path.clone());
        let there = fs::metadata(&path);
        let Kind::File(format) = &output.kind else {
            return match there {
                Ok(there) if !there.is_dir() => Err(OutputError::NoFolder { flag, path }),
                // A folder that does not exist is created.
                _ => Ok(()),
            };
        };
        match there {
            Ok(there) if there.is_dir() => Err(OutputError::Folder { flag, path }),
            Ok(there) if !format.streams() && there.file_type().is_fifo() => {
                Err(OutputError::Pipe { flag, path })
            }
            Ok(_) => Ok(()),
            Err(_) => {
                let target = atomic_file::target(&path);
                let folder = folder_of(&target);
                let created = self.outputs.iter().any(|other| {
                    matches!(other.kind, Kind::Folder(_))
                        && atomic_file::target(&other.path) == folder
                });
                if created || folder.is_dir() {
                    return Ok(());
                }
                let folder = folder_of(&path).to_owned();
                Err(OutputError::MissingFolder { flag, path, folder })
            }
        }
    }
}

impl Output {
    /// Whether the command would write over the file at `path`.
    fn destroys(&self, path: &Path) -> bool {
        match &self.kind {
            Kind::File(_) => same_file(&self.path, path),
            Kind::Folder(writes) => {
                let place = atomic_file::target(path);
                let inside = place.parent() == Some(atomic_file::target(&self.path).as_path());
                let name = place.file_name().and_then(|name| name.to_str());
                inside && name.is_some_and(writes)
            }
        }
    }
}

/// The locks that keep other programs from the outputs. A drop releases them.
#[derive(Default)]
pub(super) struct Held {
    /// The older files that the outputs replace, locked.
    locked: Vec<File>,
    /// The pipes that are outputs: their readers do not see an end before the output comes.
    pipes: Vec<File>,
}

/// Keeps other programs from the output, as far as the command itself does not when it opens the output. Fails if
/// another program has the output.
fn hold(output: &Output) -> Result<Option<File>, OutputError> {
    let flag = output.flag;
    let busy = || OutputError::Busy {
        flag,
        path: output.path.clone(),
    };
    let failed = |source| OutputError::System {
        flag,
        path: output.path.clone(),
        source,
    };
    let Kind::File(format) = &output.kind else {
        fs::create_dir_all(&output.path).map_err(failed)?;
        atomic_file::sweep(&output.path);
        // A solve locks the folder of its frames.
        if is_locked(&output.path) {
            return Err(busy());
        }
        return probe(&output.path).map_err(failed).map(|()| None);
    };
    let target = atomic_file::target(&output.path);
    let there = fs::metadata(&output.path).ok();
    if there.as_ref().is_some_and(|there| !there.is_file())
        || atomic_file::stream(&output.path).is_some()
    {
        return Ok(None);
    }
    atomic_file::sweep(folder_of(&target));
    // A log that grows, or a study's results. A study itself says more about two runs with one file of results.
    if *format != Format::JsonLines && is_locked(&target) {
        return Err(busy());
    }
    if there.is_none() {
        return probe(folder_of(&target)).map_err(failed).map(|()| None);
    }
    // A file that its owner protects is not replaced.
    let file = OpenOptions::new().append(true).open(&target);
    let file = file.map_err(failed)?;
    // What grows is locked by its writer.
    if format.grows() {
        return Ok(None);
    }
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => Err(busy()),
        // Some network file systems have no locks.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(Some(file)),
    }
}

/// Opens an output that is a pipe or a socket, if that is possible without waiting.
fn hold_pipe(output: &Output) -> Result<Option<File>, OutputError> {
    let path = &output.path;
    let there = fs::metadata(path).ok().filter(is_connected);
    if there.is_none() || atomic_file::stream(path).is_some() {
        return Ok(None);
    }
    let opened = atomic_file::open_stream(path);
    let pipe = opened.map_err(|source| OutputError::System {
        flag: output.flag,
        path: path.clone(),
        source,
    })?;
    Ok(Some(pipe))
}

/// Whether a program holds a lock on the file or the folder.
fn is_locked(path: &Path) -> bool {
    // Shared, so that two programs that look do not see each other.
    File::open(path)
        .is_ok_and(|file| matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)))
}

/// Creates a file in the folder and removes it, to see that this is possible.
fn probe(folder: &Path) -> io::Result<()> {
    let path = folder.join(format!(".palpate-{}.tmp", std::process::id()));
    OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&path)?;
    match fs::remove_file(&path) {
        // Another program swept the file away.
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// Whether two paths are one file. A device, a pipe or a standard stream is no file that can be destroyed.
fn same_file(a: &Path, b: &Path) -> bool {
    if [a, b]
        .iter()
        .any(|path| atomic_file::stream(path).is_some())
    {
        return false;
    }
    match (fs::metadata(a), fs::metadata(b)) {
        (Ok(a), Ok(_)) if a.is_file() && atomic_file::is_at(&a, b) => true,
        (Ok(there), _) | (_, Ok(there)) if !there.is_file() => false,
        _ => atomic_file::target(a) == atomic_file::target(b),
    }
}

const OUTPUT: &str = "standard output";

/// The stream of this process that leads to the file at `path`, if one does.
fn printed_to(path: &Path) -> Option<&'static str> {
    let (output, error) = (io::stdout(), io::stderr());
    let streams = [(OUTPUT, output.as_fd()), ("standard error", error.as_fd())];
    let leads = |stream: std::os::fd::BorrowedFd<'_>| {
        let open = File::from(stream.try_clone_to_owned().ok()?);
        let open = open.metadata().ok()?;
        (open.is_file() && atomic_file::is_at(&open, path)).then_some(())
    };
    let found = streams
        .into_iter()
        .find(|(_, stream)| leads(*stream).is_some());
    found.map(|(name, _)| name)
}

/// Whether this is a pipe or a socket, which has another end.
fn is_connected(there: &fs::Metadata) -> bool {
    let kind = there.file_type();
    kind.is_fifo() || kind.is_socket()
}
