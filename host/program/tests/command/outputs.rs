//! No output destroys a file: what the program refuses before its work, and how it ends when it cannot write or print.

use std::error::Error;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

type Outcome = Result<(), Box<dyn Error>>;

const PALPATE: &str = env!("CARGO_BIN_EXE_palpate");

/// A small block between two plates, from a mesh file.
const SCENE: &str = r#"
name = "block"
gravity = [0, 0, 0]

[[body]]
name = "block"
mesh.file = "out/block_0001.vtu"

[body.material]
young = 20e3
poisson = 0.3
density = 1000

[[body.support]]
name = "bottom"
box = [[-1, -1, -1], [1, 1, -0.0499]]

[[body.support]]
name = "top"
box = [[-1, -1, 0.0499], [1, 1, 1]]
displacement = [0, 0, -0.01]
"#;

fn palpate(folder: &Path, line: &str) -> Command {
    let mut command = Command::new(PALPATE);
    command.args(line.split_whitespace()).current_dir(folder);
    command
}

/// The exit code and what the program said on the standard error.
fn end(output: &Output) -> (Option<i32>, String) {
    let said = String::from_utf8_lossy(&output.stderr);
    // On a busy machine any command may take the two seconds after which lines of progress begin.
    let is_progress = |line: &&str| {
        let rest = line.strip_prefix("palpate: ");
        rest.and_then(|rest| rest.split_once(" s: "))
            .is_some_and(|(seconds, _)| seconds.parse::<u32>().is_ok())
    };
    let said: Vec<&str> = said.lines().filter(|line| !is_progress(line)).collect();
    let said = said.join("\n");
    (output.status.code(), said.trim_end().to_owned())
}

/// A folder with a scene, its mesh, links to the scene, a log, and a folder.
fn folder() -> Result<tempfile::TempDir, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let generated = SCENE.replace(
        "mesh.file = \"out/block_0001.vtu\"",
        "mesh.box = { size = [0.1, 0.1, 0.1], cells = [2, 2, 2] }",
    );
    fs::write(at("box.toml"), generated)?;
    fs::create_dir(at("out"))?;
    let made = palpate(folder.path(), "mesh box.toml out/block_0001.vtu").output()?;
    assert_eq!(end(&made), (Some(0), String::new()));
    fs::write(at("scene.toml"), SCENE)?;
    fs::hard_link(at("scene.toml"), at("hard.toml"))?;
    std::os::unix::fs::symlink("scene.toml", at("soft.toml"))?;
    let run = palpate(folder.path(), "run --duration 0.01 --log run.mcap").output()?;
    assert_eq!(end(&run), (Some(0), String::new()));
    std::os::unix::fs::symlink("new.json", at("dangling.json"))?;
    assert!(Command::new("mkfifo").arg(at("pipe")).status()?.success());
    Ok(folder)
}

/// The name and the content of each file of a folder.
type Contents = Vec<(String, Vec<u8>)>;

/// What a folder holds.
fn contents(folder: &Path) -> Result<Contents, Box<dyn Error>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(contents(&path)?);
        } else if path.is_file() {
            found.push((path.display().to_string(), fs::read(&path)?));
        } else {
            found.push((path.display().to_string(), Vec::new()));
        }
    }
    found.sort();
    Ok(found)
}

