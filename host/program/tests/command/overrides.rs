//! `palpate run --scheme, --rate, --step-rate, --publish-rate, --latency`, `--set` of every command and `palpate sweep`:
//! values in place of those of the scene.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

type Outcome = Result<(), Box<dyn Error>>;

fn palpate(folder: &Path, line: &str) -> std::io::Result<Output> {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .output()
}

fn said(output: &Output) -> (Option<i32>, String) {
    let said = String::from_utf8_lossy(&output.stderr);
    let said = said.trim_end();
    let said = said.strip_prefix("palpate: ").unwrap_or(said);
    (output.status.code(), said.to_owned())
}

/// A scene with a sheet between two hands.
const SCENE: &str = r#"name = "pull"
[host]
latency = 0.01
[[body]]
name = "sheet"
mesh.sheet = { length = 0.2, width = 0.12, cells = [4, 3] }
material = { young = 0.3e6, poisson = 0.45, thickness = 0.001, density = 1000 }
handle = [
  { name = "left edge", group = "left", device = "left" },
  { name = "right edge", group = "right", device = "right" },
]
[[device]]
name = "left"
model = "falcon"
hand.waypoints = [[0.0, 0.0, 0.0, 0.0], [0.3, -0.01, 0.0, 0.0]]
[[device]]
name = "right"
model = "falcon"
hand.waypoints = [[0.0, 0.0, 0.0, 0.0], [0.3, 0.01, 0.0, 0.0]]
"#;

/// A run with overrides is the run of the scene that says so itself, and its log replays without the overrides.
#[test]
fn an_override_is_as_good_as_an_edited_scene() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    fs::write(at("plain.toml"), SCENE)?;
    let edited = SCENE.replace(
        "[host]\nlatency = 0.01",
        "[loop]\nscheme = \"linear\"\nrate = 500\n[host]\nlatency = 0.02\nstep_rate = 100\npublish_rate = 50",
    );
    fs::write(at("edited.toml"), edited)?;
    let flags = "--scheme linear --rate 500 --step-rate 100 --publish-rate 50 --latency 0.02";
    let fast = "--duration 0.4 --instructions portable";
    for line in [
        format!("run plain.toml {fast} --json plain.json"),
        format!("run plain.toml {fast} {flags} --log overridden.mcap --json overridden.json"),
        format!("run edited.toml {fast} --json edited.json"),
    ] {
        let run = palpate(folder.path(), &line)?;
        assert_eq!(said(&run), (Some(0), String::new()), "{line}");
    }
    let facts = |name: &str| -> Result<_, Box<dyn Error>> {
        let json: serde_json::Value = serde_json::from_slice(&fs::read(at(name))?)?;
        let fields = ["scheme", "tick", "devices", "energy", "dropped"];
        let facts = fields.map(|field| json[field].to_string());
        Ok((facts, json["host"]["steps"].as_u64()))
    };
    let overridden = facts("overridden.json")?;
    assert_eq!(overridden, facts("edited.json")?);
    assert_ne!(overridden, facts("plain.json")?);
    let replay = palpate(folder.path(), "run --replay overridden.mcap")?;
    let text = String::from_utf8_lossy(&replay.stdout);
    assert!(text.contains("200 ticks reproduced exactly"), "{text}");
    assert_eq!(replay.status.code(), Some(0));
    Ok(())
}

/// The checks are those of the scene, and the message names the argument and the field.
#[test]
fn a_value_that_the_scene_may_not_have_is_refused() -> Outcome {
    let folder = tempfile::tempdir()?;
    fs::write(folder.path().join("a.toml"), SCENE)?;
    for (flags, expected) in [
        (
            "--rate 20",
            "with --rate 20: a.toml:1: loop.rate: found 20, allowed: a number from 100 to 10000 (Hz)",
        ),
        (
            "--latency -1",
            "with --latency -1: a.toml:3: host.latency: found -1, allowed: a number from 0 to 1 (s)",
        ),
        (
            "--clock real --latency 0.1",
            "--latency applies to virtual time only: found --clock real, under which the machine decides the latency",
        ),
    ] {
        let run = palpate(folder.path(), &format!("run a.toml {flags}"))?;
        assert_eq!(said(&run), (Some(2), expected.to_owned()), "{flags}");
    }
    for (flags, parts) in [
        (
            "--scheme strong",
            ["a.toml:1: loop.scheme: found \"strong\"", "`capped`"],
        ),
        (
            "--step-rate 90 --publish-rate 60",
            ["with --step-rate 90 --publish-rate 60: ", "whole number"],
        ),
    ] {
        let (code, text) = said(&palpate(folder.path(), &format!("run a.toml {flags}"))?);
        assert_eq!(code, Some(2), "{text}");
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
    }
    let (code, text) = said(&palpate(folder.path(), "run --replay x.mcap --rate 500")?);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("cannot be used with"), "{text}");
    Ok(())
}

