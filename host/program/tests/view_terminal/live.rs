//! A run that is watched in a terminal: it ends in order, continues without its display, and gives the terminal back.

use super::PROGRAM;
use super::tmux::{Terminal, dots, signal, until};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;

/// The clocks of a run, as options.
const CLOCKS: [&str; 2] = ["--clock real", "--clock virtual"];

/// Runs a test under each clock, side by side: a test mostly waits for its run.
fn under_each_clock(test: impl Fn(&str) + Sync) {
    thread::scope(|scope| {
        for clock in CLOCKS {
            let test = &test;
            scope.spawn(move || test(clock));
        }
    });
}

/// Starts a run with its display.
fn run(options: &str) -> Option<Terminal> {
    let command = format!("{PROGRAM} run --view {options}");
    Terminal::start(120, 60, &command)
}

/// Waits for a dashboard that shows a body, and for a later frame.
fn wait_for_movement(terminal: &Terminal) {
    let complete = |screen: &str| {
        ["force 1 left (N)", "force 2 right (N)", "frame 0."]
            .iter()
            .all(|part| screen.contains(part))
            && dots(screen).trim().chars().count() > 100
    };
    let first = terminal.wait("a dashboard with a body", complete);
    terminal.wait("a later frame", |screen| {
        complete(screen) && moment(screen) > moment(&first) && dots(screen) != dots(&first)
    });
}

/// The time of the shown frame (s): the first line ends with `3.782 s  frame 0.0 s old  0 dropped`.
fn moment(screen: &str) -> Option<f64> {
    let words: Vec<_> = screen.lines().next()?.split_whitespace().collect();
    let at = words.iter().rposition(|word| *word == "frame")?;
    words.get(at.checked_sub(2)?)?.parse().ok()
}

/// The display of the run with this process.
fn display_of(process: u32) -> u32 {
    let mut found = None;
    until("the run has a display", || {
        found = children(process).first().copied();
        found.is_some()
    });
    found.unwrap()
}

fn children(process: u32) -> Vec<u32> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/proc").unwrap().flatten() {
        let stat = std::fs::read_to_string(entry.path().join("stat")).unwrap_or_default();
        // The name of the process, in parentheses, may have any characters.
        let Some((_, rest)) = stat.rsplit_once(") ") else {
            continue;
        };
        if rest.split(' ').nth(1) == Some(&process.to_string()) {
            found.extend(
                entry
                    .file_name()
                    .to_str()
                    .and_then(|name| name.parse::<u32>().ok()),
            );
        }
    }
    found
}

fn is_alive(process: u32) -> bool {
    Path::new("/proc").join(process.to_string()).exists()
}

/// A run without a terminal. It is killed at the end of a test.
struct Background(Child);

