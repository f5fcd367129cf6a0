//! Every way out of a run, and the operator's lines, from outside: a run in a terminal, in the background, without a
//! terminal, and before its first tick.
#![cfg(target_os = "linux")]

use rustix::process::Signal;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use study::stress::endings::terminal::{InTerminal, Session};

const PALPATE: &str = env!("CARGO_BIN_EXE_palpate");
/// Longest wait for anything, on a loaded machine. No test passes because of this time.
const LONGEST: Duration = Duration::from_secs(120);

/// Waits until `is` holds.
fn until(what: &str, mut is: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is() {
        assert!(start.elapsed() < LONGEST, "never: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// What a program in a terminal has written.
fn said(program: &InTerminal) -> String {
    String::from_utf8_lossy(&program.screen).into_owned()
}

/// Waits until a program in a terminal has written what is wanted after the first `from` bytes.
fn wait(program: &mut InTerminal, from: usize, what: &str, is: impl Fn(&str) -> bool) {
    let start = Instant::now();
    while !is(&String::from_utf8_lossy(&program.screen[from..])) {
        assert!(start.elapsed() < LONGEST, "never {what}: {}", said(program));
        assert!(program.ended().unwrap().is_none(), "{}", said(program));
        program.read_for(Duration::from_millis(20));
    }
}

/// Types a line, and waits until the run says that it stopped for this line.
fn types_and_is_stopped(program: &mut InTerminal, bytes: &[u8], says: &str) {
    let from = program.screen.len();
    program.type_bytes(bytes).unwrap();
    wait(program, from, says, |screen| screen.contains(says));
}

/// The exit code of a program in a terminal.
fn code(program: &mut InTerminal) -> Option<i32> {
    let start = Instant::now();
    loop {
        program.read_for(Duration::from_millis(20));
        if let Some(status) = program.ended().unwrap() {
            return status.code();
        }
        assert!(
            start.elapsed() < LONGEST,
            "it never ends: {}",
            said(program)
        );
    }
}

/// Whether the run has said that it has ticked.
fn ticks(screen: &str) -> bool {
    screen.contains("ticks ") && {
        let mut counts = screen.split("ticks ").skip(1);
        counts.any(|rest| rest.starts_with(|first: char| ('1'..='9').contains(&first)))
    }
}

/// A run under the real clock in a terminal of its own, after its first ticks. It lasts until it is ended.
fn run(session: Session, options: &[&str]) -> InTerminal {
    let mut program = start(session, options);
    wait(&mut program, 0, "ticks", ticks);
    program
}

/// The same run before its first ticks.
fn start(session: Session, options: &[&str]) -> InTerminal {
    let mut command = vec![PALPATE, "run", "--clock", "real", "--duration", "1000"];
    command.push("--report-progress");
    command.extend(options);
    InTerminal::start(session, &command).unwrap()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn every_line_stops_also_after_odd_bytes_and_after_the_end_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.json");
    let mut program = run(Session::Controlled, &["--json", path.to_str().unwrap()]);
    // No UTF-8, as a terminal of Latin-1 sends it.
    types_and_is_stopped(&mut program, b"\xe9\n", "stopped: found \"\u{fffd}\"");
    types_and_is_stopped(&mut program, b"one\n", "stopped: found \"one\"");
    // Ctrl-D on an empty line, twice, and in a line.
    types_and_is_stopped(&mut program, b"\x04\x04two\n", "stopped: found \"two\"");
    types_and_is_stopped(&mut program, b"th\x04ree\n", "stopped: found \"three\"");
    program.type_bytes(b"\x03").unwrap();
    assert_eq!(code(&mut program), Some(130), "{}", said(&program));
    let summary = json(&path);
    for device in summary["devices"].as_array().unwrap() {
        let stopped = &device["stopped"];
        assert!(stopped.as_u64() > Some(0), "{device}");
    }
}

#[test]
fn every_line_stops_after_the_display_on_a_terminal_that_answers_nothing() {
    // This terminal does not say where its cursor is.
    let folder = tempfile::tempdir().unwrap();
    let socket = format!("--view={}", folder.path().join("run.sock").display());
    let mut program = start(Session::Controlled, &[&socket]);
    wait(&mut program, 0, "a frame", |screen| {
        screen.contains("Enter stops")
    });
    program.type_bytes(b"q").unwrap();
    wait(&mut program, 0, "the end of the display", |screen| {
        screen.contains("the display has ended: Enter stops")
    });
    types_and_is_stopped(&mut program, b"one\n", "stopped: found \"one\"");
    program.type_bytes(b"\x03").unwrap();
    assert_eq!(code(&mut program), Some(130), "{}", said(&program));
}

/// An interactive shell in a terminal.
fn shell() -> InTerminal {
    let mut shell = vec!["env", "PS1=READY> ", "bash"];
    shell.extend(["--norc", "--noprofile", "--noediting", "-i"]);
    let mut shell = InTerminal::start(Session::Controlled, &shell).unwrap();
    wait(&mut shell, 0, "a prompt", |screen| {
        screen.contains("READY> ")
    });
    shell
}

#[test]
fn a_run_in_the_background_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.json");
    for options in ["", "--view"] {
        let _ = std::fs::remove_file(&path);
        let mut shell = shell();
        let line = format!(
            "XDG_RUNTIME_DIR={} {PALPATE} run --clock real --duration 0.5 --json {} {options} &\n",
            folder.path().display(),
            path.display()
        );
        shell.type_bytes(line.as_bytes()).unwrap();
        wait(&mut shell, 0, "the end of the run", |_| path.exists());
        assert_eq!(json(&path)["tick"]["count"], 500, "{}", said(&shell));
        assert!(!said(&shell).contains("Stopped"), "{}", said(&shell));
    }
}

#[test]
fn a_run_that_was_stopped_goes_on_in_the_background_and_obeys_lines_in_the_foreground() {
    let mut shell = shell();
    let line = format!("{PALPATE} run --clock real --duration 1000 --report-progress\n");
    shell.type_bytes(line.as_bytes()).unwrap();
    wait(&mut shell, 0, "ticks", ticks);
    let from = shell.screen.len();
    shell.type_bytes(b"\x1a").unwrap();
    wait(&mut shell, from, "a stopped job", |screen| {
        screen.contains("Stopped")
    });
    let from = shell.screen.len();
    shell.type_bytes(b"bg\n").unwrap();
    wait(&mut shell, from, "ticks in the background", ticks);
    // The shell has this line, and not the run.
    shell.type_bytes(b"echo $((40 + 2))\n").unwrap();
    wait(&mut shell, from, "an answer", |screen| {
        screen.contains("\n42")
    });
    shell.type_bytes(b"fg\n").unwrap();
    wait(&mut shell, from, "the command", |screen| {
        screen.matches("--report-progress").count() >= 2
    });
    types_and_is_stopped(&mut shell, b"one\n", "stopped: found \"one\"");
    let from = shell.screen.len();
    shell.type_bytes(b"\x03").unwrap();
    wait(&mut shell, from, "the end", |screen| {
        screen.contains("interrupted; shut down cleanly")
    });
}

#[test]
fn a_closed_terminal_ends_a_run_in_order_also_where_no_signal_tells_it() {
    for session in [Session::Controlled, Session::Apart] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.json");
        let mut program = run(session, &["--json", path.to_str().unwrap()]);
        program.close();
        assert_eq!(code(&mut program), Some(129), "{session:?}");
        assert_eq!(json(&path)["tick"]["stopped"], true, "{session:?}");
    }
}

#[test]
fn a_second_request_ends_a_run_that_cannot_print() {
    let mut program = run(Session::Controlled, &[]);
    // Ctrl-S: every process that prints to the terminal waits from now on.
    program.type_bytes(b"\x13").unwrap();
    let start = Instant::now();
    let status = loop {
        program.signal(Signal::TERM).unwrap();
        program.read_for(Duration::from_millis(300));
        if let Some(status) = program.ended().unwrap() {
            break status;
        }
        assert!(start.elapsed() < LONGEST, "it never ends");
    };
    assert_eq!(status.code(), Some(143));
}

/// The program, whose handlers are those of a person's shell: `nohup` and others start the tests so that they ignore
/// SIGHUP (or SIGINT, in the background), and the program would, too.
fn palpate() -> Command {
    let mut command = Command::new("env");
    command.args(["--default-signal=HUP,INT", PALPATE]);
    command
}

/// A run without a terminal. It is killed at the end of a test.
struct Run(Child);

impl Run {
    fn start(command: &mut Command) -> Self {
        let command = command.stdin(Stdio::null()).stdout(Stdio::null());
        Self(command.stderr(Stdio::null()).spawn().unwrap())
    }

    fn signal(&self, signal: Signal) {
        rustix::process::kill_process(rustix::process::Pid::from_child(&self.0), signal).unwrap();
    }

    /// Whether the process catches a signal.
    fn catches(&self, signal: Signal) -> bool {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.0.id())).unwrap();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let caught = u64::from_str_radix(caught.unwrap().trim(), 16).unwrap();
        caught & (1 << (signal.as_raw() - 1)) != 0
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_signal_before_the_first_tick_ends_a_run_in_order() {
    for clock in ["real", "virtual"] {
        for (signal, expected) in [(Signal::HUP, 129), (Signal::QUIT, 131)] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("run.json");
            let log = folder.path().join("run.mcap");
            let mut command = palpate();
            command.args(["run", "--clock", clock, "--duration", "1000", "--json"]);
            let mut run = Run::start(command.arg(&path).arg("--log").arg(&log));
            // The handlers come before anything else, so this is long before the first tick.
            until("the signal is caught", || run.catches(signal));
            run.signal(signal);
            let status = run.0.wait().unwrap();
            assert_eq!(status.code(), Some(expected), "{clock}: {status:?}");
            assert_eq!(json(&path)["tick"]["stopped"], true, "{clock}");
        }
    }
}

