//! `palpate stress scene` resumes, and prints one complete trial.

use std::path::Path;
use std::process::Command;

#[test]
fn the_program_resumes_and_shows_one_trial_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/stress/sheet.toml");
    let [json, plot, log] = ["cells.jsonl", "cell.svg", "cell.csv"].map(|n| folder.path().join(n));
    let palpate = |arguments: &[&str], files: &[(&str, &Path)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
        command
            .args(["stress", "scene"])
            .arg(&scene)
            .args(arguments);
        for (name, file) in files {
            command.arg(name).arg(file);
        }
        let output = command.output().expect("the program starts");
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{error}");
        String::from_utf8(output.stdout).expect("it prints UTF-8")
    };
    let two = ["--runs", "2", "--schemes", "linear,capped"];
    let first = palpate(&two, &[("--json", &json)]);
    let passed = "passive, bounded and true to the body under capped: all 2 trials\n";
    assert!(first.starts_with(passed), "{first}");
    assert!(first.contains("| all | capped | 2 | 100.0 |"), "{first}");
    // Two trials have no quantiles.
    let errors = first.lines().filter(|line| line.starts_with("| all |"));
    assert!(errors.clone().all(|line| line.contains("most")), "{first}");
    assert_eq!(errors.count(), 4, "{first}");
    for line in first.lines() {
        assert!(line.chars().count() <= 120, "{line}");
    }
    let written = std::fs::read(&json).expect("it was written");
    assert_eq!(first, palpate(&two, &[("--json", &json)]));
    assert_eq!(written, std::fs::read(&json).expect("it is there"));

    let shown = palpate(
        &["--cell", "1", "--scheme", "linear"],
        &[("--plot", &plot), ("--log", &log)],
    );
    assert!(shown.starts_with("trial 1 of seed 1\n"), "{shown}");
    assert!(
        shown.contains("\nlinear: passive, bounded, true to the body"),
        "{shown}"
    );
    assert!(!shown.contains('{'), "{shown}");
    let svg = std::fs::read_to_string(&plot).expect("it was drawn");
    assert!(svg.contains("Net work on the hands (mJ)"));
    // One line for each tick, and the head.
    let lines = std::fs::read_to_string(&log).expect("it was logged");
    assert_eq!(lines.lines().count(), 4501);
}

#[test]
fn without_a_scene_file_each_trial_draws_its_body_and_can_be_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let written = folder.path().join("cell.toml");
    let palpate = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
        let output = command
            .args(arguments)
            .output()
            .expect("the program starts");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("it prints UTF-8");
        assert!(output.status.success(), "{}", text(output.stderr));
        (text(output.stdout), text(output.stderr))
    };
    let file = written.to_str().expect("a path");
    let trial = ["stress", "scene", "--trouble", "stalls", "--cell", "1"];
    let (shown, told) = palpate(&[&trial[..], &["--write", file]].concat());
    assert!(shown.contains("\ncapped: "), "{shown}");
    // The stalls are those of the option that is told.
    assert!(
        told.contains("cell.toml: not in the scene file: the host stalls"),
        "{told}"
    );
    let stalls = told.lines().filter_map(|line| line.split_once("--fault "));
    let stalls: Vec<_> = stalls.flat_map(|(_, stall)| ["--fault", stall]).collect();
    palpate(&[&["run", file][..], &stalls].concat());
    let two = [
        "--runs",
        "1",
        "--schemes",
        "capped",
        "--rate",
        "250",
        "--trouble",
        "nothing",
    ];
    let (table, _) = palpate(&[&["stress", "scene"], &two[..]].concat());
    assert!(table.contains("\ndrawn bodies: 1 trials"), "{table}");
}
