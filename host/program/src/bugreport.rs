//! `palpate bugreport`: packs the facts that explain a fault of this machine into one archive, for an issue or a mail.
//!
//! A part that cannot be had, such as the answer of a program that does not run, stops nothing: the first file of the archive
//! lists the parts, each with its size or with the reason of its absence.

use super::outputs::{Declared, Format};
use super::settings::{SettingsFile, SettingsJson};
use super::{COMMIT, CommandError, doctor, serve::status};
use host::atomic_file::write_with;
use host::log::series;
use host::machine::Machine;
use host::scene::settings::MACHINE_FILE;
use serde::Serialize;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

const EXAMPLES: &str = "\
Parts of the archive: program and machine, settings with the file that gives them, the served scene, the checks of `palpate \
doctor`, the answer of `palpate status`, the last messages of the service and of the kernel, and the last log. They name this \
machine's processor, kernel, paths and devices with their serial numbers: read them before you send them.

Examples:
  palpate bugreport                            pack palpate-bugreport.tar
  palpate bugreport fault.tar --log run.mcap   with the log of a run that was no service
  sudo -u palpate palpate bugreport /tmp/fault.tar
                                               as the account of the service, which may read logs and socket";

/// The folder within the archive.
const FOLDER: &str = "palpate-bugreport";
/// Number of the last messages of the service and of the kernel.
const MESSAGES: &str = "1000";

/// Arguments of `palpate bugreport`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct BugreportArguments {
    /// The archive
    #[arg(default_value = "palpate-bugreport.tar")]
    file: PathBuf,
    /// The log. Default: the last file of `palpate serve` in `log.folder` of the settings
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    #[command(flatten)]
    settings: SettingsFile,
}

/// A file of the archive.
struct Part {
    name: &'static str,
    /// What the part tells.
    about: &'static str,
    /// The bytes, or the reason of their absence.
    content: Result<Content, String>,
}

enum Content {
    Text(Vec<u8>),
    /// An open file, and its length when it was opened: a log may grow meanwhile.
    File(File, u64),
}

impl Content {
    fn bytes(&self) -> u64 {
        match self {
            Self::Text(text) => text.len() as u64,
            Self::File(_, length) => *length,
        }
    }
}

pub(super) fn run(arguments: &BugreportArguments) -> Result<(), CommandError> {
    let _held = Declared::default()
        .input("the log", arguments.log.as_deref())
        .file("FILE", Some(&arguments.file), Format::Archive)
        .check()?;
    let parts = gather(arguments);
    let list = list(&parts);
    write_with(&arguments.file, |to| pack(&list, parts, to))?;
    outln!("{list}\npacked into {}", arguments.file.display());
    Ok(())
}

/// All parts. Wrong settings are a part of the fault, so each part does without them.
fn gather(arguments: &BugreportArguments) -> Vec<Part> {
    let file = &arguments.settings;
    let settings = file.resolve().map_err(|error| error.to_string());
    let set = settings.as_ref().map_err(Clone::clone);
    let asked = set.clone().map(doctor::asked).unwrap_or_default();
    let settings_file = file.settings.as_deref().unwrap_or(Path::new(MACHINE_FILE));
    let scene = match set.clone().map(|set| set.serve_scene.value.as_deref()) {
        Ok(Some(path)) => whole(path),
        Ok(None) => Err("the built-in scene".to_owned()),
        Err(error) => Err(error),
    };
    let log = match (&arguments.log, set.clone()) {
        (Some(path), _) => open(path),
        (None, Ok(set)) => last_log(&set.log_folder.value),
        (None, Err(error)) => Err(error),
    };
    let answer = set.clone().and_then(|set| {
        let socket = &set.socket.value;
        status::ask(socket).map_err(|error| format!("{}: {error}", socket.display()))
    });
    let core = asked.core;
    let instructions = std::env::consts::ARCH.to_owned();
    let part = |name, about, content| Part {
        name,
        about,
        content,
    };
    vec![
        part(
            "machine.json",
            "program and machine",
            Ok(json(&Machine::here(COMMIT, instructions, core))),
        ),
        part(
            "settings.json",
            "settings, each with what gives it",
            set.map(|set| json(&SettingsJson::of(set))),
        ),
        part("palpate.toml", "file of the settings", whole(settings_file)),
        part("scene.toml", "served scene", scene),
        part(
            "doctor.json",
            "what the machine lacks",
            Ok(json(&doctor::examined(&asked))),
        ),
        part(
            "status.json",
            "answer of the program that serves",
            answer.map(|answer| json(&answer)),
        ),
        part(
            "service.txt",
            "last messages of the service",
            messages(&["--unit", "palpate.service"]),
        ),
        part(
            "kernel.txt",
            "last messages of the kernel",
            messages(&["--dmesg"]),
        ),
        part("log.mcap", "last log", log),
    ]
}

