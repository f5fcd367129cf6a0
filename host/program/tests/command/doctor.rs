//! `palpate doctor` from outside: its table, its files and its exit codes on this machine, whatever this machine lacks.

use std::process::{Command, Output};

fn palpate(arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_palpate");
    Command::new(program)
        .args(arguments)
        .output()
        .expect("the program starts")
}

#[test]
fn the_table_the_files_and_the_exit_code_agree() {
    let folder = tempfile::tempdir().expect("a folder");
    let [json, script] =
        ["doctor.json", "tune.sh"].map(|name| folder.path().join(name).display().to_string());
    let output = palpate(&["doctor", "--json", &json, "--script", &script]);
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let text = std::fs::read(&json).expect("JSON was written");
    let report: serde_json::Value = serde_json::from_slice(&text).expect("it is JSON");
    assert_eq!(report["schema"], "palpate.doctor/1");
    let checks = report["checks"].as_array().expect("a list");
    let count = |verdict: &str| {
        checks
            .iter()
            .filter(|check| check["verdict"] == verdict)
            .count()
    };
    let expected = match (count("lacking"), count("unknown")) {
        (0, 0) => 0,
        (0, _) => 2,
        _ => 1,
    };
    assert_eq!(output.status.code(), Some(expected), "{printed}");
    for check in checks {
        let name = check["name"].as_str().expect("a name");
        assert!(printed.contains(name), "{name} is missing from:\n{printed}");
        let mends = check["mend"].as_array().map_or(0, Vec::len);
        assert_eq!(mends > 0, check["verdict"] == "lacking", "{check}");
    }
    let syntax = Command::new("sh").args(["-n", &script]).status();
    assert!(syntax.expect("a shell").success());
}

#[test]
fn a_core_that_the_machine_has_not_is_refused() {
    let output = palpate(&["doctor", "--core", "4000"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("--core") && said.contains("4000"), "{said}");
    assert!(output.stdout.is_empty());
}

#[test]
fn a_run_begins_with_the_doctor_s_line_under_the_real_clock_alone() {
    for (clock, lines) in [("real", 1), ("virtual", 0)] {
        let output = palpate(&["run", "--clock", clock, "--duration", "0.1"]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let found = said
            .lines()
            .filter(|line| line.starts_with("palpate: doctor: "))
            .count();
        assert_eq!(found, lines, "{clock}: {said}");
    }
}
