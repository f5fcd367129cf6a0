//! `palpate run --replay` reports whether a log is reproduced, and the first difference.

use host::log::{LogHeader, LogWriter};
use host::scene::Scene;
use rt_core::Telemetry;
use std::error::Error;
use std::fs::{self, File};
use std::process::{Command, Output};

type Outcome = Result<(), Box<dyn Error>>;

fn palpate(arguments: &[&str]) -> Result<(Output, String), Box<dyn Error>> {
    let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .output()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned()
        + &String::from_utf8_lossy(&output.stderr);
    Ok((output, text))
}

#[test]
fn the_command_reports_the_first_difference_and_its_exit_code_agrees() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (log, scene, json) = (at("run.mcap"), at("other.toml"), at("replay.json"));
    let (run, said) = palpate(&["run", "--duration", "0.5", "--log", &log])?;
    assert!(run.status.success(), "{said}");

    let (exact, said) = palpate(&["run", "--replay", &log])?;
    assert_eq!(exact.status.code(), Some(0), "{said}");
    assert!(said.contains("500 ticks reproduced exactly"), "{said}");

    let text = Scene::embedded_default()?.source.text;
    fs::write(&scene, text.replace("blend = 0.5 ", "blend = 1.0 "))?;
    let (differs, said) = palpate(&["run", &scene, "--replay", &log, "--json", &json])?;
    assert_eq!(differs.status.code(), Some(1), "{said}");
    assert!(
        said.contains(" s): device ") && said.contains(" now "),
        "{said}"
    );
    let json: serde_json::Value = serde_json::from_str(&fs::read_to_string(json)?)?;
    assert_eq!(json["schema"], "palpate.replay/1");
    assert!(json["first"]["tick"].is_u64(), "{json}");

    let (none, said) = palpate(&["run", "--replay", &at("none.mcap")])?;
    assert_eq!(none.status.code(), Some(1));
    assert!(said.contains("none.mcap: cannot read this log"), "{said}");
    let (both, _) = palpate(&["run", "--replay", &log, "--seed", "3"])?;
    assert_eq!(both.status.code(), Some(2));
    Ok(())
}

/// A limit of the address space in which the program has room, and four gigabytes have none (kB).
const ROOM: &str = "ulimit -v 3145728; exec \"$0\" \"$@\"";

/// As [`palpate`], without room for memory that a false length asks for.
fn limited(arguments: &[&str]) -> Result<(Output, String), Box<dyn Error>> {
    let program = env!("CARGO_BIN_EXE_palpate");
    let output = Command::new("sh")
        .args(["-c", ROOM, program])
        .args(arguments)
        .output()?;
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    Ok((output, text))
}

/// A record of a log: its operation code, its length, its content.
fn record(opcode: u8, content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u64).to_le_bytes();
    [&[opcode], length.as_slice(), content].concat()
}

/// A text of four gigabytes, of which a few bytes are there.
const TEXT: &[u8] = b"\xff\xff\xff\xff/tick";

/// Files of some sixty bytes whose records say that four gigabytes follow.
#[test]
fn a_false_length_in_a_small_file_is_one_line_and_not_the_end_of_the_program() -> Outcome {
    let folder = tempfile::tempdir()?;
    // A schema, a channel and metadata: their numbers, and the name.
    for (opcode, numbers) in [(3, 2), (4, 4), (12, 0)] {
        let content = [&vec![0; numbers], TEXT].concat();
        let header = record(1, b"\x04\0\0\0ros2\x01\0\0\0x");
        let inner = record(opcode, &content);
        let fields = [
            [0; 28].as_slice(),
            &[0; 4],
            &(inner.len() as u64).to_le_bytes(),
        ]
        .concat();
        let chunk = record(6, &[fields, inner.clone()].concat());
        for (name, body) in [("alone", inner), ("chunk", chunk)] {
            let path = folder.path().join(format!("{name}_{opcode}.mcap"));
            let magic = b"\x89MCAP0\r\n".as_slice();
            fs::write(&path, [magic, &header, &body, magic].concat())?;
            let log = path.display().to_string();
            let (output, said) = limited(&["run", "--replay", &log])?;
            assert_eq!(output.status.code(), Some(1), "{log}: {said}");
            assert_eq!(said.lines().count(), 1, "{log}: {said}");
            assert!(said.starts_with(&format!("palpate: {log}: ")), "{said}");
            let (output, said) = limited(&["view", &log, "--lines"])?;
            assert_eq!(output.status.code(), Some(1), "{log}: {said}");
            assert_eq!(said.lines().count(), 1, "{log}: {said}");
        }
    }
    Ok(())
}

