//! One client that is connected: a thread reads its messages, and a thread writes what waits for it.
//!
//! The thread that reads decodes frames by `tungstenite`. The replies of `tungstenite`, such as the answer to a ping,
//! go into the queue, so that one thread alone writes to the connection.

use super::protocol::{Channel, Level, put_close, status};
use super::queue::Queue;
use super::session::{Incoming, Session};
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Message, WebSocket};

/// Bytes of messages that wait for a client at most: several seconds of a run with large bodies.
pub(super) const QUEUE_LIMIT: usize = 16 << 20;
/// Longest message of a client (bytes).
const LONGEST_MESSAGE: usize = 64 << 10;
/// Answers that wait for a client at most. The thread that reads waits until the client takes some.
const MOST_ANSWERS: usize = 64;
/// Bytes that are collected for one call of the system.
const BATCH: usize = 64 << 10;
/// How long a client that leaves may take to receive what waits for it.
const PARTING: Duration = Duration::from_secs(2);

/// A client.
pub(super) struct Client {
    state: Mutex<State>,
    changed: Condvar,
    stream: TcpStream,
}

struct State {
    session: Session,
    channels: Arc<[Channel]>,
    queue: Queue,
    /// The frame that ends the connection, after everything that waits.
    ending: Option<Vec<u8>>,
    /// Nothing more is accepted. The thread that writes ends when the queue is empty.
    ended: bool,
    /// The connection is gone.
    gone: bool,
    /// The thread that writes has ended.
    written: bool,
}

impl Client {
    /// A client on a connection whose WebSocket is open.
    pub(super) fn new(stream: TcpStream, limit: usize) -> Self {
        Self {
            state: Mutex::new(State {
                session: Session::default(),
                channels: Arc::from([]),
                queue: Queue::new(limit),
                ending: None,
                ended: false,
                gone: false,
                written: false,
            }),
            changed: Condvar::new(),
            stream,
        }
    }