/// Cases of three lines: the arguments, the exit code, the message.
const REFUSED: &str = r"
run scene.toml --log scene.toml
2
--log scene.toml: would overwrite the scene, which the command reads; give the output another name
plan scene.toml --json ./out/../scene.toml
2
--json ./out/../scene.toml: would overwrite the scene, which the command reads as scene.toml; give the output another name
plan scene.toml --json hard.toml
2
--json hard.toml: would overwrite the scene, which the command reads as scene.toml; give the output another name
plan soft.toml --json scene.toml
2
--json scene.toml: would overwrite the scene, which the command reads as soft.toml; give the output another name
plan scene.toml --json out/block_0001.vtu
2
--json out/block_0001.vtu: would overwrite a file that the scene names, which the command reads; give the output another name
solve scene.toml --vtu out
2
--vtu out: would overwrite a file that the scene names, which the command reads as out/block_0001.vtu; give the output another name
mesh scene.toml out/block_0001.vtu
2
FILE out/block_0001.vtu: would overwrite a file that the scene names, which the command reads; give the output another name
run --replay run.mcap --json run.mcap
2
--json run.mcap: would overwrite the log, which the command reads; give the output another name
stress scene scene.toml --cell 0 --log scene.toml
2
--log scene.toml: would overwrite the scene, which the command reads; give the output another name
run --log new --json ./new
2
--log new: --json writes to the same file as ./new; give each output a file of its own
run --plot new.json --json dangling.json
2
--plot new.json: --json writes to the same file as dangling.json; give each output a file of its own
solve box.toml --vtu new --json new/frames.pvd
2
--vtu new: --json writes to the same file as new/frames.pvd; give each output a file of its own
solve box.toml --vtu new --plot new/a --json ./new/a
2
--plot new/a: --json writes to the same file as ./new/a; give each output a file of its own
stress faults --quick --json new --plot new
2
--json new: --plot writes to the same file; give each output a file of its own
run --plot x.jpg
2
--plot x.jpg: found the ending of another format, allowed: .svg or .png; a program such as rsvg-convert or Inkscape converts the SVG
run --plot x.json
2
--plot x.json: found the ending of another format, allowed: .svg or .png
run --log x.CSV
2
--log x.CSV: found the ending of another format, allowed: .mcap
stress hold --quick --json x.mcap
2
--json x.mcap: found the ending of another format, allowed: .jsonl or .ndjson or .json
bench speed --quick --csv x.svg
2
--csv x.svg: found the ending of another format, allowed: .csv
run --plot out
2
--plot out: this is a folder; give a file
bench accuracy --quick --json no/x.json
2
--json no/x.json: the folder no does not exist; create it first
run --log no/x.mcap
2
--log no/x.mcap: the folder no does not exist; create it first
bench speed --quick --plot scene.toml
2
--plot scene.toml: this is not a folder; give a folder, which may be new
run --log pipe
2
--log pipe: this is a pipe; the command needs a file, as it does not write from beginning to end
stress faults --quick --json pipe
2
--json pipe: this is a pipe; the command needs a file, as it does not write from beginning to end
";

#[test]
fn an_output_that_would_destroy_a_file_is_refused_before_the_work() -> Outcome {
    let folder = folder()?;
    let before = contents(folder.path())?;
    let lines: Vec<&str> = REFUSED.trim().lines().collect();
    let mut wrong = Vec::new();
    for case in lines.chunks(3) {
        let [arguments, code, message] = case else {
            panic!("{case:?} is no case");
        };
        let output = palpate(folder.path(), arguments).output()?;
        let found = end(&output);
        if found != (Some(code.parse()?), format!("palpate: {message}")) {
            wrong.push(format!("{arguments}: {found:?}"));
        }
        assert!(output.stdout.is_empty(), "{arguments} worked first");
        assert_eq!(contents(folder.path())?, before, "{arguments}");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_in_which_nothing_can_be_written_is_refused_before_the_work() -> Outcome {
    let folder = tempfile::tempdir()?;
    for argument in ["--json", "--log", "--plot"] {
        let output = palpate(folder.path(), &format!("run {argument} /proc/self/new")).output()?;
        let expected = format!(
            "palpate: {argument} /proc/self/new: cannot write to this path: No such file or directory (os error 2)"
        );
        assert_eq!(end(&output), (Some(1), expected));
        assert!(output.stdout.is_empty());
    }
    Ok(())
}

#[test]
fn the_file_to_which_the_output_goes_is_not_replaced() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("plan.json");
    let to_file = |line: &str| {
        let file = File::create(&path)?;
        palpate(folder.path(), line).stdout(file).output()
    };
    let output = to_file("plan --json plan.json")?;
    let expected = "palpate: --json plan.json: the standard output goes to this file; give the output a file of its \
                    own, or /dev/stdout to have both in one file";
    assert_eq!(end(&output), (Some(2), expected.to_owned()));
    let output = to_file("run --log /dev/stdout")?;
    let expected = "palpate: --log /dev/stdout: the standard output goes to this file; give the output a file of its own";
    assert_eq!(end(&output), (Some(2), expected.to_owned()));
    let file = File::create(&path)?;
    let output = palpate(folder.path(), "plan --json plan.json")
        .stderr(file)
        .output()?;
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    let expected = "palpate: --json plan.json: the standard error goes to this file; give the output a file of its own\n";
    assert_eq!(fs::read_to_string(&path)?, expected);
    // Through the stream, both arrive, in order.
    let output = to_file("plan --json /dev/stdout")?;
    assert_eq!(end(&output), (Some(0), String::new()));
    let text = fs::read_to_string(&path)?;
    assert!(
        text.starts_with("stretch: stages of a host step\n"),
        "{text}"
    );
    assert!(text.contains("\n{\n  \"schema\": \"palpate.plan/2\"") && text.ends_with("}\n"));
    Ok(())
}

#[test]
fn devices_and_pipes_are_written_to() -> Outcome {
    let folder = tempfile::tempdir()?;
    let line = "run --duration 0.01 --log /dev/null --plot /dev/null --json /dev/stdout";
    let output = palpate(folder.path(), line).output()?;
    assert_eq!(end(&output), (Some(0), String::new()));
    let text = String::from_utf8(output.stdout)?;
    assert!(text.contains("\"schema\": \"palpate.run/4\""), "{text}");
    let output = palpate(folder.path(), "plan --json /dev/null").output()?;
    assert_eq!(end(&output), (Some(0), String::new()));

    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status()?.success());
    let mut writer = palpate(folder.path(), "plan --json pipe")
        .stdout(Stdio::null())
        .spawn()?;
    let mut read = String::new();
    File::open(&pipe)?.read_to_string(&mut read)?;
    assert!(read.contains("palpate.plan/2"), "{read}");
    assert!(writer.wait()?.success());
    Ok(())
}

