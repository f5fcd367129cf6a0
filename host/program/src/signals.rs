//! How signals end a command that may command force to a device: in order.
//!
//! SIGINT (Ctrl-C), SIGTERM, SIGHUP (a terminal that was closed), SIGQUIT (Ctrl-\) and every other signal that a process
//! can outlive ([`runner::signals::ending`]) set the flag of the loop. The force becomes zero within one tick, the files
//! are finished, and the summary is printed. The handler only sets flags, so it may run on the thread of the tick.
//!
//! A person who asks again by SIGINT, SIGQUIT or SIGTERM, a second after the first request or later, ends the program at
//! once; the loop has commanded zero force by then. Sooner signals belong to the first request: `timeout` sends its signal
//! twice, to the program and to its group, and a shell that was closed and the kernel both send SIGHUP.
//!
//! A terminal may be lost without a signal, if the program has a session of its own. The thread that waits for a second
//! request therefore looks at the terminal as well. If `nohup` lets the program ignore SIGHUP, a lost terminal ends
//! nothing.
//!
//! Commands that hold no device end at once, as the signal says; only their temporary files are removed first
//! ([`clean_up_at_the_end`]). Their results that grow are complete up to the last line.
//!
//! SIGTTIN and SIGTTOU stop a program in the background that uses its terminal. A command that holds a device ignores
//! both: the program then runs in the background, and a read of the terminal fails there.

use super::CommandError;
use host::atomic_file;
use runner::Stop;
use runner::signals::{ending, ignore, is_ignored};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{
    SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGTTIN, SIGTTOU, SIGURG, SIGUSR1, SIGUSR2, SIGXFSZ,
};
use signal_hook::{flag, low_level};
use std::io::{self, IsTerminal, Read};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// The signals by which a person may ask again.
const REQUESTS: [i32; 3] = [SIGINT, SIGQUIT, SIGTERM];
/// The orders of an operator.
pub(super) const ORDERS: [i32; 2] = [SIGUSR1, SIGUSR2];
/// The order to simulated hands. Without a handler, this signal has no effect.
pub(super) const TAKE_ORDER: i32 = SIGURG;
/// Time after a request in which further requests belong to it.
const SAME: Duration = Duration::from_secs(1);
/// Period of the check whether there was a request.
const LOOK: Timespec = Timespec {
    tv_sec: 0,
    tv_nsec: 250_000_000,
};

/// Lets a write beyond the limit of a file's size fail, as a write to a full disk does. Without this, SIGXFSZ would end the
/// process at the write.
pub(super) fn ignore_file_limit() {
    // The number is that of a signal, so the call cannot fail.
    let _ = ignore(SIGXFSZ);
}

/// How a signal ended a command, in a word.
pub(super) fn ended_by(number: u8) -> &'static str {
    match i32::from(number) {
        SIGINT => "interrupted",
        SIGHUP => "the terminal was closed",
        _ => "terminated",
    }
}

/// Whether nobody has the other end of a terminal any more.
pub(super) fn is_lost(events: PollFlags) -> bool {
    events.intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL)
}

/// Lets a signal that ends a command, which holds no device and has no end of its own, first remove the temporary
/// files of the command.
pub(super) fn clean_up_at_the_end() {
    // Without a thread or a pipe they stay. The next command that writes there removes them.
    let _ = clean_up();
}

fn clean_up() -> io::Result<()> {
    let (mut waits, wakes) = UnixStream::pair()?;
    let received = Arc::new(AtomicUsize::new(0));
    let theirs = Arc::clone(&received);
    std::thread::Builder::new()
        .stack_size(runner::STACK)
        .name("palpate-signals".into())
        .spawn(move || {
            if waits.read_exact(&mut [0]).is_ok() {
                atomic_file::abandon();
                let number = i32::try_from(theirs.load(Ordering::SeqCst)).unwrap_or(SIGTERM);
                // The process ends as the signal says.
                let _ = low_level::emulate_default_handler(number);
            }
        })?;
    for signal in REQUESTS.into_iter().chain([SIGHUP]) {
        if !is_ignored(signal) {
            flag::register_usize(signal, Arc::clone(&received), signal as usize)?;
            low_level::pipe::register(signal, wakes.try_clone()?)?;
        }
    }
    Ok(())
}

/// The end of a command in order. Its handlers stay until the program ends.
pub(super) struct Ending {
    stop: Arc<Stop>,
    /// The signal that was received; zero for none.
    received: Arc<AtomicUsize>,
    /// Whether SIGHUP has asked a command that serves for another configuration.
    reload: Arc<AtomicBool>,
}

