//! A plug-in in a process of its own.
//!
//! A vendor's library may end its process, change its folder, crash or never return. A process of its own protects the
//! run: only the device of the library is lost, and the other devices and the log continue. The process also outlives a
//! run that was killed, until it has closed the device.

use super::abi;
use super::library::{Library, PluginError};
use super::message::{
    LONGEST, Opening, decode_answer, decode_wrench, encode_answer, encode_wrench,
};
use crate::transport::wait_for;
use runner::schedule::realtime;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fd::{AsFd, OwnedFd};
use rustix::io::Errno;
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, recv, send, socketpair,
};
use rustix::process::{Signal, getpid, kill_process};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

/// Longest time in which a plug-in is loaded and opens its device.
pub const OPEN: Duration = Duration::from_secs(10);
/// Longest time of an exchange. A plug-in that takes longer hangs, and its process is ended.
pub const EXCHANGE: Duration = Duration::from_secs(1);
/// Longest time in which a plug-in closes its device.
const CLOSE: Duration = Duration::from_secs(1);
/// Time between two checks whether a process has ended.
const LOOK: Duration = Duration::from_millis(1);
/// First argument of the program that serves a plug-in. The file of the plug-in, the address of its device and the
/// priority of the process follow.
const SERVE: &str = "serve-plug-in";
/// Error numbers: the process has ended (ENODEV), does not answer (ETIMEDOUT).
const ENDED: i32 = 19;
const SILENT: i32 = 110;

/// The process of a plug-in whose device is open. Dropping it closes the device, and ends the process if that takes
/// longer than a second.
#[derive(Debug)]
pub(super) struct Process {
    child: Ending,
    socket: Option<OwnedFd>,
}

impl Process {
    /// Starts `program`, which serves the plug-in in a file, and waits until its device is open. The process takes
    /// `priority` under SCHED_FIFO, if allowed: that of the thread that waits for it. Also returns the name and the
    /// capabilities that the plug-in states.
    ///
    /// # Errors
    /// [`PluginError`].
    pub(super) fn start(
        program: &Path,
        path: &Path,
        address: &str,
        priority: u8,
    ) -> Result<(Self, String, abi::Capabilities), PluginError> {
        let started = || {
            let (near, far) = socketpair(
                AddressFamily::UNIX,
                SocketType::SEQPACKET,
                SocketFlags::CLOEXEC,
                None,
            )?;
            let mut command = Command::new(program);
            command.arg0("palpate").arg(SERVE).arg(path).arg(address);
            command.arg(priority.to_string());
            command.stdin(far);
            // The output of a plug-in is no result of the run.
            command.stdout(Stdio::from(std::io::stderr().as_fd().try_clone_to_owned()?));
            // The keys of the terminal are for the run, which ends the process in order.
            command.process_group(0);
            std::io::Result::Ok((near, command.spawn()?))
        };
        let (near, child) = started().map_err(|error| PluginError::Start {
            path: path.to_owned(),
            problem: error.to_string(),
        })?;
        let mut process = Self {
            child: Ending(child),
            socket: Some(near),
        };
        let mut buffer = [0; LONGEST];
        let opening = process.receive(&mut buffer, OPEN);
        let opening = opening.map(|length| buffer.get(..length).and_then(Opening::decode));
        match opening {
            Ok(Some(Opening::Open { name, capabilities })) => Ok((process, name, capabilities)),
            Ok(Some(Opening::Refused(problem))) => Err(PluginError::Refused(problem)),
            Err(SILENT) => Err(PluginError::Silent(path.to_owned())),
            Ok(None) | Err(_) => Err(PluginError::Ended {
                path: path.to_owned(),
                how: process.child.how(),
            }),
        }
    }

    /// Commands a wrench. Returns the result of the plug-in and the state that it filled in.
    ///
    /// # Errors
    /// The error number of a process that has ended or does not answer.
    pub(super) fn exchange(&mut self, wrench: &abi::Wrench) -> Result<(i32, abi::State), i32> {
        let socket = self.socket.as_ref().ok_or(ENDED)?;
        let sent = send(socket, &encode_wrench(wrench), SendFlags::NOSIGNAL);
        sent.map_err(|_| ENDED)?;
        let mut buffer = [0; LONGEST];
        let length = self.receive(&mut buffer, EXCHANGE)?;
        let answer = buffer.get(..length).and_then(decode_answer);
        answer.ok_or(ENDED)
    }

    /// The reason, in words, why an exchange failed with this error number. Call this for a process that is no longer
    /// used.
    pub(super) fn why(&mut self, number: i32) -> String {
        match number {
            SILENT => format!("did not answer for {} s", EXCHANGE.as_secs()),
            _ => format!("ended its process ({})", self.child.how()),
        }
    }

