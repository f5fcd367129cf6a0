//! `palpate run --csv, --force-displacement, --vtu` and `palpate solve --csv, --force-displacement`: files, messages and
//! exit codes.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::Duration;
use support::solve::{body, cube, force};

type Outcome = Result<(), Box<dyn Error>>;

fn palpate(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.args(line.split_whitespace()).current_dir(folder);
    command
}

/// The exit code and what the program said on the standard error.
fn end(output: &Output) -> (Option<i32>, String) {
    let said = String::from_utf8_lossy(&output.stderr);
    (output.status.code(), said.trim_end().to_owned())
}

#[test]
fn a_run_and_a_replay_write_the_same_files() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let run = "run --duration 0.2 --log run.mcap --csv run.csv --force-displacement run.svg --vtu out --frames 10";
    let output = palpate(folder.path(), run).output()?;
    assert_eq!(end(&output), (Some(0), String::new()));
    let printed = String::from_utf8(output.stdout)?;
    for line in [
        "csv        run.csv",
        "curve      run.svg",
        "vtu        out/frames.pvd",
    ] {
        assert!(printed.contains(line), "{printed}");
    }
    assert!(at("out/sheet_0001.vtu").exists());
    assert!(!at("out/sheet_0002.vtu").exists());
    let replay = "run --replay run.mcap --csv replay.csv --force-displacement replay.svg";
    let output = palpate(folder.path(), replay).output()?;
    assert_eq!(end(&output), (Some(0), String::new()));
    for ending in ["csv", "svg"] {
        let [run, replay] = ["run", "replay"].map(|name| fs::read(at(&format!("{name}.{ending}"))));
        assert!(run? == replay?, "{ending}");
    }
    // To a program, and to a reader that has read enough.
    let piped = palpate(folder.path(), "run --duration 0.2 --csv /dev/stdout").output()?;
    assert_eq!(end(&piped), (Some(0), String::new()));
    let table = fs::read_to_string(at("run.csv"))?;
    assert!(String::from_utf8(piped.stdout)?.starts_with(&table));
    let mut cut = palpate(folder.path(), "run --duration 0.2 --csv /dev/stdout");
    let mut cut = cut.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
    drop(cut.stdout.take());
    assert_eq!(end(&cut.wait_with_output()?), (Some(0), String::new()));
    Ok(())
}

/// The rows that a killed run has written are whole.
#[test]
fn a_table_survives_a_kill() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.csv");
    let mut run = palpate(
        folder.path(),
        "run --clock real --duration 60 --csv run.csv",
    );
    let mut run = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    for _ in 0..2000 {
        if fs::read_to_string(&path).is_ok_and(|text| text.lines().count() > 600) {
            break;
        }
        sleep(Duration::from_millis(20));
    }
    run.kill()?;
    run.wait()?;
    let text = fs::read_to_string(&path)?;
    let columns = text.lines().next().unwrap_or_default().split(',').count();
    assert!(text.lines().count() > 600, "{}", text.lines().count());
    assert!(text.ends_with('\n'));
    assert!(text.lines().all(|line| line.split(',').count() == columns));
    Ok(())
}

#[test]
fn a_solve_writes_its_table_and_its_curve() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let scene = cube("linear", r#"["z"]"#);
    fs::write(at("cube.toml"), &scene)?;
    let solve = "solve cube.toml --csv cube.csv --force-displacement cube.svg";
    let output = palpate(folder.path(), solve).output()?;
    assert_eq!(end(&output), (Some(0), String::new()));
    let table = fs::read_to_string(at("cube.csv"))?;
    let lines: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    let column = lines[0]
        .iter()
        .position(|name| *name == "cube_top_force_z_N");
    let column = column.ok_or("no force of the top")?;
    let expected = force(&body(&scene), "top")[2];
    assert_eq!(lines.len(), 3);
    assert_eq!(lines[2][column].parse::<f64>()?, expected);
    let curve = fs::read_to_string(at("cube.svg"))?;
    assert!(curve.contains("Displacement along −z (mm)"));

    // If nothing is displaced, there is nothing to draw.
    fs::write(
        at("still.toml"),
        scene.replace("displacement = [0, 0, -0.01]", ""),
    )?;
    let output = palpate(
        folder.path(),
        "solve still.toml --force-displacement still.svg",
    )
    .output()?;
    let expected = "palpate: --force-displacement: no support of the scene is displaced; give a [[body.support]] a \
                    `displacement`";
    assert_eq!(end(&output), (Some(2), expected.to_owned()));
    Ok(())
}

#[test]
fn what_cannot_be_is_refused_before_the_work() -> Outcome {
    let folder = tempfile::tempdir()?;
    let mut wrong = Vec::new();
    for (line, code, message) in [
        (
            "run --vtu out --frames 1000",
            2,
            "--frames: found 1000, allowed: a number above 0 and up to host.step_rate, which is 250 (Hz)",
        ),
        (
            "run --log x --csv ./x",
            2,
            "--log x: --csv writes to the same file as ./x; give each output a file of its own",
        ),
        (
            "run --csv x.mcap",
            2,
            "--csv x.mcap: found the ending of another format, allowed: .csv",
        ),
        (
            "run --vtu out --csv out/frames.pvd",
            2,
            "--vtu out: --csv writes to the same file as out/frames.pvd; give each output a file of its own",
        ),
        (
            "solve missing.toml --csv a/b.csv",
            2,
            "missing.toml: cannot read this scene: No such file or directory (os error 2)",
        ),
    ] {
        let found = end(&palpate(folder.path(), line).output()?);
        if found != (Some(code), format!("palpate: {message}")) {
            wrong.push(format!("{line}: {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for line in ["run --frames 10", "run --replay x.mcap --vtu out"] {
        let output = palpate(folder.path(), line).output()?;
        assert_eq!(output.status.code(), Some(2), "{line}");
    }
    assert_eq!(fs::read_dir(folder.path())?.count(), 0, "no file was made");
    Ok(())
}
