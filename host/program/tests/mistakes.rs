//! The mistakes of a first day, as a table: what a user does, how the program ends, and its message in full.
//!
//! Each file of `mistakes/` is a group of cases. A case names a shipped scene and what a user changed in it, or files of
//! the user's own, and a command line, which a shell runs in a folder that holds only these. The exit code and all that
//! the program prints on the standard error must be equal to what the case says. `PALPATE_RENEW=1` writes what the
//! program says now into the files, to be read by eye.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A file of `mistakes/`.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Group {
    mistake: Vec<Mistake>,
}

/// One mistake.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
struct Mistake {
    /// The mistake, in words.
    name: String,
    /// The shipped scene that the user changed, by its name in `host/scenes`; it becomes `scene.toml`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    scene: String,
    /// Pairs of a text that occurs once in the scene, and the text that replaces it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    change: Vec<[String; 2]>,
    /// A table at the end of the scene.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    append: String,
    /// Files of the user's own. `\xHH` in a text is the byte HH.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    files: BTreeMap<String, String>,
    /// The command line.
    run: String,
    /// The exit code.
    #[serde(default)]
    code: i32,
    /// All that the program prints on the standard error.
    #[serde(default)]
    says: String,
}

/// The folder of the shipped scenes.
fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes")
}

/// The bytes of a text in which `\xHH` is the byte HH.
fn bytes(text: &str) -> Vec<u8> {
    let mut parts = text.split("\\x");
    let mut bytes = parts.next().unwrap_or_default().as_bytes().to_vec();
    for part in parts {
        let (byte, rest) = part.split_at(2);
        bytes.push(u8::from_str_radix(byte, 16).expect("two hexadecimal digits follow \\x"));
        bytes.extend_from_slice(rest.as_bytes());
    }
    bytes
}

/// Whether a line tells the progress: `palpate: 12 s: 3 % done`.
fn is_progress(line: &str) -> bool {
    let rest = line.strip_prefix("palpate: ").unwrap_or_default();
    rest.split_once(" s: ")
        .is_some_and(|(seconds, _)| seconds.parse::<u64>().is_ok())
}

/// A message of the program without blank ends, and without lines of progress and of the doctor, which depend on the machine.
fn without_progress(message: &str) -> String {
    let lines = message
        .trim()
        .lines()
        // A busy machine may be slow enough for a line of progress.
        .filter(|line| !is_progress(line) && !line.starts_with("palpate: doctor: "));
    lines.collect::<Vec<_>>().join("\n")
}

impl Mistake {
    /// The scene as the user changed it.
    fn changed_scene(&self) -> String {
        let mut scene = fs::read_to_string(scenes().join(&self.scene).with_extension("toml"))
            .unwrap_or_else(|error| panic!("{}: {}: {error}", self.name, self.scene));
        for [old, new] in &self.change {
            let found = scene.matches(old.as_str()).count();
            assert_eq!(found, 1, "{}: {old:?} in {}", self.name, self.scene);
            scene = scene.replace(old.as_str(), new);
        }
        scene + &self.append
    }

    /// Makes the mistake, and returns it with the exit code and the message of now.
    fn make(&self) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for shared in ["meshes", "hands"] {
            std::os::unix::fs::symlink(scenes().join(shared), folder.path().join(shared)).unwrap();
        }
        if !self.scene.is_empty() {
            fs::write(folder.path().join("scene.toml"), self.changed_scene()).unwrap();
        }
        for (name, text) in &self.files {
            fs::write(folder.path().join(name), bytes(text)).unwrap();
        }
        let program = Path::new(env!("CARGO_BIN_EXE_palpate")).parent().unwrap();
        let path = std::env::var("PATH").unwrap_or_default();
        let output = Command::new("sh")
            .args(["-c", &self.run])
            .env("PATH", format!("{}:{path}", program.display()))
            .env("LC_ALL", "C")
            .env("RUST_BACKTRACE", "0")
            .current_dir(folder.path())
            .output()
            .unwrap();
        Self {
            code: output.status.code().unwrap_or(-1),
            says: without_progress(&String::from_utf8_lossy(&output.stderr)),
            ..self.clone()
        }
    }
}

/// Checks a file of `mistakes/`, or renews it.
fn check(group: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/mistakes/{group}.toml"));
    let text = fs::read_to_string(&path).unwrap();
    let Group { mistake } = toml::from_str(&text).unwrap();
    let now: Vec<Mistake> = mistake.iter().map(Mistake::make).collect();
    if std::env::var_os("PALPATE_RENEW").is_some() {
        let renewed = toml::to_string_pretty(&Group { mistake: now }).unwrap();
        return fs::write(&path, renewed).unwrap();
    }
    let different: Vec<String> = (mistake.iter().zip(&now))
        .filter(|(expected, now)| expected != now)
        .map(|(expected, now)| {
            let Mistake { name, run, .. } = expected;
            format!(
                "{name}: {run}\nexpected {}: {}\nfound    {}: {}\n",
                expected.code, expected.says, now.code, now.says
            )
        })
        .collect();
    assert!(different.is_empty(), "{}", different.join("\n"));
}

#[test]
fn values_in_the_wrong_unit() {
    check("units");
}

#[test]
fn rates_and_times_that_do_not_fit() {
    check("rates");
}

#[test]
fn sheets_that_cannot_tear() {
    check("tear");
}

#[test]
fn files_that_are_missing_or_of_another_kind() {
    check("files");
}

#[test]
fn names_that_do_not_exist() {
    check("names");
}

#[test]
fn encodings_and_line_ends() {
    check("encodings");
}

#[test]
fn options_that_do_not_fit() {
    check("options");
}

#[test]
fn disks_pipes_and_signals() {
    check("endings");
}

#[cfg(feature = "view")]
#[test]
fn runs_and_logs_that_cannot_be_shown() {
    check("view");
}