    /// Waits for a message, and returns its length.
    fn receive(&self, buffer: &mut [u8], wait: Duration) -> Result<usize, i32> {
        let socket = self.socket.as_ref().ok_or(ENDED)?;
        let start = Instant::now();
        // A signal of the program may end a wait early.
        loop {
            let left = wait.saturating_sub(start.elapsed());
            if wait_for(socket, PollFlags::IN, left)? {
                break;
            }
            if left.is_zero() {
                return Err(SILENT);
            }
        }
        match recv(socket, buffer, RecvFlags::empty()) {
            Ok((_, 0)) | Err(_) => Err(ENDED),
            Ok((_, length)) => Ok(length),
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The process closes its device when the socket has ended.
        self.socket = None;
        self.child.end(CLOSE);
    }
}

/// A process that is ended when this value is dropped.
#[derive(Debug)]
struct Ending(Child);

impl Ending {
    /// Waits until the process has ended by itself, at most for `wait`, and ends it otherwise.
    fn end(&mut self, wait: Duration) {
        let start = Instant::now();
        while let Ok(None) = self.0.try_wait() {
            if start.elapsed() >= wait {
                let _ = self.0.kill();
                let _ = self.0.wait();
                return;
            }
            std::thread::sleep(LOOK);
        }
    }

    /// The end of the process, in words.
    fn how(&mut self) -> String {
        self.end(CLOSE);
        match self.0.wait() {
            Ok(status) => status.to_string(),
            Err(error) => error.to_string(),
        }
    }
}

/// Serves a plug-in, if this process was started for that: `Some` with the code of the process at its end. A program
/// with the driver [`Plugins`](super::Plugins) calls this function first.
pub fn served() -> Option<ExitCode> {
    let mut arguments = std::env::args_os().skip(1);
    if arguments.next()? != SERVE {
        return None;
    }
    let (file, address) = (PathBuf::from(arguments.next()?), arguments.next()?);
    let priority = arguments.next()?.to_str()?.parse().ok()?;
    let served = serve(&file, &address.to_string_lossy(), priority);
    Some(served.map_or(ExitCode::FAILURE, |()| ExitCode::SUCCESS))
}

/// Ends this process a second after its socket has ended, if a plug-in that hangs keeps the process from ending by
/// itself. If the run was killed, no other process can do so.
fn end_with(socket: OwnedFd) {
    let wait = move || {
        // The thread waits only for the end of the socket.
        let mut ends = [PollFd::new(&socket, PollFlags::empty())];
        while poll(&mut ends, None).is_err() {}
        std::thread::sleep(CLOSE);
        let _ = kill_process(getpid(), Signal::KILL);
    };
    // Without the thread, only a plug-in that hangs outlives a run that was killed.
    let _ = std::thread::Builder::new()
        .stack_size(runner::STACK)
        .spawn(wait);
}

/// Serves the plug-in in a file over the socket that is the standard input, until the socket ends.
fn serve(file: &Path, address: &str, priority: u8) -> Result<(), Errno> {
    let socket = std::io::stdin();
    end_with(rustix::io::dup(&socket)?);
    let say = |bytes: &[u8]| send(&socket, bytes, SendFlags::NOSIGNAL).map(drop);
    let opened = Library::load(file).and_then(|library| {
        let (device, capabilities) = library.open(address)?;
        Ok((device, library.name().to_owned(), capabilities))
    });
    let mut device = match opened {
        Ok((device, name, capabilities)) => {
            say(&Opening::Open { name, capabilities }.encode())?;
            device
        }
        Err(problem) => return say(&Opening::Refused(problem.to_string()).encode()),
    };
    // A refusal is not reported here, because the tick requests a higher priority and reports its own refusal.
    let _ = realtime(priority);
    let mut buffer = [0; LONGEST];
    loop {
        let length = match recv(&socket, &mut buffer, RecvFlags::empty()) {
            Err(Errno::INTR) => continue,
            Ok((_, 0)) | Err(_) => return Ok(()),
            Ok((_, length)) => length,
        };
        let Some(wrench) = buffer.get(..length).and_then(decode_wrench) else {
            return Ok(());
        };
        let (code, state) = device.exchange(&wrench);
        say(&encode_answer(code, &state))?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::ExitStatusExt;

    fn shell(text: &str) -> Process {
        let child = Command::new("sh").args(["-c", text]).spawn();
        Process {
            child: Ending(child.expect("a shell")),
            socket: None,
        }
    }

    #[test]
    fn a_process_that_is_lost_is_described() {
        assert_eq!(
            shell("exit 3").why(ENDED),
            "ended its process (exit status: 3)"
        );
        assert_eq!(shell("exit 3").why(SILENT), "did not answer for 1 s");
    }

    #[test]
    fn a_process_that_does_not_end_is_ended() {
        let mut hangs = shell("exec sleep 600");
        hangs.child.end(Duration::from_millis(20));
        let status = hangs.child.0.try_wait().expect("ours");
        assert_eq!(status.and_then(|status| status.signal()), Some(9));
        // A process that ends by itself in time is not killed.
        let mut ends = shell("exit 4");
        ends.child.end(Duration::from_secs(60));
        let status = ends.child.0.try_wait().expect("ours");
        assert_eq!(status.and_then(|status| status.code()), Some(4));
        // Dropping ends it as well.
        let dropped = shell("exec sleep 600");
        let id = rustix::process::Pid::from_child(&dropped.child.0);
        drop(dropped);
        assert_eq!(rustix::process::test_kill_process(id), Err(Errno::SRCH));
    }
}
