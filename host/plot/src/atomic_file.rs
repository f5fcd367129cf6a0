//! Writes a file whole or not at all. No reader sees a half-written result, and a failed write leaves the
//! older file unchanged.

use rustix::fs::{OFlags, fcntl_setfl};
use std::fs;
use std::io::{self, Write};
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// A file that could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct AtomicFileError {
    /// The file.
    pub path: PathBuf,
    /// The system's error.
    pub source: io::Error,
}

/// Replaces the file at `path` by `content`. The function writes a temporary file in the same folder, flushes
/// this file to the disk and renames it. A link is followed. A device or a pipe is written to directly. The names of
/// the standard streams (`/dev/stdout`) mean the streams of this process, wherever they lead: a file to which the output
/// is redirected is not replaced, and a reader that closes the pipe of the output has read enough.
///
/// # Errors
/// If the folder is missing or not writable, or the disk is full.
pub fn write_atomically(path: &Path, content: &[u8]) -> Result<(), AtomicFileError> {
    write_with(path, |to| to.write_all(content))
}

/// Replaces the file at `path` by what `write` writes, as [`write_atomically`] does: for a content that is too large for
/// the memory.
///
/// # Errors
/// Those of [`write_atomically`], and those of `write`.
pub fn write_with(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), AtomicFileError> {
    replace(path, write).map_err(|source| AtomicFileError {
        path: path.to_owned(),
        source,
    })
}

fn replace(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    match stream(path) {
        Some(Stream::Output) => {
            let mut output = io::stdout().lock();
            return match write(&mut output).and_then(|()| output.flush()) {
                // Its reader has read enough.
                Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
                written => written,
            };
        }
        Some(Stream::Error) => return write(&mut io::stderr().lock()),
        None => {}
    }
    let target = target(path);
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Ok(there) if !there.is_file() => return write(&mut open_stream(path)?),
        _ => {}
    }
    let mut file = temporary_file(folder_of(&target))?;
    write(file.as_file_mut())?;
    if let Ok(there) = fs::metadata(&target) {
        // Who may read and write the file stays as its owner set it.
        file.as_file().set_permissions(there.permissions())?;
    }
    file.as_file().sync_all()?;
    file.persist(&target).map_err(|error| error.error)?;
    Ok(())
}

/// Opens a device or a pipe to be written from beginning to end. It does not wait for the reader of a pipe.
///
/// # Errors
/// The error of the system; for a pipe without a reader and for a socket, a sentence that says what to do.
pub fn open_stream(path: &Path) -> io::Result<fs::File> {
    let refuse = |problem: &str| Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
    let kind = fs::metadata(path)?.file_type();
    if kind.is_socket() {
        return refuse("this is a socket; give a file");
    }
    let mut options = fs::OpenOptions::new();
    options
        .write(true)
        .custom_flags(OFlags::NONBLOCK.bits() as i32);
    match options.open(path) {
        Ok(file) => {
            fcntl_setfl(&file, OFlags::empty())?;
            Ok(file)
        }
        Err(error)
            if kind.is_fifo()
                && error.raw_os_error() == Some(rustix::io::Errno::NXIO.raw_os_error()) =>
        {
            refuse("nobody reads this pipe; start its reader first, or give a file")
        }
        Err(error) => Err(error),
    }
}

/// The beginning and the end of the name of a temporary file.
const TEMPORARY: [&str; 2] = [".palpate-", ".tmp"];

/// The temporary files of this program that may be there.
static OWN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
/// The number of paths from which on the paths of files that no longer exist are forgotten.
const MANY: usize = 64;

/// Removes the temporary files of this program, which is about to end in the middle of its work.
pub fn abandon() {
    let mut own = OWN.lock().unwrap_or_else(PoisonError::into_inner);
    for path in own.drain(..) {
        // It may have become an output, or have been removed.
        let _ = fs::remove_file(path);
    }
}

/// Notes a temporary file of this program.
fn note(path: &Path) {
    let mut own = OWN.lock().unwrap_or_else(PoisonError::into_inner);
    if own.len() >= MANY {
        own.retain(|path| path.exists());
    }
    own.push(path.to_owned());
}

