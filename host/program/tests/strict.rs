//! `palpate run --clock real`: strict or not, and ended by a signal.

use serde_json::Value;
use std::io::Write as _;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

fn palpate(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.args(["run", "--clock", "real"]).args(arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn summary(path: &Path) -> Value {
    let text = std::fs::read(path).expect("the summary was written");
    serde_json::from_slice(&text).expect("it is JSON")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Whether the run was refused because this system cannot watch system calls.
fn skipped(output: &Output) -> bool {
    let said = text(&output.stderr);
    let reasons = ["the filter of system calls", "system calls can be watched"];
    let skipped = reasons.iter().any(|reason| said.contains(reason));
    if skipped {
        // The test harness captures `eprintln`.
        let _ = writeln!(std::io::stderr(), "\n!! SKIPPED: strict runs: {said}");
    }
    skipped
}

#[test]
fn the_built_in_scene_makes_only_allowed_system_calls() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = folder.path().join("run.json");
    let output = palpate(&["--strict=syscalls", "--duration", "0.5", "--json"])
        .arg(&json)
        .output()
        .expect("the program runs");
    if skipped(&output) {
        return;
    }
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary = summary(&json);
    assert_eq!(summary["failures"], Value::Array(vec![]));
    let tick = |field: &str| summary["tick"][field].as_u64().expect("a number");
    assert_eq!(tick("count"), 500);
    assert_eq!(tick("count") + tick("missed_deadlines"), tick("slots"));
    let refused = summary["dropped"]["telemetry"].as_u64().expect("a number");
    assert_eq!(tick("records") + refused, 500);
    assert_eq!(summary["tick"]["stopped"], Value::Bool(false));
}

#[test]
fn a_strict_run_without_its_privileges_does_not_start() {
    // A run without `--strict` shows the privileges of this account.
    let granted = palpate(&["--duration", "0.05"])
        .output()
        .expect("the program runs");
    // A busy machine adds a note on steps that the host left out.
    let is_missing = |line: &str| line.contains("  note ") && !line.contains("the host left out");
    let all = !text(&granted.stdout).lines().any(is_missing);
    let output = palpate(&["--strict=privileges", "--duration", "0.05"])
        .output()
        .expect("the program runs");
    let said = text(&output.stderr);
    if all {
        assert_eq!(output.status.code(), Some(0), "{said}");
    } else {
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(
            said.contains("did not grant what the tick requires"),
            "{said}"
        );
        assert!(!text(&output.stdout).contains("ticks"));
    }
}

#[test]
fn options_of_the_ticks_thread_need_the_real_clock() {
    for option in ["--strict", "--core=0", "--priority=50"] {
        let output = Command::new(env!("CARGO_BIN_EXE_palpate"))
            .args(["run", option, "--duration", "0.01"])
            .output()
            .expect("the program runs");
        assert_eq!(output.status.code(), Some(2), "{option}");
        let said = text(&output.stderr);
        let name = option.split('=').next().expect("a name");
        assert!(
            said.contains(name) && said.contains("--clock real"),
            "{said}"
        );
    }
}

/// The place of the tick's thread in the summary, and the printed notes on privileges that were not granted.
fn placed(arguments: &[&str]) -> (Value, String) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let json = folder.path().join("run.json");
    let output = palpate(&["--duration", "0.05", "--json"])
        .arg(&json)
        .args(arguments)
        .output()
        .expect("the program runs");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    (
        summary(&json)["tick"]["place"].clone(),
        text(&output.stdout),
    )
}

#[test]
fn the_summary_names_core_and_priority_of_the_tick() {
    for (arguments, core, priority) in [
        (&["--core", "0"] as &[_], Some(0), 80),
        (&["--core", "0", "--priority", "7"], Some(0), 7),
        (&["--priority", "99"], None, 99),
    ] {
        let (place, printed) = placed(arguments);
        let noted = |note: &str| {
            printed
                .lines()
                .any(|l| l.contains("note ") && l.contains(note))
        };
        // The machine decides whether it grants a core (it may have one only) or a priority. The summary notes each
        // privilege that was not granted, and names the requested value of each that was.
        match place["core"].as_u64() {
            Some(got) => {
                assert!(core.is_none_or(|core| core == got), "{place}");
                assert!(
                    printed.contains(&format!("ran on     core {got} (")),
                    "{printed}"
                );
            }
            None => assert!(noted("not pinned to a core"), "{printed}"),
        }
        match place["priority"].as_u64() {
            Some(got) => assert_eq!(got, priority),
            None => assert!(noted(&format!("SCHED_FIFO {priority}")), "{printed}"),
        }
        let said = printed.contains(&format!("SCHED_FIFO {priority},"));
        assert_eq!(said, place["priority"].is_u64(), "{printed}");
    }
}

#[test]
fn an_invalid_core_is_refused_with_a_list_of_the_valid_ones() {
    let online = std::fs::read_to_string("/sys/devices/system/cpu/online");
    for strict in [&[] as &[_], &["--strict=privileges"]] {
        let output = palpate(&["--core", "65535", "--duration", "0.05"])
            .args(strict)
            .output()
            .expect("the program runs");
        let said = text(&output.stderr);
        match &online {
            Ok(online) => {
                assert_eq!(output.status.code(), Some(2), "{said}");
                assert!(said.contains("--core: found core 65535, allowed"), "{said}");
                assert!(said.contains(online.trim()), "{said}");
                assert!(text(&output.stdout).is_empty());
            }
            // A system that does not list its cores: the program tries the core, which is not granted.
            Err(_) => assert_eq!(
                output.status.code(),
                Some(i32::from(!strict.is_empty())),
                "{said}"
            ),
        }
    }
}

#[test]
fn an_invalid_priority_is_refused() {
    for priority in ["0", "100", "-1", "high"] {
        let output = palpate(&["--duration", "0.05", &format!("--priority={priority}")])
            .output()
            .expect("the program runs");
        assert_eq!(output.status.code(), Some(2));
        let said = text(&output.stderr);
        assert!(
            said.contains(&format!("found {priority}, allowed")),
            "{said}"
        );
    }
}

/// Waits until the tick's thread of the program exists, so that a signal arrives while it runs.
fn wait_for_the_tick(program: &Child) {
    let tasks = format!("/proc/{}/task", program.id());
    let ticking = || {
        let threads = std::fs::read_dir(&tasks).ok()?;
        let mut names =
            threads.filter_map(|task| std::fs::read_to_string(task.ok()?.path().join("comm")).ok());
        names.find(|name| name.starts_with("palpate-tick"))
    };
    while ticking().is_none() {
        std::thread::yield_now();
    }
}

#[test]
fn a_signal_ends_a_run_with_a_summary_and_a_finished_log() {
    for (name, number) in [("INT", 2), ("TERM", 15)] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (json, log) = (
            folder.path().join("run.json"),
            folder.path().join("run.mcap"),
        );
        let program = palpate(&["--duration", "600", "--json"])
            .arg(&json)
            .arg("--log")
            .arg(&log)
            .spawn()
            .expect("the program runs");
        wait_for_the_tick(&program);
        let sent = Command::new("kill")
            .args(["-s", name, &program.id().to_string()])
            .status()
            .expect("there is a kill");
        assert!(sent.success());
        let output = program.wait_with_output().expect("it ends");
        assert_eq!(
            output.status.code(),
            Some(128 + number),
            "{}",
            text(&output.stderr)
        );
        let summary = summary(&json);
        assert_eq!(summary["tick"]["stopped"], Value::Bool(true));
        assert_eq!(summary["failures"], Value::Array(vec![]));
        assert!(text(&output.stdout).contains("stopped"));
        // A complete log ends with the magic bytes of its format.
        let log = std::fs::read(&log).expect("the log was written");
        assert!(log.ends_with(b"\x89MCAP0\r\n"));
    }
}

