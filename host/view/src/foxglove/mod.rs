//! A server for other people's viewers (Foxglove, Lichtblick), which speaks their public protocol
//! `foxglove.websocket.v1` (foxglove/ws-protocol, docs/spec.md).
//!
//! A client sees a run as it sees the log of the run: the same channels with the same definitions, the same messages
//! with the same bytes, and the same times. The server sends and takes nothing: whatever a client sends has an effect
//! on that client alone.
//!
//! ```text
//!   feed -> hub -> queue of each client -> thread that writes -> WebSocket
//!                  session (subscriptions) <- thread that reads <-
//! ```

mod client;
mod door;
mod hub;
mod protocol;
mod queue;
mod session;

#[cfg(test)]
mod hostile;

use crate::feed::{Feed, FeedError};
use client::{Client, QUEUE_LIMIT};
use door::{Door, LONGEST_REQUEST, Refusal, Verdict};
use host::live::{Hello, Message};
use hub::{Hub, MOST_CLIENTS};
use protocol::Level;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// The port that the clients propose.
pub const DEFAULT_PORT: u16 = 8765;
/// How long a client may take to open its WebSocket.
const OPENING: Duration = Duration::from_secs(5);
/// How long the clients may take to receive the last messages when the source ends.
const PARTING: Duration = Duration::from_secs(5);
/// Most connections that are being opened at a time.
const MOST_OPENING: usize = 16;
/// Most different lines about clients that were refused.
const MOST_LINES: usize = 20;
/// How long the server waits for a message of the feed before it waits again.
const PATIENCE: Duration = Duration::from_millis(500);

/// Receives the lines for the person who started the server.
pub type Say = Arc<dyn Fn(&str) + Send + Sync>;

/// The options of the server.
#[derive(Clone)]
pub struct Options {
    /// The port, on the loopback interface alone; zero for any that is free.
    pub port: u16,
    /// Origins whose pages may connect, such as `https://viewer.example`, beside programs without an origin, desktop
    /// programs (`file://`) and pages of this machine. `null` admits every page in a sandbox that knows the token.
    pub origins: Vec<String>,
    /// The path of the address; `None` for a new random one.
    pub token: Option<String>,
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
            token: None,
            queue_limit: QUEUE_LIMIT,
            say: Arc::new(|line| eprintln!("{line}")),
        }
    }
}

/// Why the server could not serve.
#[derive(Debug, thiserror::Error)]
pub enum FoxgloveError {
    /// The port cannot be opened.
    #[error(
        "cannot open port {port} of 127.0.0.1: {source}; give another port with --foxglove=PORT"
    )]
    Port {
        /// The port.
        port: u16,
        /// The system's error.
        source: io::Error,
    },
    /// The system gives no random numbers.
    #[error("cannot make a token for the address: /dev/urandom: {0}")]
    Random(io::Error),
    /// A token has characters that an address cannot have.
    #[error("the token {0:?} is not allowed; use letters and digits")]
    Token(String),
    /// An origin is not one.
    #[error(
        "the origin {0:?} is not allowed; write scheme and name without a path, such as https://viewer.example, or null"
    )]
    Origin(String),
    /// The system gives no thread.
    #[error("the system gave no thread for the server: {0}")]
    Thread(io::Error),
    /// The feed broke off.
    #[error(transparent)]
    Feed(#[from] FeedError),
}

/// Serves a feed until it ends.
///
/// # Errors
/// [`FoxgloveError`].
pub fn serve(mut feed: Box<dyn Feed>, options: &Options) -> Result<(), FoxgloveError> {
    let token = match &options.token {
        Some(token) if !is_token(token) => return Err(FoxgloveError::Token(token.clone())),
        Some(token) => token.clone(),
        None => random_token().map_err(FoxgloveError::Random)?,
    };
    if let Some(wrong) = options.origins.iter().find(|origin| !is_origin(origin)) {
        return Err(FoxgloveError::Origin(wrong.clone()));
    }
    let port = options.port;
    let refused = |source| FoxgloveError::Port { port, source };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refused)?;
    let address = listener.local_addr().map_err(refused)?;
    let Some(hello) = first_hello(feed.as_mut())? else {
        return Ok(());
    };
    (options.say)(&format!(
        "ws://{address}/{token} for Foxglove or Lichtblick: Open connection, Foxglove WebSocket"
    ));

    let hub = Arc::new(Hub::default());
    let server = server_name();
    hub.begin(hello, &server);
    let reception = Arc::new(Reception {
        door: Door {
            token,
            origins: options.origins.clone(),
        },
        hub: Arc::clone(&hub),
        say: Arc::clone(&options.say),
        said: Mutex::default(),
        queue_limit: options.queue_limit,
        opening: AtomicUsize::new(0),
        closed: AtomicBool::new(false),
    });
    let accepting = {
        let reception = Arc::clone(&reception);
        thread::Builder::new()
            .stack_size(runner::STACK)
            .name("foxglove accepts".into())
            .spawn(move || reception.accept(&listener))
            .map_err(FoxgloveError::Thread)?
    };
    let ended = pass_on(feed.as_mut(), &hub, &server);
    match &ended {
        Ok(()) => hub.end(Level::Info, "the run is over", PARTING),
        Err(error) => hub.end(Level::Error, &error.to_string(), PARTING),
    }
    reception.close(address);
    // The thread has nothing to return, and its panic has been printed.
    let _ = accepting.join();
    ended.map_err(FoxgloveError::Feed)
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

