//! A server for other people's viewers (Foxglove, Lichtblick), which speaks their public protocol
//! `foxglove.websocket.v1` (foxglove/ws-protocol, docs/spec.md).
//!
//! A client sees a run as it sees the log of the run: the same channels with the same definitions, the same messages
//! with the same bytes, and the same times. Obstacles, which a log has in its scene, are point clouds. The server sends and takes nothing: whatever a client sends has an effect
//! on that client alone.
//!
//! ```text
//!   feed -> hub -> queue of each client -> door -> WebSocket
//!                  session (subscriptions) <-
//! ```
//!
//! The door (`crate::door`) says who may connect.

mod hub;
mod protocol;
mod queue;
mod session;

#[cfg(test)]
mod hostile_tests;

use crate::door::{Bound, Client, DoorError, Refusal, Response, Say, Service, is_loopback};
use crate::feed::{Feed, FeedError};
use host::live::{Hello, Message};
use hub::Hub;
use protocol::{Level, SUBPROTOCOLS};
use queue::{QUEUE_LIMIT, Queue};
use session::Incoming;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use tungstenite::Message as Packet;

/// The port that the clients propose.
pub const DEFAULT_PORT: u16 = 8765;
/// How long the server waits for a message of the feed before it waits again.
const PATIENCE: Duration = Duration::from_millis(500);

/// The options of the server.
#[derive(Clone)]
pub struct Options {
    /// The port, on the loopback interface alone; zero for any that is free.
    pub port: u16,
    /// Origins whose pages may connect, such as `https://viewer.example`, beside programs without an origin, desktop
    /// programs (`file://`) and pages of this machine. `null` admits every page in a sandbox that knows the token.
    pub origins: Vec<String>,
    /// Bytes of messages that wait for one client at most. The oldest above this limit are dropped.
    pub queue_limit: usize,
    /// Receives the address, and a line about each client that is refused.
    pub say: Say,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            port: DEFAULT_PORT,
            origins: Vec::new(),
            queue_limit: QUEUE_LIMIT,
            say: Arc::new(|line| eprintln!("{line}")),
        }
    }
}

/// Why the server could not serve.
#[derive(Debug, thiserror::Error)]
pub enum FoxgloveError {
    /// The server could not be started.
    #[error(transparent)]
    Door(#[from] DoorError),
    /// An origin is not one.
    #[error(
        "the origin {0:?} is not allowed; write scheme and name without a path, such as https://viewer.example, or null"
    )]
    Origin(String),
    /// The feed broke off.
    #[error(transparent)]
    Feed(#[from] FeedError),
}

/// Serves a feed until it ends.
///
/// # Errors
/// [`FoxgloveError`].
pub fn serve(mut feed: Box<dyn Feed>, options: &Options) -> Result<(), FoxgloveError> {
    if let Some(wrong) = options.origins.iter().find(|origin| !is_origin(origin)) {
        return Err(FoxgloveError::Origin(wrong.clone()));
    }
    let bound = Bound::new(options.port)?;
    let Some(hello) = first_hello(feed.as_mut())? else {
        return Ok(());
    };
    (options.say)(&format!(
        "ws://{} for Foxglove or Lichtblick: Open connection, Foxglove WebSocket",
        bound.address()
    ));
    let bridge = Bridge {
        hub: Hub::default(),
        origins: options.origins.clone(),
        queue_limit: options.queue_limit,
    };
    let server = server_name();
    bridge.hub.begin(hello, &server);
    let door = bound.open(bridge, Arc::clone(&options.say))?;
    let hub = &door.service().hub;
    let ended = pass_on(feed.as_mut(), hub, &server);
    match &ended {
        Ok(()) => hub.say(Level::Info, "the run is over"),
        Err(error) => hub.say(Level::Error, &error.to_string()),
    }
    door.close("the source has ended");
    Ok(ended?)
}

/// The service behind the door.
struct Bridge {
    hub: Hub,
    origins: Vec<String>,
    queue_limit: usize,
}

