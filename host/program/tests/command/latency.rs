//! `palpate latency`: what it prints and writes, and its exit codes. No time is judged.

use serde_json::Value;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

type Outcome = Result<(), Box<dyn Error>>;

fn latency(folder: &Path, line: &str) -> Result<Output, Box<dyn Error>> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.arg("latency").args(line.split_whitespace());
    Ok(command.current_dir(folder).output()?)
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The time of that name under the load.
fn time<'a>(load: &'a Value, name: &str) -> Option<&'a Value> {
    load["times"]
        .as_array()?
        .iter()
        .find(|time| time["name"] == name)
}

#[test]
fn every_deadline_is_in_every_output_idle_and_under_load() -> Outcome {
    let folder = tempfile::tempdir()?;
    let files = "--plot l.svg --csv l.csv --json l.json --report l.md";
    let output = latency(
        folder.path(),
        &format!("--duration 1 --load faults,disk --load-folder . {files}"),
    )?;
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let printed = String::from_utf8(output.stdout)?;
    for text in [
        "\nidle: ",
        "\nunder load (faults, disk): ",
        "  worst      at ",
        "Nothing is extrapolated",
    ] {
        assert!(printed.contains(text), "{text}: {printed}");
    }
    let read = |name: &str| fs::read_to_string(folder.path().join(name));
    let json: Value = serde_json::from_str(&read("l.json")?)?;
    assert_eq!(json["schema"], "palpate.latency/1");
    let loads = json["loads"].as_array().ok_or("no loads")?;
    assert_eq!(loads.len(), 2);
    let table = read("l.csv")?;
    for load in loads {
        let number = |value: &Value| value.as_u64().unwrap_or(u64::MAX);
        assert_eq!(
            (number(&load["met"]), number(&load["unknown"])),
            (1000, 0),
            "a tick for each of a second"
        );
        let lateness = time(load, "lateness").ok_or("no lateness")?;
        assert_eq!(number(&lateness["count"]), 1000 + number(&load["skipped"]));
        let counts = lateness["histogram"].as_array().ok_or("no histogram")?;
        let counted: u64 = counts.iter().map(|interval| number(&interval[1])).sum();
        assert_eq!(counted, number(&lateness["count"]));
        // A thousand values tell 99.9 % at most.
        let stated = lateness["percentiles"].as_array().ok_or("no percentiles")?;
        assert!((1..=4).contains(&stated.len()), "{stated:?}");
        for found in stated {
            assert!(
                found["low"].as_f64() <= found["value"].as_f64()
                    && found["value"].as_f64() <= found["high"].as_f64()
            );
        }
        let worst = load["worst"].as_array().ok_or("no worst ticks")?;
        assert_eq!(worst.len(), 10);
        assert_eq!(
            worst[0]["stages"].as_array().map(Vec::len),
            Some(7),
            "two devices"
        );
        let rows = table
            .lines()
            .filter(|row| row.contains(",lateness,") && row.starts_with("idle"));
        assert!(rows.count() > 10);
    }
    let report = read("l.md")?;
    let processor = json["machine"]["processor"]
        .as_str()
        .unwrap_or("unknown processor");
    assert!(
        report.contains(processor) && report.contains("| lateness |"),
        "{report}"
    );
    assert!(read("l.svg")?.contains("Lateness (µs)"));
    // The load's file had no name, and its processes have ended.
    assert_eq!(fs::read_dir(folder.path())?.count(), 4);
    Ok(())
}

#[test]
fn the_edges_of_a_square_wave_are_answered_by_a_motion() -> Outcome {
    let folder = tempfile::tempdir()?;
    let output = latency(
        folder.path(),
        "--duration 2.1 --load none --square-wave right=0,0,0.5 --json l.json",
    )?;
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let json: Value = serde_json::from_str(&fs::read_to_string(folder.path().join("l.json"))?)?;
    let load = &json["loads"][0];
    let bound = time(load, "force to motion of right, bound").ok_or("no bound")?;
    let found =
        bound["count"].as_u64().unwrap_or(0) + load["edges_without_motion"].as_u64().unwrap_or(0);
    // Eight edges, of which skipped deadlines and the end may hide the last two.
    assert!((6..=8).contains(&found), "{found}");
    assert!(time(load, "force to motion of left, bound").is_none());
    Ok(())
}

#[test]
fn wrong_arguments_are_refused_before_anything_runs() -> Outcome {
    let folder = tempfile::tempdir()?;
    for (line, says) in [
        ("--square-wave nobody=0,0,1", "device[nobody]"),
        ("--square-wave right=0,1", "found right=0,1, allowed:"),
        ("--load heat", "heat"),
        ("--duration 0", "found 0, allowed:"),
        ("--core 4000", "--core: found core 4000"),
        (
            "--report l.json",
            "--report l.json: found the ending of another format",
        ),
        ("--cyclictest 1", "--cyclictest"),
        ("--cyclictest 2 --report l.md", "--report"),
    ] {
        let output = latency(folder.path(), line)?;
        let said = said(&output);
        assert_eq!(output.status.code(), Some(2), "{line}: {said}");
        assert!(said.contains(says), "{line}: {said}");
    }
    assert_eq!(fs::read_dir(folder.path())?.count(), 0);
    Ok(())
}