/// Every command that reads a scene sets fields, and names what it cannot set.
#[test]
fn each_command_sets_any_field_of_the_scene() -> Outcome {
    let folder = tempfile::tempdir()?;
    fs::write(folder.path().join("s.toml"), SCENE)?;
    for command in [
        "run s.toml --duration 0.05",
        "plan s.toml --no-timing",
        "compare s.toml --duration 0.05",
        "solve s.toml",
        "mesh s.toml out.vtu",
        "stress hold s.toml",
        "stress scene s.toml --cell 0",
        "sweep s.toml",
    ] {
        for (set, expected) in [
            (
                "body[sheet].material.young=-1",
                "with --set body[sheet].material.young=-1: s.toml:7: body[0].material.young: found -1, allowed: ",
            ),
            (
                "device[middle].model=falcon",
                "with --set device[middle].model=falcon: s.toml:12: device[middle].model: found device[middle], \
                 allowed: 0, 1, left, right",
            ),
        ] {
            let found = palpate(folder.path(), &format!("{command} --set {set}"))?;
            let (code, text) = said(&found);
            assert_eq!(code, Some(2), "{command}: {text}");
            assert!(text.starts_with(expected), "{command}: {text}");
        }
    }
    let described = |set: &str| -> Result<String, Box<dyn Error>> {
        let found = palpate(folder.path(), &format!("mesh s.toml out.vtu{set}"))?;
        assert_eq!(found.status.code(), Some(0), "{}", said(&found).1);
        Ok(String::from_utf8_lossy(&found.stdout).into_owned())
    };
    let (before, after) = (
        described("")?,
        described(" --set body[0].material.young=4e5")?,
    );
    assert_ne!(before, after);
    let many = palpate(folder.path(), "run s.toml --set loop.rate=500,1000")?;
    let (code, text) = said(&many);
    assert_eq!(code, Some(2));
    assert!(
        text.contains("found 2 values, allowed: one; `palpate sweep`"),
        "{text}"
    );
    Ok(())
}

/// A run of a sweep is the run of the scene with its values, and a sweep that is begun again does not repeat it.
#[test]
fn a_sweep_is_one_run_for_each_value_and_goes_on_where_it_stopped() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    fs::write(at("s.toml"), SCENE)?;
    let line = "sweep s.toml --duration 0.3 --set body[0].material.young=2e5,4e5 --set loop.scheme=hold,capped \
                --json s.jsonl --plot s.svg --threads 2";
    let whole = palpate(folder.path(), line)?;
    assert_eq!(whole.status.code(), Some(0), "{}", said(&whole).1);
    let table = String::from_utf8_lossy(&whole.stdout).into_owned();
    let lines = fs::read_to_string(at("s.jsonl"))?;
    assert_eq!(lines.lines().count(), 5, "{lines}");
    let picture = fs::read_to_string(at("s.svg"))?;
    assert!(picture.contains("young 4e5, scheme hold"), "{table}");

    // The peak of the third run is that of the scene with these values.
    let peak =
        "run s.toml --duration 0.3 --set body[0].material.young=4e5 --scheme hold --json one.json";
    assert_eq!(palpate(folder.path(), peak)?.status.code(), Some(0));
    let one: serde_json::Value = serde_json::from_slice(&fs::read(at("one.json"))?)?;
    let force = one["devices"][0]["peak_force"].as_f64().ok_or("no peak")?;
    let row = table
        .lines()
        .find(|row| row.starts_with("| 4e5 | hold |"))
        .ok_or("no row")?;
    assert!(
        row.starts_with(&format!("| 4e5 | hold | {force:.3} (")),
        "{row}"
    );

    // The run was killed after its second run: the line of the third is cut.
    let kept: Vec<&str> = lines.lines().take(3).collect();
    fs::write(
        at("s.jsonl"),
        format!("{}\n{{\"cell\": 2, \"val", kept.join("\n")),
    )?;
    let again = palpate(folder.path(), line)?;
    assert_eq!(again.status.code(), Some(0), "{}", said(&again).1);
    assert_eq!(String::from_utf8_lossy(&again.stdout), table);
    let after = fs::read_to_string(at("s.jsonl"))?;
    assert!(after.starts_with(&kept.join("\n")), "{after}");
    Ok(())
}