#[test]
fn a_core_shared_with_other_threads_is_a_privilege_not_granted() {
    // The program inherits the mask of this thread, which has one core only. No other core is left for the other
    // threads.
    let output = std::thread::spawn(|| {
        use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
        let all = sched_getaffinity(None).expect("a mask");
        let core = (0..CpuSet::MAX_CPU)
            .find(|&core| all.is_set(core))
            .expect("a core");
        let mut one = CpuSet::new();
        one.set(core);
        sched_setaffinity(None, &one).expect("a core of the mask");
        let core = core.to_string();
        palpate(&["--strict=privileges", "--duration", "0.05", "--core", &core])
            .output()
            .expect("the program runs")
    });
    let output = output.join().expect("nothing panics");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("not pinned to a core of its own"), "{said}");
    assert!(!text(&output.stdout).contains("ticks"));
}

/// Name and cores of each thread of a running program, from the system.
fn threads(program: &Child) -> Vec<(String, String)> {
    let tasks = std::fs::read_dir(format!("/proc/{}/task", program.id()));
    let named = tasks.into_iter().flatten().filter_map(|task| {
        let path = task.ok()?.path();
        let name = std::fs::read_to_string(path.join("comm")).ok()?;
        let status = std::fs::read_to_string(path.join("status")).ok()?;
        let cores = status
            .lines()
            .find_map(|line| line.strip_prefix("Cpus_allowed_list:"))?;
        Some((name.trim().to_owned(), cores.trim().to_owned()))
    });
    named.collect()
}

#[test]
fn the_other_threads_do_not_use_the_named_core() {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if cores < 2 {
        return;
    }
    // The first core of this test's own mask. The program inherits the mask, so it may use the core.
    let status = std::fs::read_to_string("/proc/thread-self/status").expect("Linux tells");
    let own = status
        .lines()
        .find_map(|line| line.strip_prefix("Cpus_allowed_list:"))
        .expect("a mask");
    let core = runner::cores::parse_list(own).expect("the kernel's format")[0];
    let mut program = palpate(&["--duration", "600", "--core", &core.to_string()])
        .spawn()
        .expect("the program runs");
    wait_for_the_tick(&program);
    // The log's thread is the last to start; by then the tick's is set up.
    let all = loop {
        let all = threads(&program);
        if all.iter().any(|(name, _)| name == "palpate-log") || all.is_empty() {
            break all;
        }
        std::thread::yield_now();
    };
    program.kill().expect("it runs");
    program.wait().expect("it ends");
    assert!(all.len() >= 4, "main, tick, host and log: {all:?}");
    for (name, cores) in &all {
        let cores = runner::cores::parse_list(cores).expect("the kernel's format");
        if name == "palpate-tick" {
            assert_eq!(cores, [core]);
        } else {
            assert!(!cores.contains(&core), "{name} may run on {cores:?}");
        }
    }
}
