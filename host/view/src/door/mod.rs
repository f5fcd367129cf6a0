//! The door of every server of the viewer: who may connect to this machine's port, and how much a client may cost.
//!
//! ```text
//!   TCP -> request: judged by one rule -> a file of the service
//!                                      -> WebSocket: a thread reads -> service -> queue -> a thread writes
//! ```
//!
//! A page of any web site can ask the browser of this person to connect to a port of this machine. The door follows the
//! practice of notebook servers, and RFC 6455, section 10.2. One rule holds for every service:
//!
//! - **Interface.** The port belongs to 127.0.0.1.
//! - **Token.** The path begins with 128 random bits, which are new for each start.
//! - **Host.** The name is 127.0.0.1, `localhost` or `[::1]`, so that no foreign name that was redirected to this
//!   machine is served (DNS rebinding). Any port is allowed, because the near end of an SSH tunnel has its own.
//! - **Origin.** A browser sends the origin of a page, and no page can change the origin. A program without an origin is
//!   no browser, and may connect with the token. The service decides about an origin: the page admits itself alone.
//!   Foxglove and Lichtblick are pages of other servers, or desktop programs, so their service admits pages of this
//!   machine, `file://`, and the origins that a person lists.
//! - **Request.** A GET of HTTP/1.1, alone, with each field that the door reads once, of at most 8 KiB, within 5 s.
//! - **Number.** At most 32 connections that are no WebSockets, as four browsers with six connections each need, and
//!   four clients with a WebSocket. A client beyond that is told so: with the status 503, or with the code 1013 of a
//!   WebSocket, whose reason a page can read.
//! - **Slow clients.** The service decides what waits for a client (its `Queue`), and bounds it. A client that sends
//!   faster than it reads waits for itself. A client that takes nothing for 30 s is disconnected.
//! - **Messages** of a client have at most 64 KiB, because Foxglove sends lists of subscriptions.
//! - **End.** A client that leaves or is sent away has 2 s to take what waits for it.
//! - **Once.** The person who started the server is told the reason of each refusal once.

mod client;
mod request;
mod response;

pub(crate) use client::{Client, Queue};
pub(crate) use request::{is_loopback, judge};
pub(crate) use response::{Refusal, Response};

use std::collections::BTreeSet;
use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use tungstenite::Message as Packet;

/// Most clients with a WebSocket at a time.
const CLIENTS: usize = 4;
/// Most connections at a time, in addition to the WebSockets of the clients.
const CONNECTIONS: usize = 32;
/// Most different lines about clients that were refused.
const LINES: usize = 20;

/// Receives the lines for the person who started a server: the address, and then the reason of each refusal.
pub type Say = Arc<dyn Fn(&str) + Send + Sync>;

/// A service behind the door.
pub(crate) trait Service: Send + Sync + 'static {
    /// The messages that wait for one client.
    type Queue: Queue;
    /// The path of the WebSocket below the token.
    const SOCKET: &'static str;
    /// The clients of the WebSocket, in words.
    const FOR: &'static str;
    /// The protocols of the WebSocket, in the order of preference. Without one, a client needs to offer none.
    const PROTOCOLS: &'static [&'static str];
    /// What a person can do for an origin that is not admitted, as a sentence; empty if nothing.
    const TRUST: &'static str;

    /// Whether a page of this origin may connect under the name `host`.
    fn admits(&self, origin: &str, host: &str) -> bool;

    /// The file at a path below the token.
    ///
    /// # Errors
    /// [`Refusal`] if there is none.
    fn file(&self, path: &str) -> Result<Response, Refusal>;

    /// The empty queue of a client.
    fn queue(&self) -> Self::Queue;

    /// A client has opened its WebSocket.
    fn join(&self, client: &Arc<Client<Self::Queue>>);

    /// A client has left.
    fn leave(&self, client: &Client<Self::Queue>);

    /// Takes a text or a binary message of a client.
    fn take(&self, client: &Client<Self::Queue>, message: &Packet);
}

