//! `palpate compare` from outside: its table, its files, and what it refuses.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// A strip that a hand pulls.
const SCENE: &str = "name = 'strip'\nduration = 0.6\n\
    host = { step_rate = 500, publish_rate = 50, latency = 0.002 }\n\
    [[body]]\nname = 'strip'\nmesh.sheet = { length = 0.1, width = 0.05, cells = [4, 2] }\n\
    material = { young = 1e5, poisson = 0.3, thickness = 0.002, density = 1000 }\n\
    damping = { mass = 0.5, stiffness = 0.01 }\n\
    [[body.support]]\nname = 'left'\ngroup = 'left'\n\
    [[body.handle]]\nname = 'edge'\ngroup = 'right'\ndevice = 'touch'\n\
    [[device]]\nname = 'touch'\nmodel = 'touch'\n\
    hand = { waypoints = [[0.05, 0, 0, 0], [0.4, 0.01, 0, 0]] }\n";

fn palpate(folder: &Path, arguments: &str) -> Output {
    fs::write(folder.join("scene.toml"), SCENE).unwrap();
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments.split_whitespace())
        .current_dir(folder)
        .output()
        .unwrap()
}

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap()
}

#[test]
fn schemes_are_compared_with_the_reference_and_the_files_are_the_same_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let command = "compare scene.toml --schemes capped,hold --publish-rates 50,250 --json c.json --plot c.svg --csv c.csv";
    let files =
        || ["c.json", "c.svg", "c.csv"].map(|name| fs::read(folder.path().join(name)).unwrap());
    let output = palpate(folder.path(), command);
    let printed = text(output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(output.stderr));
    let first = files();
    let again = palpate(folder.path(), &format!("{command} --threads 1"));
    assert_eq!(text(again.stdout), printed);
    assert!(files() == first, "a run in one thread wrote other files");

    // The columns of the table have names that every program takes, and each line has a number in each.
    let table = String::from_utf8_lossy(&first[2]);
    let columns = table.lines().next().map_or("", |line| line).split(',');
    let names: Vec<_> = columns.collect();
    assert_eq!(names[0], "time_s");
    assert!(names.contains(&"reference_touch_force_x_N"), "{names:?}");
    assert!(
        names.contains(&"capped_250_Hz_touch_position_z_m"),
        "{names:?}"
    );
    for line in table.lines().skip(1) {
        let values = line.split(',').map(str::parse::<f64>);
        assert_eq!(values.flatten().count(), names.len(), "{line}");
    }

    // Rates in the given order, and schemes in that of the tables.
    let rows: Vec<_> = printed
        .lines()
        .filter(|line| line.starts_with("| "))
        .collect();
    let starts = [
        "| scheme |",
        "| hold | 50 |",
        "| capped | 50 |",
        "| hold | 250 |",
        "| capped | 250 |",
        "| reference |",
    ];
    assert_eq!(rows.len(), starts.len(), "{printed}");
    for (row, start) in rows.iter().zip(starts) {
        assert!(row.starts_with(start), "{row}");
        assert_eq!(row.matches('|').count(), 15, "{row}");
    }
    let json: Value = serde_json::from_slice(&first[0]).unwrap();
    assert_eq!(json["schema"], "palpate.compare/1");
    let error = |run: usize| {
        json["runs"][run]["devices"][0]["error"]["rms"]
            .as_f64()
            .unwrap()
    };
    // A held force errs more than an extrapolated one, and a slow host more than a fast one.
    assert!(error(0) > error(2) && error(0) > 2.0 * error(1), "{json}");
    let plot = text(first[1].clone());
    for label in ["touch, 50 Hz", "Force error (N)", "capped", "reference"] {
        assert!(plot.contains(label), "{label}");
    }
    // One line for each tick, and the head.
    assert_eq!(text(first[2].clone()).lines().count(), 601);
}

#[test]
fn all_schemes_are_the_default_and_the_reference_can_be_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let output = palpate(
        folder.path(),
        "compare scene.toml --duration 0.1 --no-reference",
    );
    let printed = text(output.stdout);
    assert_eq!(output.status.code(), Some(0));
    for scheme in ["hold", "thesis", "linear", "classic", "proxy", "capped"] {
        assert!(
            printed.contains(&format!("\n| {scheme} | 50 |")),
            "{printed}"
        );
    }
    assert!(!printed.contains("reference |"), "{printed}");
}

#[test]
fn a_host_that_panics_fails_the_command_after_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let output = palpate(
        folder.path(),
        "compare scene.toml --duration 0.3 --schemes linear --fault panic@0.1 --no-reference",
    );
    let printed = text(output.stdout);
    assert_eq!(output.status.code(), Some(1));
    assert!(printed.contains("| linear | 50 |"), "{printed}");
    assert!(
        printed.contains("FAILED linear at 50 Hz: the host panicked"),
        "{printed}"
    );
}

#[test]
fn what_cannot_be_compared_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, expected) in [
        (
            "compare scene.toml --schemes lineer",
            "allowed: hold, thesis, linear, classic, proxy, capped",
        ),
        (
            "compare scene.toml --publish-rates 0",
            "allowed: numbers above 0 (Hz)",
        ),
        (
            "compare scene.toml --publish-rates 50,60",
            "--publish-rates: found 60.0, allowed: host.step_rate of the scene, 500.0, divided by a whole number",
        ),
        (
            "compare scene.toml --publish-rates 1000",
            "--publish-rates: found 1000.0",
        ),
        (
            "compare scene.toml --from 0.6",
            "--from: found 0.6, allowed: a number below the duration of the runs, which is 0.6 (s)",
        ),
        (
            "compare scene.toml --csv scene.toml",
            "--csv scene.toml: would overwrite the scene",
        ),
        ("compare none.toml", "none.toml: cannot read this scene"),
    ] {
        let output = palpate(folder.path(), arguments);
        let said = text(output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        assert!(said.contains(expected), "{arguments}: {said}");
        assert!(output.stdout.is_empty(), "{arguments}");
    }
}
