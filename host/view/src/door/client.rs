//! A client with a WebSocket: one thread reads its messages, and another writes what waits for it.
//!
//! Only the second thread writes to the socket. What the protocol answers while the first thread reads, such as a pong,
//! waits with the other answers.

use super::Times;
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tungstenite::protocol::{CloseFrame, Role, WebSocketConfig};
use tungstenite::{Error, Message as Packet, WebSocket};

/// Longest message of a client (bytes).
const LONGEST: usize = 64 << 10;
/// Answers that wait for a client, at most.
const ANSWERS: usize = 64;

/// The messages that wait for one client in addition to the answers, by the policy of the service.
pub(crate) trait Queue: Send + 'static {
    /// A message, which becomes a packet without the lock of the queue.
    type Item: Into<Packet>;

    /// Removes what is sent next; `None` if nothing may be sent now. `closing`: nothing is added any more, and the
    /// connection ends after the last item.
    fn pop(&mut self, closing: bool) -> Option<Self::Item>;
}

/// A client.
pub(crate) struct Client<Q> {
    /// The number of the client, which no other client has.
    pub(crate) number: u64,
    state: Mutex<State<Q>>,
    changed: Condvar,
    stream: TcpStream,
    times: Times,
}

struct State<Q> {
    queue: Q,
    /// Texts and the answers of the protocol. They go first.
    answers: VecDeque<Packet>,
    /// The last packet, after everything that waits.
    last: Option<Packet>,
    /// Nothing more is added.
    closing: bool,
    /// The thread that reads has ended.
    is_read: bool,
    /// The connection is gone.
    gone: bool,
}

impl<Q: Queue> Client<Q> {
    pub(super) fn new(stream: TcpStream, queue: Q, times: Times) -> Self {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        Self {
            number: NUMBER.fetch_add(1, Ordering::Relaxed),
            state: Mutex::new(State {
                queue,
                answers: VecDeque::new(),
                last: None,
                closing: false,
                is_read: false,
                gone: false,
            }),
            changed: Condvar::new(),
            stream,
            times,
        }
    }

    /// A thread that panicked leaves the state as it is: each change of the state is complete in itself.
    fn lock(&self) -> MutexGuard<'_, State<Q>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the queue; `None` if the connection ends.
    pub(crate) fn with<T>(&self, change: impl FnOnce(&mut Q) -> T) -> Option<T> {
        let mut state = self.lock();
        let changed = (!state.closing).then(|| change(&mut state.queue));
        self.changed.notify_all();
        changed
    }

    /// Sends a text, before everything in the queue.
    pub(crate) fn tell(&self, text: impl Into<String>) {
        self.answer(Packet::text(text.into()));
    }

    fn answer(&self, packet: Packet) {
        let mut state = self.lock();
        if !state.closing {
            state.answers.push_back(packet);
            self.changed.notify_all();
        }
    }

    /// Ends the connection when everything that waits is sent: with a code of RFC 6455, section 7.4, and a reason of at
    /// most 123 bytes.
    pub(crate) fn close(&self, code: u16, reason: &str) {
        self.end(Some(CloseFrame {
            code: code.into(),
            reason: reason.into(),
        }));
    }

    fn end(&self, frame: Option<CloseFrame>) {
        let mut state = self.lock();
        if !state.closing {
            state.closing = true;
            state.last = Some(Packet::Close(frame));
            self.changed.notify_all();
        }
    }

    /// Ends the connection at once.
    pub(super) fn cut(&self) {
        let mut state = self.lock();
        (state.closing, state.gone) = (true, true);
        // A connection that is gone needs no end.
        let _ = self.stream.shutdown(Shutdown::Both);
        self.changed.notify_all();
    }

    /// Waits until the connection is gone, at most for `longest`.
    pub(super) fn wait_until_gone(&self, longest: Duration) {
        let waits = |state: &mut State<Q>| !state.gone;
        drop(self.changed.wait_timeout_while(self.lock(), longest, waits));
    }