/// The names of the files in a folder, sorted.
fn files(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = names
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn an_interrupted_run_in_virtual_time_writes_what_ran_and_leaves_no_other_file() {
    for (signal, expected) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mut command = palpate();
        command.args(["run", "--duration", "1000"]);
        for (option, name) in [
            ("--json", "run.json"),
            ("--csv", "run.csv"),
            ("--plot", "run.svg"),
            ("--force-displacement", "curve.svg"),
            ("--log", "run.mcap"),
        ] {
            command.arg(option).arg(at(name));
        }
        let printed = at("printed.txt");
        let output = std::fs::File::create(&printed).unwrap();
        command.stdin(Stdio::null()).stderr(Stdio::null());
        let mut run = Run(command.stdout(output).spawn().unwrap());
        until("ticks are logged", || {
            std::fs::metadata(at("run.mcap")).is_ok_and(|log| log.len() > 1 << 20)
        });
        run.signal(signal);
        assert_eq!(run.0.wait().unwrap().code(), Some(expected));
        let summary = json(&at("run.json"));
        assert_eq!(summary["tick"]["stopped"], true, "{summary}");
        assert_eq!(summary["failures"], Value::Array(Vec::new()), "{summary}");
        let ticks = summary["tick"]["count"].as_u64().unwrap();
        assert!(0 < ticks && ticks < 1_000_000, "{ticks}");
        // One row for each tick, and the head.
        let rows = std::fs::read_to_string(at("run.csv")).unwrap();
        assert_eq!(rows.lines().count() as u64, ticks + 1);
        let text = std::fs::read_to_string(&printed).unwrap();
        assert!(
            text.contains("a signal ended the run before its end"),
            "{text}"
        );
        for picture in ["run.svg", "curve.svg"] {
            let svg = std::fs::read_to_string(at(picture)).unwrap();
            assert!(svg.trim_end().ends_with("</svg>"), "{picture}");
        }
        let expected = [
            "curve.svg",
            "printed.txt",
            "run.csv",
            "run.json",
            "run.mcap",
            "run.svg",
        ];
        assert_eq!(files(folder.path()), expected);
        // The log is whole: it replays bit for bit.
        let replay = Command::new(PALPATE)
            .args(["run", "--replay"])
            .arg(at("run.mcap"))
            .output()
            .unwrap();
        assert!(replay.status.success(), "{replay:?}");
    }
}

