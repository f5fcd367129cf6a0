//! `palpate run --view`: tells how to watch the run, and shows the run in the terminal.
//!
//! The display is a process of its own, `palpate view --attached`, on the same terminal. It may end in any way: this module
//! then gives the terminal back as it was, and the run continues.

use super::operator::{self, Keyboard};
use super::progress::ProgressBar;
use host::live::socket::address;
use rustix::process::getpgrp;
use rustix::termios::{OptionalActions, Termios, tcgetattr, tcgetpgrp, tcsetattr};
use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Longest time that the display may take to end after the run.
const FAREWELL: Duration = Duration::from_secs(3);
/// Period of the check whether the display has ended.
const CHECK: Duration = Duration::from_millis(10);
/// Ends what a display may have begun: the mouse, pasted text in brackets, the alternate screen, a hidden cursor.
const RESTORE: &[u8] =
    b"\x1b[?1000l\x1b[?1002l\x1b[?1003l\x1b[?1006l\x1b[?2004l\x1b[?1049l\x1b[?25h";

/// The display of a run.
pub(super) struct Watch {
    socket: PathBuf,
    /// Whether `palpate view` must be told the socket.
    named: bool,
    /// The terminal of the operator, if the keys of the display arm and stop the devices.
    keyboard: Option<Keyboard>,
    state: State,
}

enum State {
    /// The run has not begun.
    Before,
    /// The display has the terminal, which was in this state before.
    Shown(Child, Option<Termios>),
    /// There is no display, or there is none any more.
    Over,
}

impl Watch {
    /// The display of a run with its socket at `socket`, or at the default path. `keyboard`: the run has an operator, whose
    /// terminal the display takes while it shows the run.
    pub(super) fn new(socket: Option<PathBuf>, keyboard: Option<&Keyboard>) -> Self {
        Self {
            keyboard: keyboard.cloned(),
            named: socket.is_some(),
            socket: socket.unwrap_or_else(address::of_this_process),
            state: State::Before,
        }
    }

    /// The path of the socket, as `--view` names it.
    pub(super) fn named_socket(&self) -> Option<PathBuf> {
        self.named.then(|| self.socket.clone())
    }

    /// Whether the display has the terminal. The first call, when the run has begun, starts the display if there is a
    /// terminal. When the display has ended, gives the terminal back.
    pub(super) fn shows(&mut self, bar: &ProgressBar) -> bool {
        match &mut self.state {
            State::Before => {
                self.begin(bar);
            }
            State::Shown(child, _) => {
                // A display about which the system cannot tell is taken for ended.
                if !matches!(child.try_wait(), Ok(None)) {
                    self.give_back();
                    bar.show();
                    if self.keyboard.is_some() {
                        bar.say(&format!("the display has ended: {}", operator::LINES));
                    }
                }
            }
            State::Over => {}
        }
        matches!(self.state, State::Shown(..))
    }

    fn begin(&mut self, bar: &ProgressBar) {
        self.state = State::Over;
        let socket = self.socket.display();
        let named = if self.named {
            format!(" --socket {socket}")
        } else {
            String::new()
        };
        bar.say(&format!("watch this run with: palpate view{named}"));
        if !(io::stdin().is_terminal() && io::stdout().is_terminal() && in_front()) {
            return;
        }
        bar.hide();
        self.give_to_display(true);
        let before = tcgetattr(io::stdin()).ok();
        let program = std::env::current_exe();
        let child = program.and_then(|program| {
            let mut command = Command::new(program);
            command
                .args(["view", "--attached", "--socket"])
                .arg(&self.socket);
            if self.keyboard.is_some() {
                command
                    .arg("--operates")
                    .arg(std::process::id().to_string());
            }
            command.spawn()
        });
        match child {
            Ok(child) => self.state = State::Shown(child, before),
            Err(error) => {
                self.give_to_display(false);
                errln!("the display cannot be started: {error}");
                bar.show();
            }
        }
    }

    /// Waits for the end of the display after the run, and gives the terminal back. A display that does not end is killed.
    pub(super) fn end(&mut self) {
        if let State::Shown(child, _) = &mut self.state {
            let until = Instant::now() + FAREWELL;
            while matches!(child.try_wait(), Ok(None)) && Instant::now() < until {
                std::thread::sleep(CHECK);
            }
            self.give_back();
        }
    }

    /// Ends the display if it has not ended, and gives the terminal back.
    fn give_back(&mut self) {
        let State::Shown(mut child, before) = std::mem::replace(&mut self.state, State::Over)
        else {
            return;
        };
        // Fails for a display that has ended.
        let _ = child.kill();
        let ended = child.wait();
        if let Some(before) = before {
            // Without the terminal, nobody misses it.
            let _ = tcsetattr(io::stdin(), OptionalActions::Now, &before);
        }
        if !ended.is_ok_and(|status| status.code().is_some()) {
            let mut terminal = io::stdout();
            let _ = terminal.write_all(RESTORE).and_then(|()| terminal.flush());
        }
        self.give_to_display(false);
    }

    /// Gives the terminal of the operator to the display, or takes it back.
    fn give_to_display(&self, given: bool) {
        if let Some(keyboard) = &self.keyboard {
            keyboard.give_to_display(given);
        }
    }
}

/// Whether this program has the terminal. A program in the background must not change the modes of a terminal on which a
/// person works with another program. A terminal of another session knows no foreground.
fn in_front() -> bool {
    tcgetpgrp(io::stdin()).map_or(true, |group| group == getpgrp())
}

impl Drop for Watch {
    /// A run that fails gives the terminal back, too.
    fn drop(&mut self) {
        self.end();
    }
}