/// Admits clients.
struct Reception {
    door: Door,
    hub: Arc<Hub>,
    say: Say,
    /// The lines about refused clients, each once.
    said: Mutex<BTreeSet<String>>,
    queue_limit: usize,
    /// Connections that are being opened.
    opening: AtomicUsize,
    closed: AtomicBool,
}

impl Reception {
    /// Admits clients until the server is closed.
    fn accept(self: Arc<Self>, listener: &TcpListener) {
        for stream in listener.incoming() {
            if self.closed.load(Ordering::Acquire) {
                return;
            }
            let Ok(stream) = stream else {
                // Out of descriptors, for instance. Others may become free.
                thread::sleep(Duration::from_millis(50));
                continue;
            };
            if self.opening.fetch_add(1, Ordering::AcqRel) >= MOST_OPENING {
                self.opening.fetch_sub(1, Ordering::AcqRel);
                continue;
            }
            let reception = Arc::clone(&self);
            let spawned = thread::Builder::new()
                .stack_size(runner::STACK)
                .name("foxglove reads".into())
                .spawn(move || reception.receive(stream));
            if spawned.is_err() {
                self.opening.fetch_sub(1, Ordering::AcqRel);
            }
        }
    }

    /// Ends the thread that admits clients.
    fn close(&self, address: SocketAddr) {
        self.closed.store(true, Ordering::Release);
        // A connection wakes the thread. If it fails, the listener is closed already.
        let _ = TcpStream::connect(address);
    }

    /// Judges a connection and serves it.
    fn receive(&self, mut stream: TcpStream) {
        let verdict = self.judge(&mut stream);
        self.opening.fetch_sub(1, Ordering::AcqRel);
        let refusal = match verdict {
            Ok(Verdict::Admitted { response }) => match self.admit(stream, &response) {
                Ok(()) => return,
                Err(refused) => refused,
            },
            Ok(Verdict::Refused(refusal)) => (stream, refusal),
            // A connection that broke off or said nothing needs no answer.
            Ok(Verdict::Incomplete) | Err(_) => return,
        };
        let (mut stream, refusal) = refusal;
        self.report(&refusal);
        // A client that is gone needs no answer.
        let _ = stream.write_all(refusal.response().as_bytes());
    }

    /// Reads the request of a connection.
    fn judge(&self, stream: &mut TcpStream) -> io::Result<Verdict> {
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(OPENING))?;
        let until = Instant::now() + OPENING;
        let mut request = Vec::new();
        let mut piece = [0; 1024];
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(Verdict::Incomplete);
            }
            stream.set_read_timeout(Some(left))?;
            let room = piece.len().min(LONGEST_REQUEST - request.len());
            let length = stream.read(piece.get_mut(..room).unwrap_or_default())?;
            if length == 0 {
                return Ok(Verdict::Incomplete);
            }
            request.extend_from_slice(piece.get(..length).unwrap_or_default());
            match self.door.judge(&request) {
                Verdict::Incomplete => {}
                verdict => {
                    stream.set_read_timeout(None)?;
                    return Ok(verdict);
                }
            }
        }
    }

    /// Opens the WebSocket and serves the client until it leaves.
    fn admit(&self, stream: TcpStream, response: &str) -> Result<(), (TcpStream, Refusal)> {
        let full = |stream| {
            let reason = format!("{MOST_CLIENTS} clients are connected, and no more are served");
            let status = "503 Service Unavailable";
            Err((stream, Refusal { status, reason }))
        };
        let Ok(second) = stream.try_clone() else {
            return full(stream);
        };
        let client = Arc::new(Client::new(second, self.queue_limit));
        if !self.hub.join(&client) {
            return full(stream);
        }
        // The greeting waits in the queue until the response is out.
        let opened = (&stream)
            .write_all(response.as_bytes())
            .and_then(|()| stream.set_write_timeout(None));
        if opened.is_err() || client.serve().is_err() {
            client.cut();
        }
        self.hub.leave(&client);
        Ok(())
    }

    /// Tells the person who started the server that a client was refused. Each reason is told once.
    fn report(&self, refusal: &Refusal) {
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        if said.len() < MOST_LINES && said.insert(refusal.reason.clone()) {
            (self.say)(&format!("refused a client: {}", refusal.reason));
        }
    }
}

fn is_token(token: &str) -> bool {
    !token.is_empty() && token.len() <= 100 && token.bytes().all(|b| b.is_ascii_alphanumeric())
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

/// A token of 128 random bits.
fn random_token() -> io::Result<String> {
    let mut bytes = [0; 16];
    File::open("/dev/urandom")?.read_exact(&mut bytes)?;
    Ok(format!("{:032x}", u128::from_be_bytes(bytes)))
}
