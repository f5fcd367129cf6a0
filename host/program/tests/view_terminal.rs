//! `palpate view` in a terminal of tmux: what it shows, how it follows keys, and how it gives the terminal back.
#![cfg(feature = "view")]

use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_palpate");
/// Longest wait for anything on the screen, on a loaded machine. No test passes because of this time.
const LONGEST: Duration = Duration::from_secs(120);

/// A terminal of tmux, until it is dropped.
struct Terminal {
    server: String,
    folder: tempfile::TempDir,
}

impl Terminal {
    /// Starts `command` in a terminal of this size. `None` if there is no tmux.
    fn start(width: u16, height: u16, command: &str) -> Option<Self> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        if Command::new("tmux").arg("-V").output().is_err() {
            eprintln!("SKIPPED: no tmux on this machine: the display in a terminal is not tested");
            return None;
        }
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let terminal = Self {
            server: format!("palpate-test-{}-{number}", std::process::id()),
            folder: tempfile::tempdir().unwrap(),
        };
        // The state of the terminal before and after, and the process that draws.
        let script = format!(
            "cd '{}' && stty -a > before && echo IN FRONT && \
             sh -c 'echo $$ > process; exec {command}'; \
             echo \"code $?\"; stty -a > after; echo AT THE END; exec sleep 1000",
            terminal.folder.path().display()
        );
        let size = [width.to_string(), height.to_string()];
        let [width, height] = &size;
        terminal.tmux(&[
            "-f",
            "/dev/null",
            "new-session",
            "-d",
            "-x",
            width,
            "-y",
            height,
            &script,
        ]);
        Some(terminal)
    }

    fn tmux(&self, arguments: &[&str]) -> Output {
        let mut tmux = Command::new("tmux");
        tmux.env_remove("TMUX")
            .env_remove("NO_COLOR")
            .env("LC_ALL", "C.UTF-8");
        let output = tmux
            .args(["-u", "-L", &self.server])
            .args(arguments)
            .output()
            .unwrap();
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        output
    }

    fn press(&self, key: &str) {
        self.tmux(&["send-keys", key]);
    }

    fn screen(&self) -> String {
        String::from_utf8(self.tmux(&["capture-pane", "-p"]).stdout).unwrap()
    }

    /// Waits until the screen is as wanted.
    fn wait(&self, what: &str, is: impl Fn(&str) -> bool) -> String {
        let start = Instant::now();
        loop {
            let screen = self.screen();
            if is(&screen) {
                return screen;
            }
            assert!(start.elapsed() < LONGEST, "never {what}:\n{screen}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn wait_for(&self, text: &str) -> String {
        self.wait(text, |screen| screen.contains(text))
    }

    fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(file)).unwrap()
    }

    /// Waits for the end of the command, with this exit code, in a terminal as it was before.
    fn ends_with(&self, code: &str) -> String {
        let screen = self.wait_for("AT THE END");
        assert!(screen.contains(&format!("code {code}\n")), "{screen}");
        assert!(
            screen.contains("IN FRONT"),
            "the screen of before is back:\n{screen}"
        );
        // The first line has the size, which a test changes.
        let modes = |file| {
            self.read(file)
                .lines()
                .skip(1)
                .map(String::from)
                .collect::<Vec<_>>()
        };
        assert!(modes("before").len() > 3);
        assert_eq!(modes("before"), modes("after"));
        screen
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = Command::new("tmux")
            .args(["-L", &self.server, "kill-server"])
            .output();
    }
}

fn dots(screen: &str) -> String {
    screen
        .chars()
        .filter(|c| ('\u{2800}'..='\u{28ff}').contains(c) || *c == '\n')
        .collect()
}

#[test]
fn it_draws_follows_keys_and_gives_the_terminal_back() {
    for (width, height) in [(80, 24), (100, 30), (160, 50)] {
        let command = format!("{PROGRAM} view --synthetic 1000000");
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
        // The display goes on with a later moment.
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
    let command = format!("{PROGRAM} view --synthetic 1000000");
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
        let command = format!("{PROGRAM} view --synthetic 1000000");
        let Some(terminal) = Terminal::start(80, 24, &command) else {
            return;
        };
        terminal.wait_for("force 1 left (N)");
        let process = terminal.read("process");
        let killed = Command::new("kill").args([signal, process.trim()]).status();
        assert!(killed.unwrap().success());
        terminal.ends_with(code);
    }
}

#[test]
fn it_ends_when_its_terminal_is_closed() {
    let command = format!("{PROGRAM} view --synthetic 1000000");
    let Some(terminal) = Terminal::start(80, 24, &command) else {
        return;
    };
    terminal.wait_for("force 1 left (N)");
    let process = Path::new("/proc").join(terminal.read("process").trim());
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

/// Whether Ctrl-C is a signal in the terminal of a display with these arguments.
fn has_signals(terminal: &Terminal) -> bool {
    let tty = terminal
        .tmux(&["display-message", "-p", "#{pane_tty}"])
        .stdout;
    let tty = String::from_utf8(tty).unwrap();
    let stty = Command::new("stty")
        .args(["-a", "-F", tty.trim()])
        .output()
        .unwrap();
    let modes = String::from_utf8(stty.stdout).unwrap();
    assert!(
        modes.contains("isig") && modes.contains("-icanon"),
        "{modes}"
    );
    !modes.contains("-isig")
}

#[test]
fn beside_its_run_the_display_leaves_ctrl_c_to_the_run_and_ends_with_it() {
    let command = format!("{PROGRAM} view --synthetic 400 --attached");
    let Some(terminal) = Terminal::start(80, 24, &command) else {
        return;
    };
    terminal.wait_for("force 1 left (N)");
    assert!(has_signals(&terminal));
    terminal.press("C-c");
    // 400 frames are 6.4 s: the display goes on to the end, and needs no key.
    terminal.wait_for("6.");
    terminal.ends_with("0");
}

#[test]
fn alone_the_display_ends_at_ctrl_c_and_stays_after_the_end_of_the_run() {
    let command = format!("{PROGRAM} view --synthetic 30");
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
    let output = Command::new(PROGRAM)
        .args(["view", "--synthetic", "130"])
        .output()
        .unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.starts_with("synthetic: real clock, scheme capped\n"),
        "{text}"
    );
    assert!(
        text.contains("1.007 s  ticks 1,008  missed 0  lateness p99 40.0 us  left "),
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
    let program = Path::new(PROGRAM).display();
    let script = format!("{program} view --synthetic 130 | head -1; exit ${{PIPESTATUS[0]}}");
    let output = Command::new("bash").args(["-c", &script]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}