impl Service for Bridge {
    type Queue = Queue;
    const SOCKET: &'static str = "";
    const FOR: &'static str =
        "a program that speaks foxglove.websocket.v1, such as Foxglove or Lichtblick";
    const PROTOCOLS: &'static [&'static str] = &SUBPROTOCOLS;
    const TRUST: &'static str =
        " If you trust them, start the server with --allow-origin and this origin.";

    fn admits(&self, origin: &str, _host: &str) -> bool {
        admits(origin, &self.origins)
    }

    fn file(&self, _path: &str) -> Result<Response, Refusal> {
        let line = "This server has no files.";
        Err(Refusal::new("404 Not Found", line))
    }

    fn queue(&self) -> Queue {
        Queue::new(self.queue_limit)
    }

    fn join(&self, client: &Arc<Client<Queue>>) {
        self.hub.join(client);
    }

    fn leave(&self, client: &Client<Queue>) {
        self.hub.leave(client);
    }

    fn take(&self, client: &Client<Queue>, message: &Packet) {
        let data;
        let incoming = if let Packet::Text(text) = message {
            Incoming::Text(text)
        } else {
            data = message.clone().into_data();
            Incoming::Binary(&data)
        };
        if let Some(status) = client.with(|queue| queue.receive(incoming)).flatten() {
            client.tell(status);
        }
    }
}

/// Whether an origin may connect. `null` is the origin of every page in a sandbox, so only the list can admit it.
/// Chromium sends `null` for a page that is a file, too. It sends `file://` if the program around it grants the page
/// access to files, as desktop programs such as Lichtblick do; no page of a web site has this origin.
fn admits(origin: &str, listed: &[String]) -> bool {
    let is_listed = |allowed: &String| {
        let [allowed, origin] = [allowed, origin].map(|text| text.trim_end_matches('/'));
        allowed.eq_ignore_ascii_case(origin)
    };
    origin == "file://"
        || listed.iter().any(is_listed)
        || ["http://", "https://"]
            .iter()
            .any(|scheme| origin.strip_prefix(scheme).is_some_and(is_loopback))
}

/// Waits for the first message of the feed; `None` if the source ended before.
fn first_hello(feed: &mut dyn Feed) -> Result<Option<Hello>, FeedError> {
    loop {
        match feed.next(PATIENCE)? {
            Some(Message::Hello(hello)) => return Ok(Some(*hello)),
            Some(Message::End(_)) => return Ok(None),
            Some(Message::Refused(reason)) => return Err(FeedError::Refused(reason)),
            _ => {}
        }
    }
}

/// Passes the messages of the feed on until the source ends.
fn pass_on(feed: &mut dyn Feed, hub: &Hub, server: &str) -> Result<(), FeedError> {
    loop {
        match feed.next(PATIENCE)? {
            Some(Message::Hello(hello)) => hub.begin(*hello, server),
            Some(Message::Frame(frame)) => hub.publish(*frame),
            Some(Message::End(_)) => return Ok(()),
            Some(Message::Refused(reason)) => return Err(FeedError::Refused(reason)),
            Some(Message::Surface(_) | Message::History(_) | Message::Playback(_)) | None => {}
        }
    }
}

fn is_origin(origin: &str) -> bool {
    let plain = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_graphic());
    match origin.split_once("://") {
        None => origin == "null",
        Some((scheme, name)) => {
            let name = name.strip_suffix('/').unwrap_or(name);
            plain(scheme) && plain(name) && !name.contains(['/', '*', '?', '#', '@'])
        }
    }
}

/// A name for the present server, which differs from those of other servers.
fn server_name() -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    format!("{:x}", now.unwrap_or_default().as_nanos())
}

#[cfg(test)]
mod tests {
    use super::admits;

    #[test]
    fn pages_of_other_places_are_refused_unless_they_are_listed() {
        let listed = ["https://viewer.example".to_owned()];
        for origin in [
            "http://localhost:8080",
            "https://127.0.0.1",
            "http://[::1]:3000",
            "file://",
            "https://viewer.example",
            "HTTPS://Viewer.Example",
        ] {
            assert!(admits(origin, &listed), "{origin}");
        }
        for origin in [
            "null",
            "https://evil.example",
            "https://viewer.example.evil.example",
            "http://viewer.example",
            "http://localhost.evil.example",
            "http://localhost@evil.example",
            "http://evil.example/localhost",
            "file://evil",
            "chrome-extension://abcdef",
            "localhost",
        ] {
            assert!(!admits(origin, &listed), "{origin}");
        }
    }
}