/// A run that writes its log and has flushed ticks. It ends when it is killed.
fn long_run(folder: &Path) -> Result<Child, Box<dyn Error>> {
    let line = "run --clock real --duration 600 --log run.mcap --json run.json --report-progress";
    let mut child = palpate(folder, line)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()?;
    let lines = child.stderr.take().ok_or("a pipe")?;
    let mut reader = BufReader::new(lines);
    let mut line = String::new();
    while !line.starts_with("ticks ") || line.ends_with(" logged 0\n") {
        line.clear();
        assert_ne!(reader.read_line(&mut line)?, 0, "the run ended early");
    }
    // Nobody reads the other lines. The program ignores that.
    Ok(child)
}

/// Two runs of a study with one file: the study's own message.
#[test]
fn two_studies_with_one_file_of_results_are_told_to_merge() -> Outcome {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("cells.jsonl");
    let held = File::create(&path)?;
    held.try_lock()?;
    let output = palpate(folder.path(), "stress faults --quick --json cells.jsonl").output()?;
    let expected = "palpate: cells.jsonl: another run is writing to this file; give each shard a file of its own, and merge \
                    the files with cat";
    assert_eq!(end(&output), (Some(1), expected.to_owned()));
    assert_eq!(fs::read(&path)?, b"");
    Ok(())
}

/// Cases of two lines, beside a run that writes `run.mcap` and replaces `run.json`: the arguments, the message.
const BUSY: &str = r"
run --duration 0.01 --log run.mcap
--log run.mcap: another program is writing to this path; give each program a file of its own
run --duration 0.01 --log alias.mcap
--log alias.mcap: another program is writing to this path; give each program a file of its own
run --duration 0.01 --log run.json --plot x.svg
--log run.json: found the ending of another format, allowed: .mcap
plan --json alias
--json alias: another program is writing to this path; give each program a file of its own
plan --json run.json
--json run.json: another program is writing to this path; give each program a file of its own
stress faults --quick --json run.json
run.json: another run is writing to this file; give each shard a file of its own, and merge the files with cat
";

#[test]
fn what_a_running_program_writes_is_refused_until_it_ends_in_any_way() -> Outcome {
    let folder = tempfile::tempdir()?;
    let log = folder.path().join("run.mcap");
    fs::write(folder.path().join("run.json"), "older")?;
    let mut run = long_run(folder.path())?;
    fs::hard_link(&log, folder.path().join("alias.mcap"))?;
    std::os::unix::fs::symlink("run.mcap", folder.path().join("alias"))?;
    let lines: Vec<&str> = BUSY.trim().lines().collect();
    let found = lines.chunks(2).map(|case| {
        let output = palpate(folder.path(), case[0]).output()?;
        Ok((case[0], end(&output).1))
    });
    let found = found.collect::<Result<Vec<_>, std::io::Error>>();
    run.kill()?;
    run.wait()?;
    let expected = lines
        .chunks(2)
        .map(|case| (case[0], format!("palpate: {}", case[1])));
    assert_eq!(found?, expected.collect::<Vec<_>>());

    // The ticks of the killed run are whole, and its locks are gone.
    assert!(!host::log::read_log(&fs::read(&log)?)?.is_empty());
    let line = "run --duration 0.02 --log run.mcap --json run.json";
    let output = palpate(folder.path(), line).output()?;
    assert_eq!(end(&output), (Some(0), String::new()));
    assert_eq!(host::log::read_log(&fs::read(&log)?)?.len(), 20);
    let mut names: Vec<_> = fs::read_dir(&folder)?
        .map(|entry| entry.map(|entry| entry.file_name()))
        .collect::<Result<_, _>>()?;
    names.sort();
    assert_eq!(names, ["alias", "alias.mcap", "run.json", "run.mcap"]);
    Ok(())
}

