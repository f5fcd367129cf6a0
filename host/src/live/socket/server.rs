//! The thread that serves viewers.

use super::super::frame::{Frame, Hello, Vertices};
use super::super::message::Message;
use super::station::{Station, encode};
use super::viewer::{Pumped, Viewer};
use super::{Listener, SocketError};
use crate::record::Surface;
use crate::snapshot::Watchers;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::net::{SendFlags, send};
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Most viewers of a run.
pub const MOST_VIEWERS: usize = 8;
/// Updates that may wait for the thread.
const WAITING: usize = 4;
/// Longest time that the end of a run waits for viewers to take the last messages.
const FAREWELL: Duration = Duration::from_secs(1);
/// Time after which the thread accepts viewers again when the system had no file left.
const DEAF: Duration = Duration::from_millis(100);

/// News of the run.
#[derive(Debug)]
pub enum Update {
    /// A frame, and the surfaces of bodies that begin a topology epoch with it. The curves of the frame are those since
    /// the frame before.
    Frame(Vec<Surface>, Box<Frame>),
    /// The run ended: its summary as JSON.
    End(String),
}

/// Gives the thread updates and never waits.
#[derive(Clone, Debug)]
pub struct UpdateSender {
    updates: SyncSender<Update>,
    wake: Arc<UnixStream>,
}

impl UpdateSender {
    /// Gives the thread an update. Returns the update if the thread has not taken the updates before; drops the update if
    /// the thread has ended.
    pub fn try_send(&self, update: Update) -> Option<Update> {
        match self.updates.try_send(update) {
            Ok(()) | Err(TrySendError::Disconnected(_)) => {}
            Err(TrySendError::Full(update)) => return Some(update),
        }
        self.wake();
        None
    }

    fn wake(&self) {
        // A full pipe wakes the thread, too.
        let flags = SendFlags::DONTWAIT | SendFlags::NOSIGNAL;
        let _ = send(&*self.wake, &[1], flags);
    }
}

