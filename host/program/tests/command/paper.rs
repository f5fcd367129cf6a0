//! What a paper needs of a run: program and machine, the time of a step, and the distributions of the ticks.

use std::path::Path;
use std::process::{Command, Output};

fn palpate(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .output()
        .expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(path).expect("written")).expect("JSON")
}

#[test]
fn a_run_under_virtual_time_names_version_and_processor() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = palpate(folder.path(), "run --duration 0.1 --json run.json");
    let printed = text(&output.stdout);
    let machine = printed
        .lines()
        .find(|line| line.starts_with("  machine    palpate "));
    let machine = machine.expect("a line for the machine");
    assert!(machine.contains(env!("CARGO_PKG_VERSION")), "{machine}");
    let json = json(&folder.path().join("run.json"));
    assert_eq!(json["machine"]["version"], env!("CARGO_PKG_VERSION"));
    assert!(json["machine"]["instructions"].is_string());
    if let Some(processor) = json["machine"]["processor"].as_str() {
        assert!(machine.contains(processor), "{machine}");
    }
    // Too few ticks for a ten-thousandth, and no thread whose place could be named.
    assert!(json["tick"]["model_age"][0]["p99_99"].is_null());
    assert!(json["tick"]["place"].is_null());
}

#[test]
fn the_distributions_of_the_ticks_are_a_table_or_a_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["ticks.csv", "ticks.svg"] {
        let line = format!("run --clock real --duration 0.3 --histogram {name} --json run.json");
        let output = palpate(folder.path(), &line);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains(&format!("  histogram  {name}")));
    }
    let table = std::fs::read_to_string(folder.path().join("ticks.csv")).expect("written");
    let count = |quantity: &str| -> u64 {
        let rows = table.lines().filter(|row| row.starts_with(quantity));
        rows.map(|row| row.split(',').nth(2).expect("a count"))
            .map(|count| count.parse::<u64>().expect("a number"))
            .sum()
    };
    assert_eq!(count("tick time,"), 300, "{table}");
    assert_eq!(count("lateness,"), 300);
    assert!(count("model age of sheet,") > 200);
    let picture = std::fs::read_to_string(folder.path().join("ticks.svg")).expect("written");
    assert!(picture.starts_with("<svg") && picture.contains("tick time, 300 ticks"));
}

#[test]
fn virtual_time_has_no_lateness_to_write() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = palpate(folder.path(), "run --histogram ticks.csv");
    assert_eq!(output.status.code(), Some(2));
    let said = text(&output.stderr);
    assert!(
        said.contains("--histogram") && said.contains("--clock real"),
        "{said}"
    );
    let output = palpate(folder.path(), "run --clock real --histogram ticks.json");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains(".csv or .svg"));
}

#[test]
fn a_plan_tells_the_time_of_a_step() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = palpate(folder.path(), "plan --json plan.json");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(
        printed.contains("  time       on this machine, by processor time, a step takes about ")
            && printed.contains("the scene needs a step every 4.0 ms"),
        "{printed}"
    );
    let time = json(&folder.path().join("plan.json"))["step_time"].as_f64();
    assert!(time.is_some_and(|time| time > 0.0));
}

#[test]
fn a_plan_names_what_the_devices_cannot_render() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/banknote_shear.toml");
    let output = palpate(
        folder.path(),
        &format!("plan {scene} --no-timing --json plan.json"),
    );
    let printed = text(&output.stdout);
    let stiff = printed.matches("  stiff      note: handle ").count();
    let plan = json(&folder.path().join("plan.json"));
    assert_eq!(plan["stiff"].as_array().map(Vec::len), Some(stiff));
    assert!(stiff > 0 && plan["stiff"][0]["turns"] == false, "{printed}");
    assert!(!text(&palpate(folder.path(), "plan --no-timing").stdout).contains("  stiff "));
}
