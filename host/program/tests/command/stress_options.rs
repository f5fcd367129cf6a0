//! The options that the stress studies share: own devices, rates and troubles, files that grow, files that cannot be
//! written, and results of several seeds.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const PALPATE: &str = env!("CARGO_BIN_EXE_palpate");

/// A device file.
fn device(name: &str, damping: &str) -> String {
    format!(
        "name = '{name}'\nrate = 2000\nmass = 0.2\ndamping = {damping}\nfriction = 0.1\nposition_step = 2e-5\n\
         max_force = 5.0\nworkspace_radius = 0.1\ndriver_stiffness = 2000\ndriver_damping = 10\n"
    )
}

/// A strip in a hand. Its device stands far from its handle, which gives a warning.
const SCENE: &str = "name = 'strip'\nduration = 0.6\ngravity = [0, 0, 0]\n\
    [[body]]\nname = 'strip'\nmesh.sheet = { length = 0.1, width = 0.05, cells = [4, 2] }\n\
    material = { young = 1e5, poisson = 0.3, thickness = 0.002, density = 1000 }\n\
    damping = { mass = 0.5, stiffness = 0.01 }\n\
    [[body.support]]\nname = 'left'\ngroup = 'left'\n\
    [[body.handle]]\nname = 'edge'\ngroup = 'right'\ndevice = 'touch'\n\
    [[device]]\nname = 'touch'\nmodel = 'touch'\n\
    mounting = { origin = [0.25, 0, 0], rotation = { axis = [0, 0, 1], degrees = 90 } }\n\
    hand = { waypoints = [[0.05, 0, 0, 0], [0.4, 0, -0.01, 0]] }\n";

fn write_files(folder: &Path) {
    for (name, text) in [
        ("scene.toml", SCENE.to_owned()),
        ("mine.toml", device("mine", "1.0")),
        ("again.toml", device("mine", "1.5")),
        ("undamped.toml", device("undamped", "0.0")),
        (
            "bad.toml",
            device("bad", "1.0").replace("mass = 0.2", "mass = -1"),
        ),
    ] {
        fs::write(folder.join(name), text).unwrap();
    }
}

fn palpate(folder: &Path, arguments: &str) -> Output {
    Command::new(PALPATE)
        .args(arguments.split_whitespace())
        .current_dir(folder)
        .output()
        .unwrap()
}

/// What a command that succeeds prints.
fn printed(folder: &Path, arguments: &str) -> String {
    let output = palpate(folder, arguments);
    let said = text(output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments}: {said}");
    text(output.stdout)
}

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).unwrap()
}

/// The lines of a file of results.
fn lines(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().map(|line| serde_json::from_str(line).unwrap());
    lines.collect()
}

#[test]
fn wrong_devices_rates_and_troubles_are_refused_with_what_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    for (arguments, expected) in [
        (
            "wall tuch",
            "found \"tuch\", allowed: a device file (.toml), or a built-in device: falcon, touch,",
        ),
        (
            "faults none.toml",
            "none.toml: cannot read this device file",
        ),
        (
            "wall bad.toml",
            "bad.toml:3: mass: found -1, allowed: a number above 0",
        ),
        ("faults scene.toml", "scene.toml:4: body: unknown field"),
        (
            "wall undamped.toml",
            "undamped.toml:4: damping: found 0, allowed: above 0 for a study of walls",
        ),
        (
            "wall mine.toml again.toml",
            "again.toml:1: name: found \"mine\", allowed: a name that mine.toml does not have",
        ),
        (
            "faults falcon falcon",
            "name: found \"falcon\", allowed: a name that falcon does not have",
        ),
        ("scene scene.toml --rate 5000", "allowed: 1 to 1000 (Hz)"),
        ("scene scene.toml --rate fast", "allowed: 1 to 1000 (Hz)"),
        (
            "scene scene.toml --trouble stall",
            "allowed: nothing, stalls, losses, softening, vanishing, all",
        ),
    ] {
        let output = palpate(folder.path(), &format!("stress {arguments} --quick"));
        let said = text(output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {said}");
        assert!(said.contains(expected), "{arguments}: {said}");
    }
}

#[test]
fn walls_and_faults_are_studied_on_a_device_of_the_users_own() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    // The first cell is the plain boundary, at the rate of the device: K = 2 b / T.
    let walls = printed(folder.path(), "stress wall mine.toml --quick --shard 1/200");
    assert!(walls.contains("| mine | 2000 | 0 | 4000.00 | "), "{walls}");
    let faults = printed(
        folder.path(),
        "stress faults mine.toml falcon --runs 2 --json f.jsonl",
    );
    assert!(faults.contains("Events that occurred"), "{faults}");
    let found = lines(&folder.path().join("f.jsonl"));
    assert_eq!(found[0]["settings"]["devices"]["mine"][0], 2000.0);
    let mut names: Vec<_> = found[1..]
        .iter()
        .map(|cell| cell["device"].as_str().unwrap())
        .collect();
    names.sort_unstable();
    assert_eq!(names, ["falcon", "mine"]);
    // The results of other devices do not mix with these.
    let refused = palpate(folder.path(), "stress faults --runs 2 --json f.jsonl");
    assert_eq!(refused.status.code(), Some(1));
}

