//! The program from outside: its output, its files and its exit codes.

use std::path::Path;
use std::process::{Command, Output};

fn palpate(arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_palpate");
    Command::new(program)
        .args(arguments)
        .output()
        .expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("the program prints UTF-8")
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).display().to_string()
}

#[test]
fn a_run_prints_its_summary_and_writes_the_requested_files() {
    for clock in ["virtual", "real"] {
        let folder = tempfile::tempdir().expect("a folder");
        let [log, plot, json] = ["run.mcap", "run.svg", "run.json"].map(|n| path(folder.path(), n));
        let output = palpate(&[
            "run",
            "--clock",
            clock,
            "--duration",
            "0.3",
            "--seed",
            "9",
            "--log",
            &log,
            "--plot",
            &plot,
            "--json",
            &json,
        ]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let printed = text(&output.stdout);
        for part in [
            "300 at 1000 Hz",
            "missed deadlines",
            "host",
            "dropped",
            "peak",
            "work",
        ] {
            assert!(printed.contains(part), "{part} is missing from:\n{printed}");
        }
        assert_eq!(printed.contains("woke late"), clock == "real");

        let summary: serde_json::Value =
            serde_json::from_slice(&std::fs::read(&json).expect("JSON was written"))
                .expect("it is JSON");
        assert_eq!(summary["schema"], "palpate.run/4");
        assert_eq!(summary["clock"], clock);
        assert_eq!(summary["seed"], 9);
        assert_eq!(summary["tick"]["count"], 300);
        assert_eq!(summary["devices"].as_array().map(Vec::len), Some(2));
        assert_eq!(summary["failures"].as_array().map(Vec::len), Some(0));

        let rows = host::log::read_log(&std::fs::read(&log).expect("the log was written"))
            .expect("it can be read");
        assert_eq!(rows.len(), 300);
        let svg = std::fs::read_to_string(&plot).expect("the plot was written");
        assert!(svg.starts_with("<svg") && svg.contains("Force") && svg.contains("left"));
    }
}

#[test]
fn help_lists_the_commands_and_plan_the_stages() {
    let help = text(&palpate(&["--help"]).stdout);
    for part in ["run", "plan", "bench", "Examples:"] {
        assert!(help.contains(part), "{part} is missing from:\n{help}");
    }
    let plan = text(&palpate(&["plan"]).stdout);
    for line in [
        "run   solve",
        "skip  tear",
        "no tear threshold",
        "run   condense",
    ] {
        assert!(plan.contains(line), "{line} is missing from:\n{plan}");
    }
}

#[test]
fn a_wrong_scene_gives_one_line_and_exit_code_2() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = path(folder.path(), "bad.toml");
    let default = include_str!("../../../scenes/stretch.toml");
    // A group that does not exist in the mesh; the error appears when the scene is built.
    let bad = default.replace("group = \"left\"", "group = \"lfet\"");
    std::fs::write(&scene, bad).expect("written");
    let json = path(folder.path(), "never.json");
    let output = palpate(&["run", &scene, "--json", &json]);
    assert_eq!(output.status.code(), Some(2));
    let error = text(&output.stderr);
    assert_eq!(error.lines().count(), 1, "{error}");
    for part in [
        "bad.toml:",
        "body[0].handle[0].group",
        "\"lfet\"",
        "\"left\", \"right\"",
    ] {
        assert!(error.contains(part), "{part} is missing from: {error}");
    }
    assert!(
        !Path::new(&json).exists(),
        "a refused run leaves nothing behind"
    );

    assert_eq!(
        palpate(&["run", &path(folder.path(), "none.toml")])
            .status
            .code(),
        Some(2)
    );
    assert_eq!(palpate(&["run", "--duration", "-1"]).status.code(), Some(2));
}