#[test]
fn a_signal_ends_another_command_at_once_and_it_leaves_nothing() {
    for (command, signal) in [
        ("compare --duration 1000", Signal::INT),
        (
            "sweep --duration 1000 --set loop.scheme=hold,capped",
            Signal::TERM,
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let mut palpate = palpate();
        palpate.args(command.split(' ').map(str::to_owned));
        let mut run = Run::start(palpate.arg("--plot").arg(folder.path().join("plot.svg")));
        until("the signal is caught", || run.catches(signal));
        run.signal(signal);
        let status = run.0.wait().unwrap();
        assert_eq!(status.signal(), Some(signal.as_raw()), "{command}");
        assert_eq!(files(folder.path()), [""; 0], "{command}");
    }
}

#[test]
fn every_signal_that_a_run_can_outlive_ends_it_in_order() {
    // The orders of an operator end a run that has none.
    let orders = [Signal::USR1, Signal::USR2];
    let signals = [
        Signal::ALARM,
        Signal::VTALARM,
        Signal::PROF,
        Signal::XCPU,
        Signal::IO,
        Signal::POWER,
        Signal::STKFLT,
    ];
    let real = signals.map(|signal| ("real", signal));
    let without_operator = orders.map(|signal| ("virtual", signal));
    for (clock, signal) in real.into_iter().chain(without_operator) {
        let mut command = palpate();
        command.args(["run", "--clock", clock, "--duration", "1000"]);
        let mut run = Run::start(&mut command);
        until("the signal is caught", || run.catches(signal));
        run.signal(signal);
        let status = run.0.wait().unwrap();
        let expected = 128 + signal.as_raw();
        assert_eq!(
            status.code(),
            Some(expected),
            "{clock}, {signal:?}: {status:?}"
        );
    }
}

#[test]
fn the_other_commands_that_hold_a_device_end_in_order() {
    let mut emulator = palpate();
    emulator.args(["device", "emulate", "omega3", "--on", "tcp", "--free"]);
    emulator.stdin(Stdio::null()).stderr(Stdio::null());
    let mut emulator = Run(emulator.stdout(Stdio::piped()).spawn().unwrap());
    let mut line = String::new();
    let output = emulator.0.stdout.take().unwrap();
    BufReader::new(output).read_line(&mut line).unwrap();
    let connect = line
        .trim()
        .trim_start_matches("connect = ")
        .trim_matches('"');
    let probe: &[&str] = &["--duration", "1000"];
    let identify: &[&str] = &["--date", "2026-01-01", "--nobody-holds-it"];
    for (name, options) in [("probe", probe), ("identify", identify)] {
        for (signal, expected) in [(Signal::HUP, 129), (Signal::QUIT, 131), (Signal::USR1, 138)] {
            let mut command = palpate();
            command.args(["device", name, connect, "--model", "omega3"]);
            let mut run = Run::start(command.args(options));
            until("the signal is caught", || run.catches(signal));
            run.signal(signal);
            let status = run.0.wait().unwrap();
            assert_eq!(
                status.code(),
                Some(expected),
                "{name}, {signal:?}: {status:?}"
            );
        }
    }
    // So does the emulator itself.
    emulator.signal(Signal::HUP);
    assert_eq!(emulator.0.wait().unwrap().code(), Some(0));
}

#[test]
fn a_run_that_was_told_to_ignore_the_loss_of_its_terminal_goes_on() {
    let mut command = Command::new("sh");
    // As `nohup` does.
    command.args([
        "-c",
        "trap '' HUP; exec \"$0\" run --clock real --duration 1000",
        PALPATE,
    ]);
    let mut run = Run::start(&mut command);
    until("the handlers are installed", || run.catches(Signal::TERM));
    run.signal(Signal::HUP);
    assert!(!run.catches(Signal::HUP));
    run.signal(Signal::TERM);
    let status = run.0.wait().unwrap();
    assert_eq!((status.code(), status.signal()), (Some(143), None));
}

#[test]
fn a_closed_standard_output_ends_no_run() {
    // A reader that ends at once, and no standard output at all.
    for redirect in ["| true", ">&-"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.json");
        let line = format!(
            "{PALPATE} run --clock real --duration 0.3 --json '{}' {redirect}",
            path.display()
        );
        let output = Command::new("sh").args(["-c", &line]).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!said.contains("panic"), "{redirect}: {said}");
        until("the summary is written", || path.exists());
    }
}

#[test]
fn the_quick_study_of_endings_finds_no_force_that_a_command_left() {
    let output = Command::new(PALPATE)
        .args(["stress", "endings", "--quick"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let printed = String::from_utf8_lossy(&output.stdout);
    let rows = printed.lines().skip(2);
    // Each of four commands, ended in three ways.
    assert_eq!(rows.clone().count(), 12, "{printed}");
    // A device that rendered no force before its end would have shown nothing. Simulated devices are not seen.
    for row in rows.filter(|row| !row.contains("virtual") && !row.contains("simulated")) {
        let columns: Vec<_> = row.split('|').map(str::trim).collect();
        assert!(columns[4].parse::<f64>().unwrap() > 0.0, "{row}");
        assert_eq!(columns[6], "0.00", "{row}");
    }
}