/// The times within which a client must act.
#[derive(Clone, Copy, Debug)]
struct Times {
    /// The time for the head of a request.
    request: Duration,
    /// The time for taking some bytes.
    taking: Duration,
    /// The time for taking the waiting bytes when the connection ends.
    parting: Duration,
}

const TIMES: Times = Times {
    request: Duration::from_secs(5),
    taking: Duration::from_secs(30),
    parting: Duration::from_secs(2),
};

/// Why a server could not be started.
#[derive(Debug, thiserror::Error)]
pub enum DoorError {
    /// The port cannot be opened.
    #[error(
        "cannot open port {port} of 127.0.0.1: {source}; give another port, or 0 for a free port"
    )]
    Port {
        /// The port.
        port: u16,
        /// The system's error.
        source: io::Error,
    },
    /// The system gives no random bits.
    #[error("cannot make a token for the address: /dev/urandom: {0}")]
    Random(io::Error),
    /// The system gives no thread.
    #[error("the system gave no thread for the server: {0}")]
    Thread(io::Error),
}

/// A port that is bound, and does not accept connections yet.
pub(crate) struct Bound {
    listener: TcpListener,
    address: SocketAddr,
    token: String,
    times: Times,
}

impl Bound {
    /// Binds a port of the loopback interface; zero for any free port.
    ///
    /// # Errors
    /// [`DoorError`] if the port is taken, or if there are no random bits.
    pub(crate) fn new(port: u16) -> Result<Self, DoorError> {
        let refused = |source| DoorError::Port { port, source };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(refused)?;
        let mut bits = [0; 16];
        std::fs::File::open("/dev/urandom")
            .and_then(|mut file| file.read_exact(&mut bits))
            .map_err(DoorError::Random)?;
        Ok(Self {
            address: listener.local_addr().map_err(refused)?,
            listener,
            token: format!("{:032x}", u128::from_be_bytes(bits)),
            times: TIMES,
        })
    }

    /// The address after the scheme, with the token.
    pub(crate) fn address(&self) -> String {
        format!("{}/{}", self.address, self.token)
    }

    /// Begins to accept connections.
    ///
    /// # Errors
    /// [`DoorError`] if the system gives no thread.
    pub(crate) fn open<S: Service>(self, service: S, say: Say) -> Result<Door<S>, DoorError> {
        let shared = Arc::new(Shared {
            service,
            token: self.token,
            times: self.times,
            say,
            said: Mutex::default(),
            connections: Arc::new(()),
            clients: Mutex::default(),
            closed: AtomicBool::new(false),
        });
        let accepting = {
            let shared = Arc::clone(&shared);
            thread("view-door", move || shared.accept(&self.listener)).map_err(DoorError::Thread)?
        };
        Ok(Door {
            address: self.address,
            shared,
            accepting,
        })
    }
}

fn thread(name: &str, run: impl FnOnce() + Send + 'static) -> io::Result<JoinHandle<()>> {
    let builder = thread::Builder::new().stack_size(runner::STACK);
    builder.name(name.into()).spawn(run)
}

/// A server. Its connections have a thread each.
pub(crate) struct Door<S: Service> {
    address: SocketAddr,
    shared: Arc<Shared<S>>,
    accepting: JoinHandle<()>,
}

impl<S: Service> Door<S> {
    /// The service.
    pub(crate) fn service(&self) -> &S {
        &self.shared.service
    }

    /// Sends all clients away, and accepts no further connection. `reason` has at most 123 bytes.
    pub(crate) fn close(self, reason: &'static str) {
        self.shared.closed.store(true, Ordering::Release);
        // A connection wakes the thread that accepts. If the connection fails, the thread has ended already.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_secs(1));
        // The thread has nothing to return, and its panic has been printed.
        let _ = self.accepting.join();
        let clients = self.shared.clients().clone();
        for client in &clients {
            client.close(1001, reason);
        }
        let until = Instant::now() + self.shared.times.parting;
        for client in &clients {
            client.wait_until_gone(until.saturating_duration_since(Instant::now()));
            client.cut();
        }
    }
}

