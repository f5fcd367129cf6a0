//! A terminal of tmux for the tests.

use super::LONGEST;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// A terminal of tmux, until it is dropped.
pub(super) struct Terminal {
    server: String,
    folder: tempfile::TempDir,
    /// The folder of the sockets.
    runtime: PathBuf,
}

impl Terminal {
    /// Starts `command` in a terminal of this size. `None` if there is no tmux.
    pub(super) fn start(width: u16, height: u16, command: &str) -> Option<Self> {
        Self::start_with(None, width, height, command)
    }

    /// Starts `command` in a terminal whose runs have their sockets in `runtime`, or in the terminal's own folder.
    pub(super) fn start_with(
        runtime: Option<&Path>,
        width: u16,
        height: u16,
        command: &str,
    ) -> Option<Self> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        if Command::new("tmux").arg("-V").output().is_err() {
            eprintln!("SKIPPED: no tmux on this machine: the display in a terminal is not tested");
            return None;
        }
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let folder = tempfile::tempdir().unwrap();
        let terminal = Self {
            server: format!("palpate-test-{}-{number}", std::process::id()),
            runtime: runtime.map_or_else(|| folder.path().to_owned(), Path::to_owned),
            folder,
        };
        // The state of the terminal before and after, and the process. Ctrl-C does not end the shell.
        let script = format!(
            "trap : INT; export XDG_RUNTIME_DIR='{}'; cd '{}' && stty -a > before && echo IN FRONT && \
             sh -c 'echo $$ > process; exec {command}'; \
             echo \"code $?\"; stty -a > after; echo AT THE END; exec sleep 1000",
            terminal.runtime.display(),
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

    pub(super) fn tmux(&self, arguments: &[&str]) -> Output {
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

    pub(super) fn press(&self, key: &str) {
        self.tmux(&["send-keys", key]);
    }

    pub(super) fn screen(&self) -> String {
        String::from_utf8(self.tmux(&["capture-pane", "-p"]).stdout).unwrap()
    }

    /// Waits until the screen is as wanted.
    pub(super) fn wait(&self, what: &str, is: impl Fn(&str) -> bool) -> String {
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

    pub(super) fn wait_for(&self, text: &str) -> String {
        self.wait(text, |screen| screen.contains(text))
    }

    pub(super) fn read(&self, file: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(file)).unwrap()
    }

    /// Waits for the end of the command, with this exit code, in a terminal as it was before.
    pub(super) fn ends_with(&self, code: &str) -> String {
        let screen = self.wait_for("AT THE END");
        assert!(screen.contains(&format!("code {code}\n")), "{screen}");
        assert!(
            screen.contains("IN FRONT"),
            "the screen of before is back:\n{screen}"
        );
        assert_eq!(
            without_size(&self.read("before")),
            without_size(&self.read("after"))
        );
        assert!(
            self.is_plain(),
            "the alternate screen is left, and the cursor is visible"
        );
        screen
    }

    /// Whether the screen is that of the shell, with a visible cursor.
    pub(super) fn is_plain(&self) -> bool {
        let format = "#{alternate_on} #{cursor_flag}";
        let flags = self.tmux(&["display-message", "-p", format]).stdout;
        flags.trim_ascii() == b"0 1"
    }

    /// Waits until the terminal is as it was before, while the command continues.
    pub(super) fn wait_until_restored(&self) {
        let before = without_size(&self.read("before"));
        until("the terminal is given back", || {
            self.is_plain() && without_size(&self.modes()) == before
        });
    }

    /// The modes of the terminal now.
    pub(super) fn modes(&self) -> String {
        let tty = self.tmux(&["display-message", "-p", "#{pane_tty}"]).stdout;
        let tty = String::from_utf8(tty).unwrap();
        let mut stty = Command::new("stty");
        let stty = stty.args(["-a", "-F", tty.trim()]).output().unwrap();
        String::from_utf8(stty.stdout).unwrap()
    }

    /// The number of the process of the command.
    pub(super) fn process(&self) -> u32 {
        self.read("process").trim().parse().unwrap()
    }

    /// The folder in which the command runs.
    pub(super) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The socket of the run with this process.
    pub(super) fn socket(&self, process: u32) -> PathBuf {
        self.runtime.join(format!("palpate/{process}.sock"))
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = Command::new("tmux")
            .args(["-L", &self.server, "kill-server"])
            .output();
    }
}

/// Waits until `is` holds.
pub(super) fn until(what: &str, mut is: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is() {
        assert!(start.elapsed() < LONGEST, "never: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Sends a signal to a process.
pub(super) fn signal(process: u32, signal: &str) {
    let mut kill = Command::new("kill");
    let killed = kill.args([signal, &process.to_string()]).status();
    assert!(killed.unwrap().success());
}

/// The characters of braille on a screen, by line.
pub(super) fn dots(screen: &str) -> String {
    screen
        .chars()
        .filter(|c| ('\u{2800}'..='\u{28ff}').contains(c) || *c == '\n')
        .collect()
}

/// What `stty -a` says, without its first line, which has the size: a test may change it.
fn without_size(modes: &str) -> Vec<String> {
    let modes: Vec<_> = modes.lines().skip(1).map(String::from).collect();
    assert!(modes.len() > 3);
    modes
}