/// The index at the end of a log, in which a text says that four gigabytes follow.
#[test]
fn a_false_length_in_the_index_is_one_line_and_leaves_no_file() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (log, hostile) = (at("run.mcap"), at("hostile.mcap"));
    let (run, said) = palpate(&["run", "--duration", "0.05", "--log", &log])?;
    assert!(run.status.success(), "{said}");
    fs::remove_file(at("v.csv")).ok();
    let bytes = fs::read(&log)?;
    let end = bytes.len() - 8 - 29;
    let start = bytes[end + 9..end + 17].first_chunk().ok_or("a footer")?;
    let mut place = u64::from_le_bytes(*start) as usize;
    let mut seen = Vec::new();
    while place < end {
        let (opcode, content) = (bytes[place], place + 9);
        let length = bytes[place + 1..content].first_chunk().ok_or("a length")?;
        // Where the first text of the record has its length.
        let text = match opcode {
            3 => Some(2),
            4 => Some(4),
            8 => Some(32),
            10 => Some(40),
            13 => Some(16),
            _ => None,
        };
        if let Some(text) = text {
            seen.push(opcode);
            let mut changed = bytes.clone();
            changed[content + text..content + text + 4].fill(0xff);
            fs::write(&hostile, changed)?;
            for arguments in [
                vec!["view", &hostile, "--at", "0.02", "--csv", &at("v.csv")],
                vec!["run", "--replay", &hostile, "--csv", &at("v.csv")],
            ] {
                let (output, said) = limited(&arguments)?;
                assert_eq!(output.status.code(), Some(1), "record {opcode}: {said}");
                assert_eq!(said.lines().count(), 1, "record {opcode}: {said}");
                assert!(said.contains("the log is damaged at byte"), "{said}");
            }
        }
        place = content + u64::from_le_bytes(*length) as usize;
    }
    seen.dedup();
    assert_eq!(
        seen,
        [3, 4, 8, 10, 13],
        "schemas, channels and the three indices"
    );
    let left: Vec<_> = fs::read_dir(folder.path())?.collect::<Result<_, _>>()?;
    let mut left: Vec<_> = left.iter().map(fs::DirEntry::file_name).collect();
    left.sort();
    assert_eq!(left, ["hostile.mcap", "run.mcap"]);
    Ok(())
}

/// Text that a terminal would obey: a title, a bell, a cleared screen, in seven and in eight bits.
const HOSTILE: &str = "\u{1b}]0;title\u{7}\u{1b}[2J\u{9b}31m\0";

/// The facts of a log and the fields of a file of results are text from outside.
#[test]
fn text_of_files_reaches_no_terminal_as_a_command() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name).display().to_string();
    let names = [
        "clock",
        "seed",
        "version",
        "instructions",
        "scheme",
        "scene",
    ];
    let header = LogHeader {
        facts: names
            .map(|name| (name.to_owned(), format!("{name}{HOSTILE}")))
            .into(),
        scene: Scene::embedded_default()?.source.text,
        ..LogHeader::default()
    };
    let mut writer = LogWriter::create(File::create(at("facts.mcap"))?, &header)?;
    let mut telemetry = Telemetry::empty();
    (telemetry.device_count, telemetry.body_count) = (2, 1);
    writer.write(&telemetry)?;
    writer.finish()?;
    for seed in [1, 2] {
        let text = format!(
            r#"{{"study":"wall","schema":1,"seed":{seed},"cells":1,"settings":{{}}}}
{{"cell":0,"what":"x\u001b[2J\u0000\u0007\nanother line"}}
"#
        );
        fs::write(at(&format!("{seed}.jsonl")), text)?;
    }
    let (replayed, said) = palpate(&["run", "--replay", &at("facts.mcap")])?;
    assert!(
        said.contains("under the clock?]0;title??[2J?31m? clock"),
        "{said}"
    );
    assert_eq!(replayed.status.code(), Some(1), "an invented tick");
    for arguments in [
        vec!["run", "--replay", &at("facts.mcap")],
        vec!["view", &at("facts.mcap"), "--lines"],
        vec!["stress", "seeds", &at("1.jsonl"), &at("2.jsonl")],
        vec!["run", "--replay", &at("no\u{1b}]0;name\u{7}.mcap")],
        vec!["run", &at("no\u{1b}]0;name\u{7}.toml")],
    ] {
        let (_, said) = palpate(&arguments)?;
        let raw = said.chars().find(|c| c.is_control() && *c != '\n');
        assert_eq!(raw, None, "{arguments:?}: {said:?}");
        assert!(!said.is_empty());
    }
    let (_, said) = palpate(&["stress", "seeds", &at("1.jsonl"), &at("2.jsonl")])?;
    assert!(
        said.contains("line 2: not a result of this study: unknown variant `x?[2J???another line`"),
        "{said}"
    );
    assert_eq!(said.lines().count(), 1, "{said}");
    Ok(())
}