/// The state that all connections share.
struct Shared<S: Service> {
    service: S,
    token: String,
    times: Times,
    say: Say,
    /// The lines that were told.
    said: Mutex<BTreeSet<String>>,
    /// Every connection that is no WebSocket holds a copy.
    connections: Arc<()>,
    clients: Mutex<Vec<Arc<Client<S::Queue>>>>,
    closed: AtomicBool,
}

impl<S: Service> Shared<S> {
    fn clients(&self) -> MutexGuard<'_, Vec<Arc<Client<S::Queue>>>> {
        self.clients.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Accepts connections until the door is closed.
    fn accept(self: &Arc<Self>, listener: &TcpListener) {
        for stream in listener.incoming() {
            if self.closed.load(Ordering::Acquire) {
                return;
            }
            let Ok(stream) = stream else {
                // Too many open files, for instance. The wait keeps the loop from spinning.
                thread::sleep(Duration::from_millis(50));
                continue;
            };
            if Arc::strong_count(&self.connections) > CONNECTIONS {
                self.turn_away(stream);
                continue;
            }
            let place = Arc::clone(&self.connections);
            let shared = Arc::clone(self);
            // Without a thread the connection is dropped.
            let _ = thread("view-read", move || shared.receive(stream, place));
        }
    }

    /// Refuses a connection at once, without a thread: the line fits into the buffer of the socket.
    fn turn_away(&self, mut stream: TcpStream) {
        let line = format!("{CONNECTIONS} connections are open, the most that are served.");
        let refusal = Refusal::new("503 Service Unavailable", line);
        self.report(&refusal);
        let _ = stream.set_nonblocking(true);
        let _ = stream.write_all(&Response::from(refusal).bytes());
    }

    /// Serves a connection.
    fn receive(self: &Arc<Self>, mut stream: TcpStream, place: Arc<()>) {
        // A connection without these settings works, too.
        let _ = stream.set_nodelay(true);
        let answer = match self.judge(&mut stream) {
            Ok(None) => return,
            Ok(Some(request::Admitted::File(path))) => self.service.file(&path),
            Ok(Some(request::Admitted::Socket(response))) => {
                if stream.write_all(&response).is_ok() {
                    self.serve(stream, place);
                }
                return;
            }
            Err(refusal) => Err(refusal),
        };
        let response = answer.unwrap_or_else(|refusal| {
            self.report(&refusal);
            refusal.into()
        });
        response.send(&mut stream, self.times.taking);
    }

    /// Reads and judges a request; `None` if the connection ends before.
    fn judge(&self, stream: &mut TcpStream) -> Result<Option<request::Admitted>, Refusal> {
        let admits = |origin: &str, host: &str| self.service.admits(origin, host);
        request::read(stream, self.times.request, |bytes| {
            let judged = judge(bytes, &self.token, S::TRUST, &admits)?;
            let admitted = judged.map(|(request, path)| request::admitted::<S>(&request, path));
            admitted.transpose()
        })
    }

    /// Serves a client whose WebSocket is open.
    fn serve(&self, stream: TcpStream, place: Arc<()>) {
        let client = Arc::new(Client::new(stream, self.service.queue(), self.times));
        let is_admitted = {
            let mut clients = self.clients();
            let is_admitted = clients.len() < CLIENTS && !self.closed.load(Ordering::Acquire);
            if is_admitted {
                clients.push(Arc::clone(&client));
            }
            is_admitted
        };
        if is_admitted {
            drop(place);
            self.service.join(&client);
            client.serve(|message| self.service.take(&client, message));
            self.service.leave(&client);
            self.clients().retain(|other| !Arc::ptr_eq(other, &client));
        } else {
            let line =
                format!("{CLIENTS} viewers are connected already, the most that are served.");
            client.close(1013, &line);
            self.report(&Refusal::new("", line));
            client.serve(|_| ());
        }
    }

    /// Tells the person who started the server why a client was refused. Each reason is told once.
    fn report(&self, refusal: &Refusal) {
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        if said.len() < LINES && said.insert(refusal.line.clone()) {
            (self.say)(&format!("refused a client: {}", refusal.line));
        }
    }
}

#[cfg(test)]
mod tests;
