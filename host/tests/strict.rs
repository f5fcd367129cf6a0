//! `palpate run --clock real`: strict or not, and ended by a signal.

use serde_json::Value;
use std::io::Write as _;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

fn palpate(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.args(["run", "--clock", "real"]).args(arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn summary(path: &Path) -> Value {
    let text = std::fs::read(path).expect("the summary was written");
    serde_json::from_slice(&text).expect("it is JSON")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Whether the run was refused because this system cannot watch system calls.
fn skipped(output: &Output) -> bool {
    let said = text(&output.stderr);
    let why = ["the filter of system calls", "system calls can be watched"];
    let skipped = why.iter().any(|why| said.contains(why));
    if skipped {
        // Not `eprintln`, which the test harness keeps to itself.
        let _ = writeln!(std::io::stderr(), "\n!! SKIPPED: strict runs: {said}");
    }
    skipped
}

#[test]
fn the_built_in_scene_keeps_to_the_calls_of_a_strict_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = folder.path().join("run.json");
    let output = palpate(&["--strict=syscalls", "--duration", "0.5", "--json"])
        .arg(&json)
        .output()
        .expect("the program runs");
    if skipped(&output) {
        return;
    }
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary = summary(&json);
    assert_eq!(summary["failures"], Value::Array(vec![]));
    let tick = |field: &str| summary["tick"][field].as_u64().expect("a number");
    assert_eq!(tick("count"), 500);
    assert_eq!(tick("count") + tick("missed_deadlines"), tick("slots"));
    let refused = summary["dropped"]["telemetry"].as_u64().expect("a number");
    assert_eq!(tick("records") + refused, 500);
    assert_eq!(summary["tick"]["stopped"], Value::Bool(false));
}

#[test]
fn without_the_privileges_it_insists_on_it_does_not_start() {
    // What this account is granted shows without insisting.
    let granted = palpate(&["--duration", "0.05"])
        .output()
        .expect("the program runs");
    let all = !text(&granted.stdout).contains("  note ");
    let output = palpate(&["--strict=privileges", "--duration", "0.05"])
        .output()
        .expect("the program runs");
    let said = text(&output.stderr);
    if all {
        assert_eq!(output.status.code(), Some(0), "{said}");
    } else {
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(
            said.contains("did not grant what the tick insists on"),
            "{said}"
        );
        assert!(!text(&output.stdout).contains("ticks"));
    }
}

#[test]
fn strict_needs_the_real_clock() {
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["run", "--strict", "--duration", "0.01"])
        .output()
        .expect("the program runs");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("--clock real"));
}

/// Waits until the program has its tick's thread, so that a signal finds it at work.
fn wait_for_the_tick(program: &Child) {
    let tasks = format!("/proc/{}/task", program.id());
    let ticking = || {
        let threads = std::fs::read_dir(&tasks).ok()?;
        let mut names =
            threads.filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("comm")).ok());
        names.find(|name| name.starts_with("palpate-tick"))
    };
    while ticking().is_none() {
        std::thread::yield_now();
    }
}

#[test]
fn a_signal_ends_a_run_in_order() {
    for (name, number) in [("INT", 2), ("TERM", 15)] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (json, log) = (
            folder.path().join("run.json"),
            folder.path().join("run.mcap"),
        );
        let program = palpate(&["--duration", "600", "--json"])
            .arg(&json)
            .arg("--log")
            .arg(&log)
            .spawn()
            .expect("the program runs");
        wait_for_the_tick(&program);
        let sent = Command::new("kill")
            .args(["-s", name, &program.id().to_string()])
            .status()
            .expect("there is a kill");
        assert!(sent.success());
        let output = program.wait_with_output().expect("it ends");
        assert_eq!(
            output.status.code(),
            Some(128 + number),
            "{}",
            text(&output.stderr)
        );
        let summary = summary(&json);
        assert_eq!(summary["tick"]["stopped"], Value::Bool(true));
        assert_eq!(summary["failures"], Value::Array(vec![]));
        assert!(text(&output.stdout).contains("stopped"));
        // A finished log ends with the magic of its format.
        let log = std::fs::read(&log).expect("the log was written");
        assert!(log.ends_with(b"\x89MCAP0\r\n"));
    }
}
