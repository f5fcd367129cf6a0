//! `palpate stress wall` from outside: shards, a file from which it resumes, the plot.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// Cells 0, 40, 80 and 120 of the quick study's 146: one of the boundary, two of the map and one of a scheme.
const CELLS: &str = "1/40";
/// The same cells in two shards: cells 0 and 80, and cells 40 and 120.
const SHARDS: [&str; 2] = ["1/80", "41/80"];

/// The output of the program.
fn stress_wall(shard: &str, json: &Path, more: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["stress", "wall", "--quick", "--shard", shard, "--json"])
        .arg(json)
        .args(more)
        .output()
        .expect("the program starts");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{error}");
    String::from_utf8(output.stdout).expect("it prints UTF-8")
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).expect("it was written")
}

/// Lines in any order: threads append a cell as soon as it is done, and each shard begins with the header.
fn lines(path: &Path) -> BTreeSet<String> {
    text(path).lines().map(str::to_owned).collect()
}

#[test]
fn cells_and_picture_are_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let [json, plot] = ["cells.jsonl", "map.svg"].map(|name| folder.path().join(name));
    let printed = stress_wall(CELLS, &json, &["--plot", &plot.display().to_string()]);
    assert!(printed.contains("4 of 146 cells"), "{printed}");
    // Without friction, counts and delay, the exact condition is Colgate's: K = 2 b / T = 2 x 0.5 N s/m x 1 kHz.
    assert!(
        printed.contains("| falcon | 1000 | 0 | 1000.00 | 1000.00 | +0.0 |"),
        "{printed}"
    );
    let lines: Vec<serde_json::Value> = text(&json)
        .lines()
        .map(|line| serde_json::from_str(line).expect("each line is JSON"))
        .collect();
    assert_eq!(lines[0]["study"], "wall");
    let kinds: BTreeSet<_> = lines[1..]
        .iter()
        .map(|cell| (cell["cell"].as_u64(), cell["what"].as_str()))
        .collect();
    let expected = [
        (0, "passive"),
        (40, "energy"),
        (80, "scheme"),
        (120, "energy"),
    ];
    assert_eq!(
        kinds,
        expected.map(|(cell, kind)| (Some(cell), Some(kind))).into()
    );
    let svg = text(&plot);
    assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    for part in ["falcon, 1 kHz", "touch, 1 kHz", "Stiffness K (N/m)"] {
        assert!(svg.contains(part), "{part} is missing from:\n{svg}");
    }
}

#[test]
fn shards_together_are_the_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = folder.path().join("whole.jsonl");
    let printed = stress_wall(CELLS, &whole, &[]);
    let merged = folder.path().join("merged.jsonl");
    let texts = SHARDS.map(|shard| {
        let json = folder
            .path()
            .join(format!("{}.jsonl", shard.replace('/', "-")));
        stress_wall(shard, &json, &[]);
        text(&json)
    });
    std::fs::write(&merged, texts.concat()).expect("they are merged");
    assert_eq!(lines(&merged), lines(&whole));
    // No cell is left to run, and the tables are the same.
    let before = text(&merged);
    assert_eq!(stress_wall(CELLS, &merged, &[]), printed);
    assert_eq!(text(&merged), before);
}

#[test]
fn an_interrupted_run_resumes() {
    let folder = tempfile::tempdir().expect("a folder");
    let json = folder.path().join("cells.jsonl");
    // On one thread, so that cells are appended in order.
    let one = ["--threads", "1"];
    let printed = stress_wall(CELLS, &json, &one);
    let written = text(&json);
    assert_eq!(stress_wall(CELLS, &json, &one), printed);
    assert_eq!(text(&json), written);

    // The run was killed in the middle of the third line. The lines before it are not computed again: their marked
    // count of ticks is kept.
    let start = written.find("{\"cell\":80").expect("the third cell");
    let kept = &written[..start];
    let marked = kept.replace("\"spent\":", "\"spent\":1");
    assert_ne!(marked, kept);
    std::fs::write(&json, format!("{marked}{{\"cell\":80,\"wh")).expect("it is cut off");
    assert_eq!(stress_wall(CELLS, &json, &one), printed);
    assert_eq!(text(&json), format!("{marked}{}", &written[start..]));
}
