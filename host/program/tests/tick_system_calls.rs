//! The running tick makes no system call but those for the clock and the sleep: observed from outside, with strace.
//!
//! The devices of the scene are simulated, so the tick makes no call to a device either. The test is skipped with a
//! visible line if strace is missing or may not trace.

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;

/// The system calls that are allowed between the first sleep and the last.
const ALLOWED: [&str; 2] = [
    "clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, ",
    "clock_gettime(",
];

/// Runs the program under strace. Returns the trace of the tick's thread, or the reason why there is none.
fn trace(folder: &Path) -> Result<String, String> {
    let traced = Command::new("strace")
        .args(["-ff", "-qq", "-o"])
        .arg(folder.join("thread"))
        .arg(env!("CARGO_BIN_EXE_palpate"))
        .args(["run", "--clock", "real", "--duration", "0.5"])
        .output()
        .map_err(|error| {
            format!("strace cannot be run ({error}); on Debian: apt-get install strace")
        })?;
    let files = fs::read_dir(folder).expect("the folder is there");
    let traces = files.map(|file| {
        let path = file.expect("the folder can be listed").path();
        String::from_utf8_lossy(&fs::read(path).expect("the trace can be read")).into_owned()
    });
    // The thread sets its name before anything else.
    let tick = traces
        .into_iter()
        .find(|trace| trace.contains("\"palpate-tick\""));
    tick.ok_or_else(|| {
        let said = String::from_utf8_lossy(&traced.stderr).into_owned();
        assert!(!said.contains("palpate:"), "the program failed: {said}");
        format!("strace may not trace here ({})", said.trim())
    })
}

#[test]
fn between_the_first_and_the_last_sleep_there_are_only_allowed_calls() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let trace = match trace(folder.path()) {
        Ok(trace) => trace,
        Err(reason) => {
            // The test harness captures `eprintln`.
            let _ = writeln!(
                std::io::stderr(),
                "\n!! SKIPPED: system calls of the tick: {reason}"
            );
            return;
        }
    };
    let lines: Vec<_> = trace.lines().collect();
    let sleeps = |line: &&str| line.starts_with(ALLOWED[0]);
    let first = lines.iter().position(sleeps).expect("the loop slept");
    let last = lines.iter().rposition(sleeps).expect("the loop slept");
    let between = &lines[first..=last];
    let strays: Vec<_> = between
        .iter()
        .filter(|line| !ALLOWED.iter().any(|allowed| line.starts_with(allowed)))
        .collect();
    assert!(
        strays.is_empty(),
        "{} calls, the first: {:?}",
        strays.len(),
        &strays[..strays.len().min(5)]
    );
    // A tick that is late does not sleep, and strace makes many ticks late. One in ten is required.
    let count = between.iter().filter(|line| sleeps(line)).count();
    assert!(count >= 50, "{count} sleeps in 500 ticks");
}
