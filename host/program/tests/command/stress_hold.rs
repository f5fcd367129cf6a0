//! `palpate stress hold` resumes, prints one complete cell, and writes a cell as a scene.

use std::path::Path;
use std::process::Command;

#[test]
fn the_program_resumes_and_shows_one_cell_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let palpate = |arguments: &[&str], files: &[(&str, &Path)]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
        command.args(arguments);
        for (name, file) in files {
            command.arg(name).arg(file);
        }
        let output = command.output().expect("the program starts");
        let text = String::from_utf8(output.stdout).expect("it prints UTF-8");
        (output.status.code(), text)
    };
    // Paper that passes; the shard contains only this cell of the first eight.
    let json = path("cells.jsonl");
    let one = ["stress", "hold", "--runs", "8", "--shard", "8/8"];
    let (code, first) = palpate(&one, &[("--json", &json)]);
    assert_eq!(code, Some(0), "{first}");
    assert!(first.contains("| paper | capped | 1 | 1 |"), "{first}");
    let written = std::fs::read(&json).expect("it was written");
    assert_eq!(palpate(&one, &[("--json", &json)]), (code, first));
    assert_eq!(written, std::fs::read(&json).expect("it is there"));

    let [plot, log, scene] = ["cell.svg", "cell.csv", "cell.toml"].map(path);
    let (code, shown) = palpate(
        &["stress", "hold", "--cell", "7", "--scheme", "linear"],
        &[("--plot", &plot), ("--log", &log), ("--write", &scene)],
    );
    assert_eq!(code, Some(0));
    assert!(shown.contains("cell 7 of seed 1: "), "{shown}");
    assert!(shown.contains("\nlinear: within all limits\n"), "{shown}");
    let svg = std::fs::read_to_string(&plot).expect("it was drawn");
    assert!(svg.contains("own along this run"));
    // One line for each tick, and the head.
    let lines = std::fs::read_to_string(&log).expect("it was logged");
    assert_eq!(lines.lines().count(), 4501);
    // The drawn cell is a scene like any other, and has the same verdict.
    let (code, judged) = palpate(&["stress", "hold", scene.to_str().expect("a path")], &[]);
    assert_eq!(code, Some(0), "{judged}");
    assert!(!judged.contains("not judged"), "{judged}");
    let (code, _) = palpate(&["plan", scene.to_str().expect("a path")], &[]);
    assert_eq!(code, Some(0));
}

#[test]
fn the_hold_of_a_hand_that_moves_is_not_judged() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/pantograph.toml");
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    let output = command.args(["stress", "hold", scene]).output();
    let output = output.expect("the program starts");
    let text = String::from_utf8(output.stdout).expect("it prints UTF-8");
    assert_eq!(output.status.code(), Some(0), "{text}");
    let said = "a hand moves in the last second; the hold is not judged\n";
    assert!(text.starts_with(said), "{text}");
    assert!(
        text.contains("| pantograph | 250 | capped |  | - | - |"),
        "{text}"
    );
}