    /// A thread that panicked leaves the state as it is: each change of the state is complete in itself.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        let waited = self.changed.wait(state);
        waited.unwrap_or_else(PoisonError::into_inner)
    }

    /// Sends texts.
    pub(super) fn tell(&self, texts: &[&str]) {
        let mut state = self.lock();
        if !state.ended {
            for text in texts {
                state.queue.push_text(text);
            }
            self.changed.notify_all();
        }
    }

    /// Gives the client new channels in place of its former ones, whose subscriptions end. `texts` tell the client.
    pub(super) fn replace_channels(&self, channels: &Arc<[Channel]>, texts: &[&str]) {
        let mut state = self.lock();
        state.channels = Arc::clone(channels);
        state.session.clear();
        state.queue.clear();
        drop(state);
        self.tell(texts);
    }

    /// Whether the client has a subscription to a channel.
    pub(super) fn wants(&self, channel: u32) -> bool {
        self.lock().session.subscription(channel).is_some()
    }

    /// Sends a message of a channel if the client has a subscription to the channel. See [`Queue::push_message`].
    pub(super) fn deliver(&self, channel: u32, time_ns: u64, clock_ns: u64, data: &Arc<[u8]>) {
        let mut state = self.lock();
        if let Some(subscription) = state.session.subscription(channel)
            && !state.ended
        {
            state
                .queue
                .push_message(subscription, time_ns, clock_ns, data);
            self.changed.notify_all();
        }
    }

    /// Sends the time of the source.
    pub(super) fn tell_time(&self, clock_ns: u64) {
        let mut state = self.lock();
        if !state.ended {
            state.queue.push_time(clock_ns);
            self.changed.notify_all();
        }
    }

    /// Ends the connection when everything that waits is sent. A reason has at most 123 bytes.
    pub(super) fn end(&self, code: u16, reason: &str) {
        let mut state = self.lock();
        if !state.ended {
            let mut frame = Vec::new();
            put_close(code, reason, &mut frame);
            state.ending = Some(frame);
            state.ended = true;
            self.changed.notify_all();
        }
    }

    /// Ends the connection at once.
    pub(super) fn cut(&self) {
        let mut state = self.lock();
        state.ended = true;
        state.gone = true;
        // A connection that is gone needs no end.
        let _ = self.stream.shutdown(Shutdown::Both);
        self.changed.notify_all();
    }

    /// Serves the client until it leaves or is sent away.
    ///
    /// # Errors
    /// If the system gives no second handle of the connection, or no thread.
    pub(super) fn serve(self: &Arc<Self>) -> io::Result<()> {
        let from = Connection {
            stream: self.stream.try_clone()?,
            client: Arc::clone(self),
        };
        let writer = {
            let client = Arc::clone(self);
            thread::Builder::new()
                .stack_size(runner::STACK)
                .name("foxglove writes".into())
                .spawn(move || client.write())?
        };
        self.read(from);
        self.lock().ended = true;
        self.changed.notify_all();
        self.wait_until_written(Instant::now() + PARTING);
        self.cut();
        // The thread has nothing to return, and its panic has been printed.
        let _ = writer.join();
        Ok(())
    }

    /// Waits until everything that waits for a client whose connection ends is written, or until a moment.
    pub(super) fn wait_until_written(&self, until: Instant) {
        let mut state = self.lock();
        while !state.written {
            let Some(left) = until.checked_duration_since(Instant::now()) else {
                return;
            };
            let waited = self.changed.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Reads messages until the connection ends.
    fn read(&self, from: Connection) {
        let config = WebSocketConfig::default()
            .read_buffer_size(LONGEST_MESSAGE)
            .max_message_size(Some(LONGEST_MESSAGE))
            .max_frame_size(Some(LONGEST_MESSAGE));
        let mut socket = WebSocket::from_raw_socket(from, Role::Server, Some(config));
        loop {
            match socket.read() {
                Ok(Message::Text(text)) => self.answer(Incoming::Text(text.as_str())),
                Ok(Message::Binary(bytes)) => self.answer(Incoming::Binary(&bytes)),
                Ok(_) => {}
                Err(tungstenite::Error::Capacity(_)) => {
                    let text = format!(
                        "a message has more than {LONGEST_MESSAGE} bytes, which this server does not take"
                    );
                    self.tell(&[&status(Level::Error, &text)]);
                    return self.end(1009, "message too long");
                }
                Err(tungstenite::Error::Protocol(_) | tungstenite::Error::Utf8(_)) => {
                    return self.end(1002, "protocol error");
                }
                Err(_) => return,
            }
        }
    }

    fn answer(&self, incoming: Incoming<'_>) {
        let mut state = self.lock();
        let State {
            session,
            channels,
            queue,
            ended,
            ..
        } = &mut *state;
        let answer = session.receive(channels, incoming);
        queue.cancel(&answer.cancelled);
        if let Some(status) = answer.status
            && !*ended
        {
            queue.push_text(&status);
            self.changed.notify_all();
            self.wait_for_room(state);
        }
    }

    /// Waits until the client has taken enough answers. The client that sends faster than it reads waits for itself.
    fn wait_for_room(&self, mut state: MutexGuard<'_, State>) {
        while state.queue.answers() >= MOST_ANSWERS && !state.gone && !state.written {
            state = self.wait(state);
        }
    }

    /// Writes what waits, until the connection ends.
    fn write(&self) {
        let mut out = Vec::new();
        while self.next_batch(&mut out) {
            if (&self.stream).write_all(&out).is_err() {
                self.cut();
                break;
            }
        }
        self.lock().written = true;
        self.changed.notify_all();
    }

    /// Waits for the next bytes to write. Returns whether there are any.
    fn next_batch(&self, out: &mut Vec<u8>) -> bool {
        out.clear();
        let mut state = self.lock();
        loop {
            if state.gone {
                return false;
            }
            while out.len() < BATCH && state.queue.pop(out) {}
            if out.is_empty()
                && let Some(frame) = state.ending.take()
            {
                *out = frame;
            }
            if !out.is_empty() {
                // There is room for answers.
                self.changed.notify_all();
                return true;
            }
            if state.ended {
                return false;
            }
            state = self.wait(state);
        }
    }
}

/// The connection as `tungstenite` sees it: it reads from the stream, and writes into the queue.
struct Connection {
    stream: TcpStream,
    client: Arc<Client>,
}

impl Read for Connection {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.stream.read(buffer)
    }
}

impl Write for Connection {
    fn write(&mut self, frames: &[u8]) -> io::Result<usize> {
        let mut state = self.client.lock();
        if state.gone || state.written {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        state.queue.push_frame(frames);
        self.client.changed.notify_all();
        self.client.wait_for_room(state);
        Ok(frames.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