/// If the limit of a device cuts the peak, a sweep tells for how long and by how much, as the run does.
#[test]
fn a_sweep_tells_what_the_limit_of_a_device_held_back() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    fs::write(at("s.toml"), SCENE)?;
    let lines = [
        "run s.toml --duration 0.3 --set device[left].max_force=1 --json one.json",
        "sweep s.toml --duration 0.3 --set device[left].max_force=8,1",
    ];
    let [_, swept] = lines.map(|line| palpate(folder.path(), line));
    let table = String::from_utf8_lossy(&swept?.stdout).into_owned();
    let one: serde_json::Value = serde_json::from_slice(&fs::read(at("one.json"))?)?;
    let held = one["held_back"].as_array().ok_or("a list")?;
    let held = held.iter().find(|held| held["cause"] == "force limit");
    let number = |name: &str| held.and_then(|held| held[name].as_f64());
    let time = number("duration").ok_or("no time")?;
    let most = number("most").ok_or("no force")?;
    let row = |start: &str| table.lines().find(|row| row.starts_with(start));
    let limited = row("| 1 | 1.000 (").ok_or("no row")?;
    let end = format!("| left {time:.3}, {most:.2} |");
    assert!(limited.ends_with(&end), "{limited} {end}");
    assert!(
        row("| 8 |").is_some_and(|row| row.ends_with("|  |")),
        "{table}"
    );
    Ok(())
}

/// The tear of a run has the same start, peak and plateau in its summary and in a sweep, and each is that of the table of the
/// run.
#[test]
fn a_tear_has_one_start_one_peak_and_one_plateau() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let torn = SCENE
        .replace("cells = [4, 3]", "cells = [10, 6]")
        .replace(
            "handle = [",
            "tear = { strength = 1e4, toughness = 20 }\nhandle = [",
        )
        .replace("[0.3, ", "[1.0, ")
        .replace("0.01, 0.0", "0.04, 0.0");
    fs::write(at("s.toml"), torn)?;
    for line in [
        "run s.toml --duration 1.2 --json run.json --csv run.csv",
        "sweep s.toml --duration 1.2 --set body[0].tear.toughness=20,30 --json s.jsonl",
    ] {
        let ran = palpate(folder.path(), line)?;
        assert_eq!(ran.status.code(), Some(0), "{}", said(&ran).1);
        let printed = String::from_utf8_lossy(&ran.stdout).into_owned();
        assert!(!printed.contains("limited by the device"), "{printed}");
    }
    let summary: serde_json::Value = serde_json::from_slice(&fs::read(at("run.json"))?)?;
    let force = &summary["tears"][0]["force"];
    let lines = fs::read_to_string(at("s.jsonl"))?;
    let cells = lines.lines().map(serde_json::from_str);
    let cells: Vec<serde_json::Value> = cells.collect::<Result<_, _>>()?;
    let first = cells
        .iter()
        .find(|cell| cell["cell"] == 0)
        .ok_or("no run")?;
    assert_eq!(&first["tears"][0]["force"], force);
    // From the table: the norms of the forces of each device from the first edge to the last.
    let number = |name: &str| force[name].as_f64().ok_or("no number");
    let (from, to) = (number("from")?, number("to")?);
    let device = force["device"].as_str().ok_or("no device")?;
    let table = fs::read_to_string(at("run.csv"))?;
    let mut rows = table
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>());
    let head = rows.next().ok_or("no head")?;
    let column = |name: &str| {
        head.iter()
            .position(|found| *found == name)
            .ok_or("no column")
    };
    let [x, y, z] = ["x", "y", "z"].map(|axis| column(&format!("{device}_force_{axis}_N")));
    let (time, axes) = (column("time_s")?, [x?, y?, z?]);
    let mut norms = Vec::new();
    for row in rows {
        let now: f64 = row[time].parse()?;
        // Half a tick.
        if (from - 5e-4..to + 5e-4).contains(&now) {
            let parts = axes.map(|axis| row[axis].parse::<f64>());
            let [x, y, z] = parts;
            norms.push(x?.hypot(y?).hypot(z?));
        }
    }
    // Rounding of a square root.
    let close = |found: f64, expected: f64| (found - expected).abs() < 1e-9;
    assert!(close(number("start")?, norms[0]), "{force} {}", norms[0]);
    norms.sort_by(f64::total_cmp);
    let (low, high) = (norms[(norms.len() - 1) / 2], norms[norms.len() / 2]);
    assert!(close(number("plateau")?, 0.5 * (low + high)), "{force}");
    assert!(close(number("peak")?, norms[norms.len() - 1]), "{force}");
    assert!(number("start")? > 0.1, "{force}");
    Ok(())
}