#[test]
fn a_closed_pipe_ends_quietly_and_the_files_are_written() -> Outcome {
    let folder = tempfile::tempdir()?;
    for line in [
        "plan",
        "plan --json /dev/stdout",
        "plan --json plan.json",
        "run --duration 0.01 --json plan.json",
        "stress faults --quick",
        "--help",
        "run --help",
        "--version",
    ] {
        let mut child = palpate(folder.path(), line)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        drop(child.stdout.take());
        let output = child.wait_with_output()?;
        assert_eq!(end(&output), (Some(0), String::new()), "{line}");
        let json = folder.path().join("plan.json");
        assert_eq!(json.exists(), line.contains("plan.json"), "{line}");
        let _ = fs::remove_file(json);
    }
    Ok(())
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_output_is_one_line_and_the_files_are_written() -> Outcome {
    let folder = tempfile::tempdir()?;
    let full = || File::options().write(true).open("/dev/full");
    for line in [
        "plan --json plan.json",
        "run --duration 0.01",
        "--help",
        "--version",
    ] {
        let output = palpate(folder.path(), line).stdout(full()?).output()?;
        let expected =
            "palpate: cannot write to the standard output: No space left on device (os error 28)";
        assert_eq!(end(&output), (Some(1), expected.to_owned()), "{line}");
    }
    assert!(folder.path().join("plan.json").exists());
    // An error that nobody can read is still an error.
    let output = palpate(folder.path(), "plan none.toml")
        .stderr(full()?)
        .output()?;
    assert_eq!(output.status.code(), Some(2));
    Ok(())
}

/// The result of the work is printed although a file cannot be written, and the other files are written.
#[cfg(target_os = "linux")]
#[test]
fn a_failure_to_write_at_the_end_follows_the_result() -> Outcome {
    let folder = folder()?;
    let full = "cannot write /dev/full: No space left on device (os error 28)";
    let output = palpate(
        folder.path(),
        "run --duration 0.01 --plot /dev/full --json x.json",
    )
    .output()?;
    let said = "palpate: the run ended, but a part of the run failed";
    assert_eq!(end(&output), (Some(1), said.to_owned()));
    let text = String::from_utf8(output.stdout)?;
    let last = format!("  FAILED     {full}\n  json       x.json\n");
    assert!(text.contains("ticks") && text.ends_with(&last), "{text}");
    let json: serde_json::Value = serde_json::from_slice(&fs::read(folder.path().join("x.json"))?)?;
    assert_eq!(json["failures"], serde_json::json!([full]));

    let output = palpate(
        folder.path(),
        "solve box.toml --plot /dev/full --json s.json",
    )
    .output()?;
    assert_eq!(end(&output), (Some(1), format!("palpate: {full}")));
    let text = String::from_utf8(output.stdout)?;
    assert!(text.starts_with("block: equilibrium\n"), "{text}");
    assert!(text.ends_with("  json       s.json\n"), "{text}");

    let output = palpate(folder.path(), "run --replay run.mcap --json /dev/full").output()?;
    assert_eq!(end(&output), (Some(1), format!("palpate: {full}")));
    assert!(String::from_utf8(output.stdout)?.contains("10 ticks reproduced exactly"));
    Ok(())
}

#[test]
fn a_file_may_go_into_the_folder_of_the_frames() -> Outcome {
    let folder = folder()?;
    let line = "solve scene.toml --vtu new --plot new/plot.svg --json new/solution.json";
    let output = palpate(folder.path(), line).output()?;
    assert_eq!(end(&output), (Some(0), String::new()));
    let mut names = Vec::new();
    for entry in fs::read_dir(folder.path().join("new"))? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    let expected = [
        "block_0000.vtu",
        "block_0001.vtu",
        "frames.pvd",
        "plot.svg",
        "solution.json",
    ];
    assert_eq!(names, expected);
    Ok(())
}
