//! Messages to the service manager (`sd_notify(3)`): a datagram of lines `NAME=VALUE` to the socket that the environment names.

use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};

/// The part of the watchdog's time after which it is fed.
const FED: u32 = 3;

/// The service manager, if one started the program.
#[derive(Debug, Default)]
pub(super) struct Notify {
    socket: Option<(UnixDatagram, SocketAddr)>,
    /// Time between two messages to the watchdog.
    feed: Option<Duration>,
    fed: Option<Instant>,
}

impl Notify {
    /// The service manager that `NOTIFY_SOCKET` and `WATCHDOG_USEC` name.
    pub(super) fn from_environment() -> Self {
        let text = |name: &str| std::env::var(name).ok();
        let socket = text("NOTIFY_SOCKET").and_then(|name| connect(&name).ok());
        let watchdog = text("WATCHDOG_USEC").and_then(|time| time.parse().ok());
        Self {
            socket,
            feed: watchdog.map(|us| Duration::from_micros(us) / FED),
            fed: None,
        }
    }

    /// Sends lines. A message that is refused is lost, as the service manager then judges by its own times.
    pub(super) fn say(&self, lines: &str) {
        if let Some((socket, address)) = &self.socket {
            let _ = socket.send_to_addr(lines.as_bytes(), address);
        }
    }

    /// Feeds the watchdog, if it is time. The caller calls this only if ticks have advanced.
    pub(super) fn feed(&mut self) {
        let now = Instant::now();
        let is_due = |feed: Duration| self.fed.is_none_or(|fed| now.duration_since(fed) >= feed);
        if self.feed.is_some_and(is_due) {
            self.fed = Some(now);
            self.say("WATCHDOG=1");
        }
    }
}

/// A socket for the address in `NOTIFY_SOCKET`. An `@` stands for the zero of an abstract address.
fn connect(name: &str) -> io::Result<(UnixDatagram, SocketAddr)> {
    let address = match name.strip_prefix('@') {
        Some(name) => SocketAddr::from_abstract_name(name)?,
        None => SocketAddr::from_pathname(name)?,
    };
    Ok((UnixDatagram::unbound()?, address))
}