/// A temporary file that is locked, so that [`sweep`] leaves it alone.
fn temporary_file(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    loop {
        let mut builder = tempfile::Builder::new();
        builder.prefix(TEMPORARY[0]).suffix(TEMPORARY[1]);
        // Those of any new file, less the user's mask. By default a temporary file is closed to other users.
        builder.permissions(fs::Permissions::from_mode(0o666));
        let file = builder.tempfile_in(folder)?;
        // Some network file systems have no locks.
        let _ = file.as_file().lock();
        // Another program may have swept the file away before it was locked.
        if file.path().exists() {
            note(file.path());
            return Ok(file);
        }
    }
}

/// Removes the temporary files that killed programs have left in a folder: those that no program holds. The folder may be
/// missing.
pub fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let [begin, end] = TEMPORARY;
        let is_ours = name.to_str().is_some_and(|name| {
            name.starts_with(begin) && name.ends_with(end) && name.len() > begin.len() + end.len()
        });
        if !is_ours || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        // The lock is held until the file is removed. A file that stays does no harm.
        if let Ok(file) = fs::OpenOptions::new().write(true).open(entry.path())
            && file.try_lock().is_ok()
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// A standard stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The standard output.
    Output,
    /// The standard error.
    Error,
}

/// The standard stream that the path names, if it names one.
pub fn stream(path: &Path) -> Option<Stream> {
    match path.to_str()? {
        "/dev/stdout" | "/dev/fd/1" | "/proc/self/fd/1" => Some(Stream::Output),
        "/dev/stderr" | "/dev/fd/2" | "/proc/self/fd/2" => Some(Stream::Error),
        _ => None,
    }
}

/// The file that a write to `path` would replace or create: links are followed, also a link to a file that does not
/// exist. Different paths of one place give the same path.
pub fn target(path: &Path) -> PathBuf {
    if let Ok(there) = fs::canonicalize(path) {
        return there;
    }
    let mut target = path.to_owned();
    // Linux follows 40 links.
    for _ in 0..40 {
        match fs::read_link(&target) {
            Ok(next) => target = folder_of(&target).join(next),
            Err(_) => break,
        }
    }
    // The folder may be new, too.
    match target.file_name() {
        Some(name) => self::target(folder_of(&target)).join(name),
        None => target,
    }
}

/// Whether the file at `path` is the file with the metadata `open`.
pub fn is_at(open: &fs::Metadata, path: &Path) -> bool {
    let there = fs::metadata(path);
    there.is_ok_and(|there| (there.dev(), there.ino()) == (open.dev(), open.ino()))
}