fn json(value: &impl Serialize) -> Content {
    // This fails only for maps whose keys are no strings. There are none.
    Content::Text(serde_json::to_vec_pretty(value).unwrap_or_default())
}

fn whole(path: &Path) -> Result<Content, String> {
    let read = fs::read(path).map(Content::Text);
    read.map_err(|error| format!("{}: {error}", path.display()))
}

fn open(path: &Path) -> Result<Content, String> {
    let opened = File::open(path).and_then(|file| {
        let length = file.metadata()?.len();
        Ok(Content::File(file, length))
    });
    opened.map_err(|error| format!("{}: {error}", path.display()))
}

/// The last log of `palpate serve` in a folder.
fn last_log(folder: &Path) -> Result<Content, String> {
    let folder = match folder {
        folder if folder == Path::new("") => Path::new("."),
        folder => folder,
    };
    match series::last(folder) {
        Ok(Some(file)) => open(&file),
        Ok(None) => Err(format!(
            "{} has no log of palpate serve; --log packs another log",
            folder.display()
        )),
        Err(error) => Err(format!("{}: {error}", folder.display())),
    }
}

/// The last messages that the system's journal has of the origin `of`.
fn messages(of: &[&str]) -> Result<Content, String> {
    let mut command = Command::new("journalctl");
    command.args(["--no-pager", "--quiet", "--lines", MESSAGES]);
    let output = command.args(of).output();
    let output = output.map_err(|error| format!("journalctl: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    match (output.status.success(), output.stdout.is_empty()) {
        (true, false) => Ok(Content::Text(output.stdout)),
        (true, true) => Err("the journal has none that this account may read".to_owned()),
        (false, _) => Err(format!("journalctl: {}", said.trim())),
    }
}

/// The first file of the archive: the parts in words.
fn list(parts: &[Part]) -> String {
    let mut list = format!(
        "palpate {}, commit {}\n\n",
        env!("CARGO_PKG_VERSION"),
        COMMIT.unwrap_or("unknown")
    );
    for Part {
        name,
        about,
        content,
    } in parts
    {
        let size = match content {
            Ok(content) => format!("{} KiB", content.bytes().div_ceil(1024)),
            Err(reason) => format!("absent: {}", reason.replace('\n', " ")),
        };
        // Writing into a text does not fail.
        let _ = writeln!(list, "  {name:<14} {about:<34} {size}");
    }
    list
}

/// Writes the archive: the list, and each part that is there.
fn pack(list: &str, parts: Vec<Part>, to: &mut dyn Write) -> io::Result<()> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let now = now.map_or(0, |time| time.as_secs());
    let mut archive = tar::Builder::new(to);
    let mut append = |name: &str, content: Content| {
        let mut header = tar::Header::new_gnu();
        header.set_size(content.bytes());
        header.set_mode(0o644);
        header.set_mtime(now);
        let path = format!("{FOLDER}/{name}");
        match content {
            Content::Text(text) => archive.append_data(&mut header, path, text.as_slice()),
            Content::File(file, length) => {
                archive.append_data(&mut header, path, file.take(length))
            }
        }
    };
    append("README.txt", Content::Text(list.as_bytes().to_vec()))?;
    for part in parts {
        if let Ok(content) = part.content {
            append(part.name, content)?;
        }
    }
    archive.finish()
}