/// The thread, as its owner has it. Dropping it ends the thread without a farewell.
#[derive(Debug)]
pub struct Server {
    sender: UpdateSender,
    /// Whether the thread is to end at once.
    close: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Begins to serve viewers of a run. `surfaces` and `vertices` are by body, in the scene's order. The thread keeps
    /// `watchers` at the number of viewers.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(
        listener: Listener,
        hello: Hello,
        surfaces: Vec<Surface>,
        vertices: Vec<Vertices>,
        watchers: Watchers,
    ) -> Result<Self, SocketError> {
        let (updates, received) = sync_channel(WAITING);
        let (wake, woken) = UnixStream::pair().map_err(SocketError::Thread)?;
        woken.set_nonblocking(true).map_err(SocketError::Thread)?;
        let close = Arc::<AtomicBool>::default();
        let their_close = Arc::clone(&close);
        let thread = std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("palpate-view".into());
        let thread = thread.spawn(move || {
            let mut serving = Serving {
                station: Station::new(hello, surfaces, vertices),
                viewers: Vec::new(),
                watchers,
                listener,
                deaf: false,
                woken,
                updates: received,
                close: their_close,
                end: None,
            };
            serving.serve();
            serving.watchers.set(0);
        });
        Ok(Self {
            sender: UpdateSender {
                updates,
                wake: Arc::new(wake),
            },
            close,
            thread: Some(thread.map_err(SocketError::Thread)?),
        })
    }

    /// Gives the thread updates.
    pub fn sender(&self) -> UpdateSender {
        self.sender.clone()
    }

    /// Sends the last frame, if there is one, and the summary to all viewers, and ends the thread. Waits at most a second
    /// for viewers.
    pub fn finish(mut self, last: Option<Update>, summary: String) {
        for update in last.into_iter().chain([Update::End(summary)]) {
            // The thread takes its updates at once. It may have ended by a panic, which the hook has reported.
            let _ = self.sender.updates.send(update);
            self.sender.wake();
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.close.store(true, Ordering::Release);
        self.sender.wake();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The state of the thread.
struct Serving {
    station: Station,
    viewers: Vec<Viewer>,
    watchers: Watchers,
    listener: Listener,
    /// Whether viewers are not accepted for a moment.
    deaf: bool,
    woken: UnixStream,
    updates: Receiver<Update>,
    close: Arc<AtomicBool>,
    /// When the farewell is over, after the end of the run.
    end: Option<Instant>,
}

impl Serving {
    fn serve(&mut self) {
        while !self.close.load(Ordering::Acquire) {
            let Some(ready) = self.wait() else {
                return;
            };
            self.deaf = false;
            self.take_updates();
            if ready.new_viewer {
                self.accept();
                // Before a viewer has received its first message, so that its first frame comes soon.
                self.watchers.set(self.viewers.len());
            }
            let (station, mut index) = (&self.station, 0);
            self.viewers.retain_mut(|viewer| {
                let hung_up = ready.hung_up.get(index).is_some_and(|hung_up| *hung_up);
                index += 1;
                !hung_up && viewer.pump(station) != Pumped::Gone
            });
            self.watchers.set(self.viewers.len());
            let late = self.end.is_some_and(|end| Instant::now() >= end);
            if late || (self.end.is_some() && self.viewers.is_empty()) {
                return;
            }
        }
    }

    /// Waits until there is something to do; `None` if the system cannot say.
    fn wait(&mut self) -> Option<Ready> {
        let mut files = vec![PollFd::new(&self.woken, PollFlags::IN)];
        // A viewer that hangs up is always reported.
        files.extend(self.viewers.iter().map(|viewer| {
            let flags = if viewer.is_blocked() {
                PollFlags::OUT
            } else {
                PollFlags::empty()
            };
            PollFd::new(&viewer.stream, flags)
        }));
        if !self.deaf && self.end.is_none() {
            files.push(PollFd::new(&self.listener, PollFlags::IN));
        }
        let left = self
            .end
            .map(|end| end.saturating_duration_since(Instant::now()));
        let left = left.or(self.deaf.then_some(DEAF));
        let left = left.map(|left| Timespec {
            tv_sec: left.as_secs() as i64,
            tv_nsec: i64::from(left.subsec_nanos()),
        });
        match poll(&mut files, left.as_ref()) {
            Ok(_) | Err(rustix::io::Errno::INTR) => {}
            Err(_) => return None,
        }
        let events: Vec<_> = files.iter().map(PollFd::revents).collect();
        let count = self.viewers.len();
        let broken = PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL;
        let viewers = events.iter().skip(1).take(count);
        Some(Ready {
            hung_up: viewers.map(|event| event.intersects(broken)).collect(),
            new_viewer: events.get(1 + count).is_some_and(|event| !event.is_empty()),
        })
    }

    fn take_updates(&mut self) {
        let mut bytes = [0; 64];
        while self.woken.read(&mut bytes).is_ok_and(|count| count > 0) {}
        loop {
            match self.updates.try_recv() {
                Ok(Update::Frame(surfaces, frame)) => {
                    let shared = self.station.take(surfaces, *frame);
                    self.viewers
                        .iter_mut()
                        .for_each(|viewer| viewer.offer(&shared));
                }
                Ok(Update::End(summary)) => {
                    self.station.set_end(summary);
                    self.end = Some(Instant::now() + FAREWELL);
                }
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => return,
            }
        }
    }

    /// Accepts the viewers that wait, and refuses those beyond [`MOST_VIEWERS`].
    fn accept(&mut self) {
        loop {
            match self.listener.accept() {
                Ok(Some(stream)) if self.viewers.len() < MOST_VIEWERS => {
                    self.viewers.push(Viewer::new(stream));
                }
                Ok(Some(stream)) => {
                    let why = format!(
                        "{MOST_VIEWERS} viewers watch this run already, and a run has no more; close one of them"
                    );
                    let refusal = encode(&Message::Refused(why));
                    // The buffer of a new connection has room for this message.
                    let flags = SendFlags::DONTWAIT | SendFlags::NOSIGNAL;
                    let _ = send(&stream, &refusal, flags);
                }
                Ok(None) => return,
                Err(_) => {
                    self.deaf = true;
                    return;
                }
            }
        }
    }
}

/// What poll reported.
struct Ready {
    /// By viewer.
    hung_up: Vec<bool>,
    new_viewer: bool,
}