/// The folder of a file.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// Writes a value as indented JSON, either completely or not at all.
///
/// # Errors
///
/// [`AtomicFileError`] if the file cannot be written.
pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), AtomicFileError> {
    // This fails only for maps whose keys are no strings and for failing writers. There are none of either.
    let mut json = serde_json::to_string_pretty(value).unwrap_or_default();
    json.push('\n');
    write_atomically(path, json.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_and_no_temporary_file_remains() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("plot.svg");
        write_atomically(&path, b"old and longer").expect("first");
        write_atomically(&path, b"new").expect("second");
        assert_eq!(fs::read(&path).expect("the file"), b"new");
        assert_eq!(fs::read_dir(&folder).expect("the folder").count(), 1);
    }

    #[test]
    fn permissions_are_those_of_any_new_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let mode = |name: &str| {
            let metadata = fs::metadata(folder.path().join(name)).expect("the file");
            metadata.permissions().mode()
        };
        fs::write(folder.path().join("plain"), b"").expect("plain");
        write_atomically(&folder.path().join("atomic"), b"").expect("atomic");
        assert_eq!(mode("plain"), mode("atomic"));
    }

    #[test]
    fn a_replaced_file_keeps_its_permissions() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("private.json");
        for mode in [0o600, 0o640, 0o664] {
            fs::write(&path, b"old").expect("the file");
            fs::set_permissions(&path, fs::Permissions::from_mode(mode)).expect("a mode");
            write_atomically(&path, b"new").expect("replaced");
            let there = fs::metadata(&path).expect("the file");
            assert_eq!(there.permissions().mode() & 0o7777, mode);
            assert_eq!(fs::read(&path).expect("the file"), b"new");
        }
    }

    /// Opening the pipe, or writing to the socket, would wait without end or fail after the work.
    #[test]
    fn a_pipe_needs_a_reader_and_a_socket_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let (pipe, socket) = (folder.path().join("pipe"), folder.path().join("socket"));
        let mode = rustix::fs::Mode::from_raw_mode(0o600);
        let kind = rustix::fs::FileType::Fifo;
        rustix::fs::mknodat(rustix::fs::CWD, &pipe, kind, mode, 0).expect("a pipe");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).expect("a socket");
        let said = |path: &Path| {
            write_atomically(path, b"text")
                .expect_err("no file")
                .to_string()
        };
        assert!(
            said(&pipe).ends_with("nobody reads this pipe; start its reader first, or give a file")
        );
        assert!(said(&socket).ends_with("this is a socket; give a file"));
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read(pipe).expect("the text")
        });
        while write_atomically(&pipe, b"text").is_err() {
            std::thread::yield_now();
        }
        assert_eq!(reader.join().expect("no panic"), b"text");
    }

    #[test]
    fn what_a_killed_program_left_is_swept_away_and_what_is_held_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let held = temporary_file(folder.path()).expect("a file");
        fs::write(folder.path().join(".palpate-Xy12.tmp"), b"").expect("left");
        for other in [".palpate-.tmp", "palpate-a.tmp", ".other.tmp", "plot.svg"] {
            fs::write(folder.path().join(other), b"").expect("another file");
        }
        sweep(folder.path());
        let entries = fs::read_dir(&folder).expect("the folder").flatten();
        let mut names: Vec<_> = entries.map(|entry| entry.file_name()).collect();
        names.sort();
        let held = held.path().file_name().expect("a name").to_owned();
        let mut expected: Vec<_> = [".palpate-.tmp", "palpate-a.tmp", ".other.tmp", "plot.svg"]
            .map(Into::into)
            .to_vec();
        expected.push(held);
        expected.sort();
        assert_eq!(names, expected);
    }

    #[test]
    fn a_link_stays_a_link_and_a_device_is_written_to() {
        let folder = tempfile::tempdir().expect("a folder");
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, b"old").expect("the file");
        std::os::unix::fs::symlink(&file, &link).expect("the link");
        write_atomically(&link, b"new").expect("through the link");
        assert_eq!(fs::read(&file).expect("the file"), b"new");
        assert!(fs::symlink_metadata(&link).expect("the link").is_symlink());
        write_atomically(Path::new("/dev/null"), b"gone").expect("the device");
        // A link to a file that does not exist yet.
        fs::remove_file(&file).expect("removed");
        write_atomically(&link, b"newer").expect("through the link");
        assert_eq!(fs::read(&file).expect("the file"), b"newer");
        assert!(fs::symlink_metadata(&link).expect("the link").is_symlink());
    }

    #[test]
    fn a_place_has_one_path_also_before_it_exists() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |path: &str| target(&folder.path().join(path));
        let expected = fs::canonicalize(&folder).expect("a folder").join("new/a/b");
        for path in ["new/a/b", "./new/./a/b", "new//a/b"] {
            assert_eq!(at(path), expected, "{path}");
        }
        let here = std::env::current_dir().expect("a folder");
        assert_eq!(target(Path::new("new/b")), here.join("new/b"));
        assert_eq!(target(Path::new("./new/b")), here.join("new/b"));
    }

    #[test]
    fn an_error_names_the_path() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = folder.path().join("missing/plot.svg");
        let error = write_atomically(&missing, b"").expect_err("no folder");
        assert!(error.to_string().contains("missing/plot.svg"), "{error}");
        let error = write_atomically(folder.path(), b"").expect_err("a folder");
        assert_eq!(error.source.kind(), io::ErrorKind::IsADirectory);
    }
}
