//! The remaining part of a log after its process was killed, or after its disk was full.

use host::log::Log;
use host::run::replay::{replay, scene_of};
use std::error::Error;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{ChildStderr, Command, Output, Stdio};

type Outcome = Result<(), Box<dyn Error>>;

const PALPATE: &str = env!("CARGO_BIN_EXE_palpate");
/// Ticks in a second of the built-in scene.
const SECOND: u64 = 1000;

/// Ticks that were run and ticks in the log, from a line of progress of the program.
fn progress(line: &str) -> Option<(u64, u64)> {
    let (ticks, logged) = line.strip_prefix("ticks ")?.split_once(" logged ")?;
    Some((ticks.parse().ok()?, logged.trim().parse().ok()?))
}

/// The progress of the program when it has run `until` ticks, or at its end.
fn follow(lines: &mut BufReader<ChildStderr>, until: u64) -> Result<(u64, u64), Box<dyn Error>> {
    let (mut last, mut line) = ((0, 0), String::new());
    while last.0 < until && lines.read_line(&mut line)? > 0 {
        last = progress(&line).unwrap_or(last);
        line.clear();
    }
    Ok(last)
}

/// The log at `path`. Its ticks must be complete from the first on, and replay exactly.
fn sound(path: &Path) -> Result<Log, Box<dyn Error>> {
    let log = Log::parse(&fs::read(path)?)?;
    assert!(
        log.rows
            .iter()
            .map(|row| row.tick)
            .eq(0..log.rows.len() as u64)
    );
    if !log.rows.is_empty() {
        let report = replay(&log, &scene_of(&log, "what is left")?, &mut |_| {})?;
        assert!(report.is_exact(), "{report}");
    }
    Ok(log)
}

/// Runs under the real clock are killed at ticks that a seed decides. All flushed data can be read, and less than a
/// second of the reported ticks is lost. `PALPATE_KILLS` sets the number of runs.
#[test]
fn a_killed_run_loses_less_than_a_second() -> Outcome {
    let kills = match std::env::var("PALPATE_KILLS") {
        Ok(count) => count.parse()?,
        Err(_) => 12,
    };
    let folder = tempfile::tempdir()?;
    let mut state = 7_u64;
    let mut most_lost = 0;
    for kill in 0..kills {
        // Knuth's MMIX constants.
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let until = 1 + (state >> 33) % 2500;
        let path = folder.path().join("run.mcap");
        let mut child = Command::new(PALPATE)
            .args(["run", "--clock", "real", "--duration", "30"])
            .arg("--report-progress")
            .arg("--log")
            .arg(&path)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        let mut lines = BufReader::new(child.stderr.take().ok_or("a pipe")?);
        let before = follow(&mut lines, until)?;
        child.kill()?;
        child.wait()?;
        // The lines that the program printed before it ended.
        let after = follow(&mut lines, u64::MAX)?;
        let (ticks, logged) = (before.0.max(after.0), before.1.max(after.1));

        let log = sound(&path)?;
        let rows = log.rows.len() as u64;
        let at = format!("kill {kill} after tick {ticks}: {rows} ticks in the log");
        assert!(!log.complete && ticks >= until, "{at}");
        assert!(rows >= logged, "{at}, {logged} had been flushed");
        assert!(rows + SECOND > ticks, "{at}");
        most_lost = most_lost.max(ticks.saturating_sub(rows));
    }
    println!("{kills} kills; the most that was lost: {most_lost} ticks");
    Ok(())
}

/// Runs with files limited to 512 KiB, which the program sees as a disk that becomes full during the run.
fn with_small_disk(log: &Path, arguments: &[&str]) -> Result<Output, Box<dyn Error>> {
    Ok(Command::new("sh")
        // The limit is in blocks of 512 bytes, as in POSIX.
        .args(["-c", "ulimit -f 1024; exec \"$0\" \"$@\"", PALPATE])
        .args(["run", "--log"])
        .arg(log)
        .args(arguments)
        .output()?)
}

#[test]
fn a_full_disk_is_reported_and_the_ticks_continue() -> Outcome {
    for clock in ["virtual", "real"] {
        let folder = tempfile::tempdir()?;
        let log = folder.path().join("run.mcap");
        let json = folder.path().join("run.json").display().to_string();
        let output = with_small_disk(
            &log,
            &["--clock", clock, "--duration", "2", "--json", &json],
        )?;
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.code(), Some(1), "{clock}: {said}");
        let failed = format!(
            "FAILED     the log ended early: cannot write the log {}",
            log.display()
        );
        assert!(said.contains(&failed), "{clock}: {said}");

        let summary: serde_json::Value = serde_json::from_str(&fs::read_to_string(&json)?)?;
        assert_eq!(summary["tick"]["count"], 2000, "{clock}");
        // The collector continued, too: the force is largest in the last tenth of the run.
        if clock == "virtual" {
            assert!(summary["devices"][0]["peak_time"].as_f64() > Some(1.8));
        }
        let left = sound(&log)?;
        assert!(
            !left.complete && left.rows.len() >= 100,
            "{clock}: {}",
            left.rows.len()
        );
        assert!(left.rows.len() < 2000, "{clock}: the disk was large enough");
    }
    Ok(())
}

#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_is_full_from_the_start_is_reported_before_the_run() -> Outcome {
    let output = Command::new(PALPATE)
        .args(["run", "--duration", "0.1", "--log", "/dev/full"])
        .output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("cannot write the log /dev/full"), "{said}");
    assert!(output.stdout.is_empty());
    Ok(())
}
