//! `palpate bugreport` from outside: the archive of a machine without a service, and with settings that are wrong.

use std::collections::HashMap;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Output};

pub(crate) fn palpate(folder: &Path, line: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.args(line.split_whitespace()).current_dir(folder);
    command.output().expect("the program starts")
}

/// The files of an archive by their names.
pub(crate) fn files(archive: &Path) -> HashMap<String, Vec<u8>> {
    let mut archive = tar::Archive::new(fs::File::open(archive).expect("the archive"));
    let entries = archive.entries().expect("an archive").map(|entry| {
        let mut entry = entry.expect("a file");
        let path = entry.path().expect("a path").into_owned();
        let name = path
            .strip_prefix("palpate-bugreport")
            .expect("all files are in one folder");
        let mut content = Vec::new();
        entry.read_to_end(&mut content).expect("its bytes");
        (name.display().to_string(), content)
    });
    entries.collect()
}

#[test]
fn an_archive_has_the_parts_that_are_there_and_the_reasons_of_the_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    fs::write(
        here.join("palpate.toml"),
        format!(
            "serve.socket = '{0}/no.sock'\nlog.folder = '{0}/logs'\ntick.priority = 70\n",
            here.display()
        ),
    )
    .expect("settings");
    fs::create_dir(here.join("logs")).expect("a folder");
    fs::write(here.join("logs/palpate-000009-0001.mcap"), "older").expect("a log");
    fs::write(here.join("logs/palpate-000010-0002.mcap"), "newest").expect("a log");
    let output = palpate(here, "bugreport --settings palpate.toml");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{printed}");
    let files = files(&here.join("palpate-bugreport.tar"));
    let text = |name: &str| String::from_utf8_lossy(&files[name]).into_owned();
    assert!(printed.contains(text("README.txt").as_str()), "{printed}");
    for line in text("README.txt")
        .lines()
        .filter(|line| line.starts_with("  "))
    {
        let name = line.split_whitespace().next().expect("a name");
        assert_eq!(
            files.contains_key(name),
            !line.contains("absent: "),
            "{line}"
        );
    }
    assert!(!files.contains_key("status.json") && !files.contains_key("scene.toml"));
    assert!(text("README.txt").contains("no.sock: No such file"));
    assert_eq!(files["log.mcap"], b"newest");
    assert!(text("palpate.toml").contains("tick.priority = 70"));
    let json = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&files[name]).expect("it is JSON")
    };
    assert_eq!(json("doctor.json")["priority"], 70);
    assert_eq!(json("settings.json")["schema"], "palpate.settings/1");
    assert!(json("machine.json")["version"].is_string());
}

#[test]
fn wrong_settings_are_a_part_of_the_report() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    fs::write(here.join("palpate.toml"), "tick.priority = 1000\n").expect("settings");
    fs::write(here.join("run.mcap"), "a log").expect("a log");
    let output = palpate(
        here,
        "bugreport report.tar --settings palpate.toml --log run.mcap",
    );
    assert_eq!(output.status.code(), Some(0));
    let files = files(&here.join("report.tar"));
    let list = String::from_utf8_lossy(&files["README.txt"]).into_owned();
    assert!(list.contains("tick.priority: found 1000"), "{list}");
    assert!(!files.contains_key("settings.json") && files.contains_key("doctor.json"));
    assert_eq!(files["palpate.toml"], b"tick.priority = 1000\n");
    assert_eq!(files["log.mcap"], b"a log");
}

#[test]
fn an_archive_replaces_neither_the_log_nor_a_file_of_another_kind() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    fs::write(here.join("run.tar"), "a log").expect("a log");
    for line in ["bugreport run.tar --log run.tar", "bugreport report.json"] {
        assert_eq!(palpate(here, line).status.code(), Some(2), "{line}");
    }
    assert_eq!(fs::read(here.join("run.tar")).expect("the log"), b"a log");
}