#[test]
fn trials_of_one_rate_and_trouble_print_warnings_of_their_scene() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    let trials = "--schemes linear --rate 90 --trouble stalls,losses --runs 2 --json s.jsonl";
    let output = palpate(folder.path(), &format!("stress scene scene.toml {trials}"));
    let (shown, said) = (text(output.stdout), text(output.stderr));
    assert_eq!(output.status.code(), Some(0), "{said}");
    // The strip is mounted: the study turns its forces into the axes of the device.
    assert!(said.starts_with("palpate: warning: scene.toml:"), "{said}");
    assert!(said.contains("device[0].mounting.origin"), "{said}");
    for row in [
        "| 90 | linear | 2 |",
        "| stalls | linear | 1 |",
        "| losses | linear | 1 |",
    ] {
        assert!(shown.contains(row), "{row} in {shown}");
    }
    let cells = &lines(&folder.path().join("s.jsonl"))[1..];
    assert!(cells.iter().all(|cell| cell["draw"]["rate"] == 90.0));
    let warned = palpate(folder.path(), "stress hold scene.toml");
    let said = text(warned.stderr);
    assert!(said.starts_with("palpate: warning: scene.toml:"), "{said}");
}

#[test]
fn a_study_that_grows_has_the_cells_of_a_study_that_was_large_from_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let fresh = printed(
        folder.path(),
        "stress faults --runs 4 --threads 1 --json fresh.jsonl",
    );
    printed(
        folder.path(),
        "stress faults --runs 2 --threads 1 --json grown.jsonl",
    );
    let grown = printed(
        folder.path(),
        "stress faults --runs 4 --threads 1 --json grown.jsonl",
    );
    assert_eq!(grown, fresh);
    let cells = |name: &str| {
        let lines = lines(&folder.path().join(name));
        let cells = lines.into_iter().filter(|line| line.get("cell").is_some());
        cells.collect::<Vec<_>>()
    };
    assert_eq!(cells("grown.jsonl"), cells("fresh.jsonl"));
}

#[test]
fn a_disk_that_is_full_costs_no_table_and_the_cells_are_written_by_the_next_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cells.jsonl");
    let expected = printed(folder.path(), "stress faults --runs 3");
    let output = Command::new("sh")
        // One block of 512 or 1024 bytes has room for the header, but not for two cells. Without the trap the signal
        // would end the process.
        .args([
            "-c",
            "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"",
            PALPATE,
        ])
        .args([
            "stress",
            "faults",
            "--runs",
            "3",
            "--threads",
            "1",
            "--json",
        ])
        .arg(&path)
        .output()
        .unwrap();
    let said = text(output.stderr);
    assert_eq!(text(output.stdout), expected, "{said}");
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("the study continues, and tries again after each cell"),
        "{said}"
    );
    assert!(
        said.trim_end()
            .lines()
            .last()
            .unwrap()
            .contains("cells.jsonl"),
        "{said}"
    );
    // Whole lines only.
    let left = fs::read_to_string(&path).unwrap();
    assert!(left.ends_with('\n') && lines(&path).len() < 3, "{left}");
    let again = printed(folder.path(), "stress faults --runs 3 --json cells.jsonl");
    assert_eq!(again, expected);
    assert_eq!(lines(&path).len(), 4);
}

#[test]
fn seeds_are_printed_side_by_side_with_their_spread() {
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    let world = "stress scene scene.toml --schemes linear --rate 125 --trouble nothing --runs 1";
    for seed in [4, 9] {
        printed(
            folder.path(),
            &format!("{world} --seed {seed} --json {seed}.jsonl"),
        );
    }
    let shown = printed(
        folder.path(),
        "stress seeds 4.jsonl 9.jsonl --json spread.json",
    );
    assert!(
        shown.starts_with("scene: 2 seeds; cells of each: 1, 1\n"),
        "{shown}"
    );
    assert!(
        shown.contains("| of | quantity | seed 4 | seed 9 | mean | standard deviation |"),
        "{shown}"
    );
    assert!(
        shown.contains("| linear | bounded (%) | 100.0 | 100.0 | 100.0 | 0 |"),
        "{shown}"
    );
    let json: Value =
        serde_json::from_str(&fs::read_to_string(folder.path().join("spread.json")).unwrap())
            .unwrap();
    assert_eq!(json["schema"], "palpate.seeds/1");
    for quantity in json["quantities"].as_array().unwrap() {
        let values: Vec<f64> = quantity["values"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(Value::as_f64)
            .collect();
        assert_eq!(values.len(), 2, "{quantity}");
        let mean = quantity["mean"].as_f64().unwrap();
        assert!(
            (mean - 0.5 * (values[0] + values[1])).abs() <= 1e-12 * mean.abs(),
            "{quantity}"
        );
    }
    // Another rate is another study.
    printed(
        folder.path(),
        &format!("{} --seed 5 --json 5.jsonl", world.replace("125", "250")),
    );
    let refused = palpate(folder.path(), "stress seeds 4.jsonl 5.jsonl");
    let said = text(refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("5.jsonl: settings.rates differs from that of 4.jsonl"),
        "{said}"
    );
}