    /// Serves the client until it leaves or is sent away. `take` receives the texts and the binary messages.
    pub(super) fn serve(self: &Arc<Self>, take: impl Fn(&Packet)) {
        let set = self
            .stream
            .set_read_timeout(None)
            .and_then(|()| self.stream.set_write_timeout(Some(self.times.taking)));
        let written = Arc::clone(self);
        let writer = set.and_then(|()| super::thread("view-write", move || written.write()));
        let Ok(writer) = writer else {
            return self.cut();
        };
        let frame = self.read(take);
        self.end(frame);
        self.lock().is_read = true;
        self.changed.notify_all();
        self.wait_until_gone(self.times.parting);
        self.cut();
        // The thread has nothing to return, and its panic has been printed.
        let _ = writer.join();
    }

    /// Reads messages until the connection ends. Returns the answer to the end.
    fn read(&self, take: impl Fn(&Packet)) -> Option<CloseFrame> {
        let config = WebSocketConfig::default()
            .read_buffer_size(4096)
            .max_message_size(Some(LONGEST))
            .max_frame_size(Some(LONGEST));
        let half = ReadHalf(&self.stream);
        let mut socket = WebSocket::from_raw_socket(half, Role::Server, Some(config));
        let (code, reason) = loop {
            match socket.read() {
                Ok(Packet::Ping(bytes)) => self.answer(Packet::Pong(bytes)),
                Ok(Packet::Close(frame)) => return frame,
                Ok(message @ (Packet::Text(_) | Packet::Binary(_))) => take(&message),
                Ok(_) => {}
                Err(Error::Capacity(_)) => {
                    let line = format!(
                        "A message has more than {LONGEST} bytes, which this server does not take."
                    );
                    break (1009, line);
                }
                Err(_) => break (1002, "The bytes are no message of a WebSocket.".into()),
            }
            // A client that sends faster than it reads waits for itself.
            let waits = |state: &mut State<Q>| state.answers.len() >= ANSWERS && !state.gone;
            drop(self.changed.wait_while(self.lock(), waits));
        };
        let (code, reason) = (code.into(), reason.into());
        Some(CloseFrame { code, reason })
    }

    /// Writes what waits until the connection ends. Then a client that reads everything takes its leave.
    fn write(&self) {
        if self.write_all().is_ok() {
            let waits = |state: &mut State<Q>| !state.is_read && !state.gone;
            let parting = self.times.parting;
            drop(self.changed.wait_timeout_while(self.lock(), parting, waits));
        }
        self.cut();
    }

    fn write_all(&self) -> tungstenite::Result<()> {
        let mut socket = WebSocket::from_raw_socket(&self.stream, Role::Server, None);
        // What waits together goes in few calls of the system.
        let mut flushed = true;
        loop {
            match self.next(flushed) {
                Some(packet) => {
                    socket.write(packet)?;
                    flushed = false;
                }
                None if flushed => return Ok(()),
                None => {
                    // After a packet that ends the connection, `tungstenite` says by an error that there is no more.
                    match socket.flush() {
                        Ok(()) | Err(Error::ConnectionClosed) => flushed = true,
                        Err(error) => return Err(error),
                    }
                }
            }
        }
    }

    /// What is written next. `None` if nothing waits; if `patient`, only if the connection ends.
    fn next(&self, patient: bool) -> Option<Packet> {
        let mut state = self.lock();
        loop {
            if state.gone {
                return None;
            }
            if let Some(packet) = state.answers.pop_front() {
                // There is room for answers.
                self.changed.notify_all();
                return Some(packet);
            }
            let closing = state.closing;
            if let Some(item) = state.queue.pop(closing) {
                drop(state);
                return Some(item.into());
            }
            if closing || !patient {
                return state.last.take();
            }
            let changed = self.changed.wait(state);
            state = changed.unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// The half of a socket that is read. What the protocol would write is dropped: the thread that reads answers itself.
struct ReadHalf<'a>(&'a TcpStream);

impl Read for ReadHalf<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        (&mut &*self.0).read(buffer)
    }
}

impl Write for ReadHalf<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
