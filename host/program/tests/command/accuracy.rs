//! `palpate bench accuracy` prints, writes and draws the results of the study.

use std::process::Command;
use study::Level;
use study::accuracy;

#[test]
fn the_command_prints_writes_and_draws() {
    let folder = tempfile::tempdir().expect("a folder");
    let [json, plot] = ["a.json", "a.svg"].map(|name| folder.path().join(name));
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["bench", "accuracy", "--quick", "--json"])
        .arg(&json)
        .arg("--plot")
        .arg(&plot)
        .output()
        .expect("the program starts");
    assert!(output.status.success());
    let printed = String::from_utf8(output.stdout).expect("it prints UTF-8");
    let read: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&json).expect("JSON was written"))
            .expect("it is JSON");
    assert_eq!(read["schema"], "palpate.accuracy/2");
    assert_eq!(read["level"], "quick");
    let all = read["series"].as_array().expect("series");
    let found = accuracy::run(Level::Quick, &mut |_| ()).expect("all benchmarks can be computed");
    assert_eq!(all.len(), found.series.len());
    for series in all {
        let title = series["title"].as_str().expect("a title");
        let points = series["points"].as_array().expect("points").len();
        // One row for each point, and one line that names the source.
        assert_eq!(
            printed.matches(&format!("| {title} |")).count(),
            points,
            "{title}"
        );
        assert_eq!(
            printed.matches(&format!("- {title}: ")).count(),
            1,
            "{title}"
        );
    }
    let svg = std::fs::read_to_string(&plot).expect("the plot was written");
    assert!(svg.starts_with("<svg") && svg.contains("manufactured, quadratic: order 3.0"));
}
