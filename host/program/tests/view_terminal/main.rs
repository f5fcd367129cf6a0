//! `palpate view` in a terminal of tmux: what it shows, how it follows keys, and how it gives the terminal back.
#![cfg(feature = "view")]

mod closed;
mod live;
mod source;
mod tmux;

use source::Source;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};
use tmux::{Terminal, dots};

const PROGRAM: &str = env!("CARGO_BIN_EXE_palpate");
/// Longest wait for anything on the screen, on a loaded machine. No test passes because of this time.
const LONGEST: Duration = Duration::from_secs(120);

/// A run of `frames` frames, and the command that shows it.
fn view(frames: u64, options: &str) -> (Source, String) {
    let source = Source::start(frames);
    let command = format!(
        "{PROGRAM} view --socket {} {options}",
        source.socket().display()
    );
    (source, command)
}

/// A run that goes on for hours.
const ENDLESS: u64 = 1_000_000;

#[test]
fn it_draws_follows_keys_and_gives_the_terminal_back() {
    for (width, height) in [(80, 24), (100, 30), (160, 50)] {
        let (_source, command) = view(ENDLESS, "");
        let Some(terminal) = Terminal::start(width, height, &command) else {
            return;
        };
        terminal.wait("the overview", |screen| {
            [
                "force 1 left (N)",
                "lateness of ticks",
                "trip   left: force limited",
                "real clock",
            ]
            .iter()
            .all(|part| screen.contains(part))
        });
        terminal.press("2");
        terminal.wait_for("─ hands ─");
        // A stopped display stays while its frame grows old.
        terminal.press("p");
        let stopped = terminal.wait_for("the display is stopped");
        let old = |screen: &str| !screen.contains("frame 0.") && screen.contains(" s old");
        let later = terminal.wait("an older frame", old);
        let below = |screen: &str| screen.lines().skip(1).map(String::from).collect::<Vec<_>>();
        assert_eq!(below(&stopped), below(&later), "{width} x {height}");
        for key in ["Left", "Up", "+", "w"] {
            let before = dots(&terminal.screen());
            terminal.press(key);
            terminal.wait(key, |screen| dots(screen) != before);
        }
        // The display continues with a later moment.
        terminal.press("p");
        terminal.wait("a new frame", |screen| screen.contains("frame 0.0 s old"));
        terminal.press("h");
        terminal.wait_for("quit the display; the run goes on");
        terminal.press("q");
        terminal.ends_with("0");
    }
}

#[test]
fn a_change_of_size_is_followed() {
    let (_source, command) = view(ENDLESS, "");
    let Some(terminal) = Terminal::start(120, 40, &command) else {
        return;
    };
    terminal.wait_for("position 1 left (mm)");
    terminal.tmux(&["resize-window", "-x", "60", "-y", "20"]);
    terminal.wait_for("needs 80 x 24 characters");
    terminal.tmux(&["resize-window", "-x", "140", "-y", "45"]);
    terminal.wait_for("position 1 left (mm)");
    terminal.press("q");
    terminal.ends_with("0");
}

#[test]
fn a_signal_gives_the_terminal_back() {
    for (signal, code) in [("-TERM", "143"), ("-HUP", "129")] {
        let (_source, command) = view(ENDLESS, "");
        let Some(terminal) = Terminal::start(80, 24, &command) else {
            return;
        };
        terminal.wait_for("force 1 left (N)");
        tmux::signal(terminal.process(), signal);
        terminal.ends_with(code);
    }
}

#[test]
fn it_ends_when_its_terminal_is_closed() {
    let (_source, command) = view(ENDLESS, "");
    let Some(terminal) = Terminal::start(80, 24, &command) else {
        return;
    };
    terminal.wait_for("force 1 left (N)");
    let process = Path::new("/proc").join(terminal.process().to_string());
    assert!(process.exists());
    terminal.tmux(&["kill-server"]);
    let start = Instant::now();
    while process.exists() {
        assert!(
            start.elapsed() < LONGEST,
            "the viewer goes on without a terminal"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Whether Ctrl-C is a signal in the terminal of a display.
fn has_signals(terminal: &Terminal) -> bool {
    let modes = terminal.modes();
    assert!(
        modes.contains("isig") && modes.contains("-icanon"),
        "{modes}"
    );
    !modes.contains("-isig")
}

#[test]
fn beside_its_run_the_display_leaves_ctrl_c_to_the_run_and_ends_with_it() {
    let (_source, command) = view(400, "--attached");
    let Some(terminal) = Terminal::start(80, 24, &command) else {
        return;
    };
    terminal.wait_for("force 1 left (N)");
    assert!(has_signals(&terminal));
    terminal.press("C-c");
    // 400 frames are 6.4 s: the display continues to the end, and needs no key.
    terminal.wait_for("6.");
    terminal.ends_with("0");
}

#[test]
fn alone_the_display_ends_at_ctrl_c_and_stays_after_the_end_of_the_run() {
    let (_source, command) = view(30, "");
    let Some(terminal) = Terminal::start(80, 24, &command) else {
        return;
    };
    terminal.wait_for("the run is over; q quits");
    assert!(!has_signals(&terminal));
    terminal.press("C-c");
    terminal.ends_with("0");
}

#[test]
fn without_a_terminal_it_prints_lines() {
    let source = Source::start(130);
    let output = Command::new(PROGRAM)
        .args(["view", "--socket"])
        .arg(source.socket())
        .output()
        .unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.starts_with("synthetic: real clock, scheme capped\n"),
        "{text}"
    );
    assert!(
        text.contains("1.007 s  ticks 1,008  missed 0  lateness p99 40.0 µs  left "),
        "{text}"
    );
    assert!(
        text.contains("0.655 s  event trip: left: force limited\n"),
        "{text}"
    );
    assert!(text.ends_with("the end, at 2.079 s\n"), "{text}");
    assert!(!text.contains('\u{1b}'), "no control codes");
}

#[test]
fn a_closed_pipe_is_no_error() {
    let (_source, command) = view(130, "");
    let script = format!("{command} | head -1; exit ${{PIPESTATUS[0]}}");
    let output = Command::new("bash").args(["-c", &script]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}
