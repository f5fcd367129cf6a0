//! A program in a terminal of its own: a pty whose other end is this process, the person at the terminal.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, open};
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::ffi::OsStr;
use std::fs::File;
use std::io;
use std::os::fd::OwnedFd;
use std::process::{Child, Command, ExitStatus};
use std::time::{Duration, Instant};

/// Whether the terminal is the one that controls the session of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Session {
    /// The program is the first of the session, as a shell is. The kernel tells it the loss of the terminal by SIGHUP.
    Controlled,
    /// The terminal belongs to no session. No signal tells its loss, and no key is a signal.
    Apart,
}

/// A program in a terminal. It is killed when this value is dropped.
pub struct InTerminal {
    master: Option<OwnedFd>,
    child: Child,
    /// What the program has written.
    pub screen: Vec<u8>,
}

impl InTerminal {
    /// Starts a command in a terminal of 120 x 40 characters. It needs `setsid` of util-linux.
    ///
    /// # Errors
    /// The error of the system, which gives no pty or cannot start the program.
    pub fn start<A: AsRef<OsStr>>(session: Session, command: &[A]) -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let path = ptsname(&master, Vec::new())?;
        let path = path.to_string_lossy().into_owned();
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let slave = File::from(open(path, flags, Mode::empty())?);
        let size = Winsize {
            ws_row: 40,
            ws_col: 120,
            ws_xpixel: 0,
            ws_ypixel: 0,
        };
        tcsetwinsize(&slave, size)?;
        // `nohup` and others start this process so that it ignores SIGHUP, and the program would, too.
        let mut starter = Command::new("env");
        starter.args(["--default-signal=HUP", "setsid"]);
        if session == Session::Controlled {
            starter.arg("--ctty");
        }
        let child = starter
            .args(command)
            .env("TERM", "xterm-256color")
            .stdin(slave.try_clone()?)
            .stdout(slave.try_clone()?)
            .stderr(slave)
            .spawn()?;
        Ok(Self {
            master: Some(master),
            child,
            screen: Vec::new(),
        })
    }

    /// Reads what the program writes, for this time.
    pub fn read_for(&mut self, time: Duration) {
        let until = Instant::now() + time;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let Some(master) = &self.master else {
                std::thread::sleep(left);
                return;
            };
            let wait = Timespec::try_from(left).ok();
            let mut polled = [PollFd::new(master, PollFlags::IN)];
            let ready = poll(&mut polled, wait.as_ref());
            let events = polled[0].revents();
            if ready == Ok(0) {
                return;
            }
            let mut bytes = [0; 4096];
            let count = if events.contains(PollFlags::IN) {
                rustix::io::read(master, &mut bytes).unwrap_or(0)
            } else {
                0
            };
            self.screen
                .extend_from_slice(bytes.get(..count).unwrap_or_default());
            if count == 0 {
                // The program has closed its end.
                std::thread::sleep(left.min(Duration::from_millis(1)));
            }
            if left.is_zero() {
                return;
            }
        }
    }

    /// Types these bytes.
    ///
    /// # Errors
    /// The error of the system.
    pub fn type_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        if let Some(master) = &self.master {
            rustix::io::write(master, bytes)?;
        }
        Ok(())
    }

    /// Closes the terminal.
    pub fn close(&mut self) {
        self.master = None;
    }

    /// Sends a signal to the program.
    ///
    /// # Errors
    /// The error of the system.
    pub fn signal(&self, signal: Signal) -> io::Result<()> {
        Ok(kill_process(Pid::from_child(&self.child), signal)?)
    }

    /// The status with which the program ended, if it has.
    ///
    /// # Errors
    /// The error of the system.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        self.child.try_wait()
    }
}

impl Drop for InTerminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