impl Background {
    /// Starts a run at a hundredth of its pace, with its socket in `runtime`.
    fn start(runtime: &Path) -> Self {
        let mut command = Command::new(PROGRAM);
        command.args(["run", "--view", "--pace", "0.01", "--duration", "100"]);
        command.env("XDG_RUNTIME_DIR", runtime).stdin(Stdio::null());
        command.stdout(Stdio::null()).stderr(Stdio::null());
        let run = Self(command.spawn().unwrap());
        let socket = runtime.join(format!("palpate/{}.sock", run.0.id()));
        until("the run has a socket", || socket.exists());
        run
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn ctrl_c_ends_the_run_in_order() {
    under_each_clock(|clock| {
        let Some(terminal) = run(&format!("{clock} --duration 1000")) else {
            return;
        };
        wait_for_movement(&terminal);
        let socket = terminal.socket(terminal.process());
        assert!(socket.exists());
        terminal.press("C-c");
        let screen = terminal.ends_with("130");
        assert!(screen.contains("  ticks "), "{clock}:\n{screen}");
        assert!(
            screen.contains("a signal ended the run before its end"),
            "{clock}:\n{screen}"
        );
        assert!(
            screen.contains("interrupted; shut down cleanly"),
            "{clock}:\n{screen}"
        );
        assert!(!socket.exists(), "{clock}");
    });
}

#[test]
fn a_closed_terminal_ends_a_watched_run_in_order() {
    under_each_clock(|clock| {
        let Some(terminal) = run(&format!("{clock} --duration 1000 --json run.json")) else {
            return;
        };
        wait_for_movement(&terminal);
        let process = terminal.process();
        terminal.tmux(&["kill-server"]);
        let path = terminal.folder().join("run.json");
        until("the run has written its summary", || path.exists());
        until("the run has ended", || !is_alive(process));
        let summary: serde_json::Value = serde_json::from_str(&terminal.read("run.json")).unwrap();
        assert_eq!(summary["tick"]["stopped"], true, "{clock}");
    });
}

#[test]
fn the_keys_of_its_display_stop_and_arm_the_devices_of_a_run() {
    let Some(terminal) = run("--clock real --duration 1000") else {
        return;
    };
    wait_for_movement(&terminal);
    // The line of the display tells that the order was sent, and the rows of the devices tell what the tick did.
    terminal.press("Enter");
    terminal.wait("stopped devices", |screen| {
        screen.contains("STOPPED: no device renders force") && screen.contains("stopped")
    });
    terminal.press("a");
    terminal.wait("armed devices", |screen| {
        screen.contains("the devices are armed") && !screen.contains("stopped")
    });
    terminal.press("q");
    terminal.wait_until_restored();
    terminal.press("C-c");
    let screen = terminal.ends_with("130");
    // The summary tells what the orders did: both devices stopped, and force came in again after the order to arm. A busy
    // machine interrupts either, and it begins again.
    for device in ["left", "right"] {
        for event in ["emergency stop, no force", "engaging, force coming in"] {
            assert!(screen.contains(&format!(": {device}: {event}")), "{screen}");
        }
    }
}

#[test]
fn a_key_of_its_display_lets_simulated_hands_take_hold_and_let_go() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/lift.toml");
    let options = format!("{scene} --clock real --duration 1000 --csv run.csv");
    let Some(terminal) = run(&options) else {
        return;
    };
    let mut from = moment(&terminal.wait("a frame", |screen| moment(screen).is_some()));
    for _ in 0..2 {
        terminal.press("t");
        // The run has time to obey.
        let later = terminal.wait("the order", |screen| {
            screen.contains("take_button") && moment(screen) > from.map(|at| at + 0.2)
        });
        from = moment(&later);
    }
    terminal.press("C-c");
    terminal.ends_with("130");
    let table = terminal.read("run.csv");
    let mut rows = table.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<_> = rows.next().unwrap().split(',').collect();
    let rows: Vec<Vec<_>> = rows.map(|row| row.split(',').collect()).collect();
    for device in ["left", "right"] {
        let column = format!("{device}_buttons");
        let at = names.iter().position(|name| *name == column).unwrap();
        let mut pressed: Vec<_> = rows.iter().map(|row| row[at]).collect();
        pressed.dedup();
        assert_eq!(pressed, ["0", "1", "0"], "{device}");
    }
}

#[test]
fn lines_stop_and_arm_the_devices_after_the_display_has_ended() {
    // Closed by its key, and killed.
    for killed in [false, true] {
        let Some(terminal) = run("--clock real --duration 1000") else {
            return;
        };
        wait_for_movement(&terminal);
        if killed {
            signal(display_of(terminal.process()), "-KILL");
        } else {
            terminal.press("q");
        }
        terminal.wait_until_restored();
        terminal.wait_for("the display has ended: Enter stops");
        terminal.tmux(&["send-keys", "-l", "halt"]);
        terminal.press("Enter");
        terminal.wait_for("stopped: found \"halt\"");
        terminal.press("C-c");
        let screen = terminal.ends_with("130");
        for device in ["left", "right"] {
            let event = format!(": {device}: emergency stop, no force");
            assert!(screen.contains(&event), "killed: {killed}: {screen}");
        }
    }
}

#[test]
fn q_closes_the_display_and_the_run_goes_on() {
    under_each_clock(|clock| {
        let Some(terminal) = run(&format!("{clock} --duration 6")) else {
            return;
        };
        wait_for_movement(&terminal);
        terminal.press("q");
        terminal.wait_until_restored();
        // The progress of the run, which is not over.
        terminal.wait_for("so far, ");
        assert!(is_alive(terminal.process()));
        let screen = terminal.ends_with("0");
        assert!(
            screen.contains("  ticks      6000 at"),
            "{clock}:\n{screen}"
        );
    });
}

#[test]
fn a_killed_display_does_not_end_the_run() {
    under_each_clock(|clock| {
        let Some(terminal) = run(&format!("{clock} --duration 6")) else {
            return;
        };
        wait_for_movement(&terminal);
        let display = display_of(terminal.process());
        signal(display, "-KILL");
        terminal.wait_until_restored();
        until("the display is gone", || !is_alive(display));
        assert!(is_alive(terminal.process()));
        let screen = terminal.ends_with("0");
        assert!(
            screen.contains("  ticks      6000 at"),
            "{clock}:\n{screen}"
        );
    });
}

#[test]
fn a_stopped_display_is_killed_after_the_run() {
    under_each_clock(|clock| {
        let Some(terminal) = run(&format!("{clock} --duration 5")) else {
            return;
        };
        wait_for_movement(&terminal);
        let display = display_of(terminal.process());
        signal(display, "-STOP");
        let screen = terminal.ends_with("0");
        assert!(
            screen.contains("  ticks      5000 at"),
            "{clock}:\n{screen}"
        );
        assert!(!is_alive(display), "{clock}");
    });
}

#[test]
fn the_display_of_a_killed_run_gives_the_terminal_back() {
    let Some(terminal) = run("--duration 1000") else {
        return;
    };
    wait_for_movement(&terminal);
    let display = display_of(terminal.process());
    signal(terminal.process(), "-KILL");
    until("the display is gone", || !is_alive(display));
    terminal.wait_for("the run closed the connection");
    terminal.wait_until_restored();
}

/// What `palpate view` prints on the standard error, and its exit code, where runs have their sockets in `runtime`.
fn view(runtime: &Path, options: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(PROGRAM);
    command.arg("view").args(options).stdin(Stdio::null());
    let output = command.env("XDG_RUNTIME_DIR", runtime).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    (output.status.code(), said)
}

/// Starts `palpate view` in a terminal beside runs that have their sockets in `runtime`.
fn view_in_terminal(runtime: &Path, options: &str) -> Option<Terminal> {
    let command = format!("{PROGRAM} view {options}");
    Terminal::start_with(Some(runtime), 120, 60, &command)
}

#[test]
fn a_second_terminal_attaches_to_the_only_run() {
    let Some(first) = run("--clock real --duration 1000") else {
        return;
    };
    wait_for_movement(&first);
    // A run that was killed leaves its socket, and does not count.
    let killed = Background::start(first.folder());
    let stale = first.socket(killed.0.id());
    drop(killed);
    assert!(stale.exists());
    let Some(second) = view_in_terminal(first.folder(), "") else {
        return;
    };
    wait_for_movement(&second);
    second.press("q");
    second.ends_with("0");
    first.press("C-c");
    first.ends_with("130");
}

#[test]
fn without_a_choice_there_is_one_clear_message() {
    let runtime = tempfile::tempdir().unwrap();
    let none = |stale: bool| {
        let (code, said) = view(runtime.path(), &[]);
        assert_eq!(code, Some(1), "stale: {stale}: {said}");
        let begins = said.starts_with("palpate: no run of this user can be watched (searched ");
        assert!(begins && said.lines().count() == 1, "{said}");
    };
    none(false);
    let (one, two) = (
        Background::start(runtime.path()),
        Background::start(runtime.path()),
    );
    let (code, said) = view(runtime.path(), &[]);
    assert_eq!(code, Some(1), "{said}");
    let lines: Vec<_> = said.lines().collect();
    assert_eq!(lines[0], "palpate: found 2 runs; choose one of them:");
    let mut listed = lines[1..].to_vec();
    listed.sort_unstable();
    let folder = runtime.path().join("palpate");
    let command = |run: &Background| {
        let socket = folder.join(format!("{}.sock", run.0.id()));
        format!("  palpate view --socket {}", socket.display())
    };
    let mut expected = [command(&one), command(&two)];
    expected.sort();
    assert_eq!(listed, expected);
    drop((one, two));
    none(true);
}

#[test]
fn a_display_waits_for_a_run_and_for_the_next_run() {
    let runtime = tempfile::tempdir().unwrap();
    let Some(terminal) = view_in_terminal(runtime.path(), "--wait") else {
        return;
    };
    terminal.wait_for("there is no run yet");
    for _ in 0..2 {
        let run = Background::start(runtime.path());
        terminal.wait("a run", |screen| {
            screen.contains("force 1 left (N)") && !screen.contains("the run is over")
        });
        signal(run.0.id(), "-TERM");
        terminal.wait_for("the run is over; the display waits for the next run");
    }
    terminal.press("q");
    terminal.ends_with("0");
}

/// Presses the key that saves the moment, and checks the message and the files.
fn save(terminal: &Terminal) {
    terminal.press("s");
    let screen = terminal.wait_for(" saved still_");
    let line = screen.lines().last().unwrap();
    let names: Vec<_> = line.split_whitespace().skip(1).step_by(2).collect();
    let [picture, table] = names[..] else {
        panic!("{line}");
    };
    let read = |name: &str| std::fs::read(terminal.folder().join(name)).unwrap();
    assert!(read(picture).starts_with(b"\x89PNG"));
    let table = String::from_utf8(read(table)).unwrap();
    assert!(table.lines().count() > 10, "{table}");
}

#[test]
fn the_key_s_saves_the_moment_of_a_run_and_of_a_log() {
    let Some(terminal) = run("--log run.mcap --duration 1000") else {
        return;
    };
    wait_for_movement(&terminal);
    save(&terminal);
    terminal.press("C-c");
    terminal.ends_with("130");
    let log = terminal.folder().join("run.mcap");
    let options = format!("{} --from 0.05", log.display());
    let Some(terminal) = view_in_terminal(terminal.folder(), &options) else {
        return;
    };
    terminal.wait_for("log run.mcap");
    terminal.wait_for("force 1 left (N)");
    save(&terminal);
    terminal.press("q");
    terminal.ends_with("0");
}