impl Ending {
    /// Installs the handlers of a command that serves and has an operator: SIGHUP asks it to read its configuration again, and
    /// ends nothing.
    ///
    /// # Errors
    /// As [`Self::begin`].
    pub(super) fn serving() -> Result<Self, CommandError> {
        Self::install(true, true).map_err(CommandError::Signals)
    }

    /// Whether SIGHUP has come since the last call.
    pub(super) fn takes_reload(&self) -> bool {
        self.reload.swap(false, Ordering::SeqCst)
    }

    /// Installs the handlers, before the command does anything else. `operated`: an operator takes [`ORDERS`]; for a
    /// command without an operator they are signals like the others.
    ///
    /// # Errors
    /// [`CommandError::Signals`] if the system refuses a handler or the thread that waits for a second request.
    pub(super) fn begin(operated: bool) -> Result<Self, CommandError> {
        Self::install(operated, false).map_err(CommandError::Signals)
    }

    fn install(operated: bool, serves: bool) -> io::Result<Self> {
        for signal in [SIGTTIN, SIGTTOU] {
            ignore(signal)?;
        }
        let new = Self {
            stop: Arc::new(Stop::new()),
            received: Arc::default(),
            reload: Arc::default(),
        };
        if serves {
            flag::register(SIGHUP, Arc::clone(&new.reload))?;
        }
        let hangs_up = !serves && !is_ignored(SIGHUP);
        let requested = Arc::new(AtomicBool::new(false));
        let orders = ORDERS.into_iter().filter(|_| !operated);
        let signals = ending().into_iter().chain(orders);
        for signal in signals.filter(|&signal| signal != SIGHUP || hangs_up) {
            flag::register_usize(signal, Arc::clone(&new.received), signal as usize)?;
            flag::register(signal, new.stop.flag())?;
            if REQUESTS.contains(&signal) {
                flag::register(signal, Arc::clone(&requested))?;
            }
        }
        let watched = Watched {
            stop: Arc::clone(&new.stop),
            received: Arc::clone(&new.received),
            requested,
            terminal: hangs_up && io::stdin().is_terminal(),
        };
        // The thread ends with the program.
        std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("palpate-signals".into())
            .spawn(move || watched.end_at_a_second_request())?;
        Ok(new)
    }

    /// The request to the loop to end.
    pub(super) fn stop(&self) -> &Arc<Stop> {
        &self.stop
    }

    /// The result of a command that has ended in order.
    ///
    /// # Errors
    /// [`CommandError::Signal`] if a signal was received.
    pub(super) fn result(&self) -> Result<(), CommandError> {
        let number = self.received.load(Ordering::SeqCst);
        match u8::try_from(number) {
            Ok(0) | Err(_) => Ok(()),
            Ok(number) => Err(CommandError::Signal(number)),
        }
    }
}

/// The streams and signals that the thread beside a command watches.
struct Watched {
    stop: Arc<Stop>,
    received: Arc<AtomicUsize>,
    /// Whether a person has asked for the end.
    requested: Arc<AtomicBool>,
    /// Whether the standard input is a terminal whose loss ends the command.
    terminal: bool,
}

impl Watched {
    /// Ends the program at the second request.
    fn end_at_a_second_request(mut self) {
        self.wait();
        std::thread::sleep(SAME);
        self.requested.store(false, Ordering::SeqCst);
        self.wait();
        let number = i32::try_from(self.received.load(Ordering::SeqCst)).unwrap_or(SIGTERM);
        atomic_file::abandon();
        low_level::exit(128_i32.saturating_add(number));
    }

    /// Waits for a request. Ends the command as SIGHUP does if its terminal is lost meanwhile.
    fn wait(&mut self) {
        while !self.requested.load(Ordering::SeqCst) {
            let input = io::stdin();
            // The loss of a terminal is told without being asked for.
            let mut polled = [PollFd::new(&input, PollFlags::empty())];
            let polled = if self.terminal {
                &mut polled[..]
            } else {
                &mut []
            };
            // An error, such as an interruption, is only an earlier look.
            let _ = poll(polled, Some(&LOOK));
            if polled.iter().any(|input| is_lost(input.revents())) {
                self.terminal = false;
                self.received.store(SIGHUP as usize, Ordering::SeqCst);
                self.stop.request();
            }
        }
    }
}
