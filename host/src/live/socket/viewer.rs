//! One viewer: the messages that it has received, and the next one. `Hello` comes first, then the surfaces and the frames.
//!
//! At most one message is under way to a viewer, and one frame waits. Later frames are merged into the frame that waits,
//! so a viewer that is slow or stopped costs two messages of memory, and loses no spike.

use super::super::frame::Frame;
use super::station::{Bytes, Shared, Station};
use rustix::io::Errno;
use rustix::net::{SendFlags, send};
use std::os::unix::net::UnixStream;
use std::rc::Rc;

/// A viewer that is connected.
pub(super) struct Viewer {
    pub(super) stream: UnixStream,
    greeted: bool,
    /// By body: the epoch of the surface that was sent.
    epochs: Vec<u32>,
    /// The message under way, and how many of its bytes are sent.
    under_way: Option<(Bytes, usize)>,
    waiting: Option<Waiting>,
    /// Whether a frame with all vertices was sent.
    has_vertices: bool,
    /// Frames that were merged into later ones.
    dropped: u64,
    ended: bool,
}

/// The frame that is sent next.
enum Waiting {
    /// As it came.
    Shared(Rc<Shared>),
    /// Several frames, and by body whether one of them has vertices.
    Merged(Box<Frame>, Vec<bool>),
}

/// Whether a viewer stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pumped {
    /// All messages so far are sent.
    Idle,
    /// The viewer does not take more at present.
    Blocked,
    /// The viewer is gone, or has received the end of the run.
    Gone,
}

impl Viewer {
    pub(super) fn new(stream: UnixStream) -> Self {
        Self {
            stream,
            greeted: false,
            epochs: Vec::new(),
            under_way: None,
            waiting: None,
            has_vertices: false,
            dropped: 0,
            ended: false,
        }
    }

    /// Whether a message is under way.
    pub(super) fn is_blocked(&self) -> bool {
        self.under_way.is_some()
    }

    /// Takes a frame that is to be sent.
    pub(super) fn offer(&mut self, next: &Rc<Shared>) {
        self.waiting = Some(match self.waiting.take() {
            None => Waiting::Shared(Rc::clone(next)),
            Some(waiting) => {
                let (older, mut moved) = match waiting {
                    Waiting::Shared(shared) => (shared.frame.clone(), shared.moved.clone()),
                    Waiting::Merged(frame, moved) => (*frame, moved),
                };
                let mut frame = Box::new(next.frame.clone());
                frame.merge_before(older);
                let later = moved.iter_mut().zip(&next.moved);
                later.for_each(|(moved, later)| *moved |= later);
                Waiting::Merged(frame, moved)
            }
        });
    }

    /// Sends until everything is sent or the viewer takes no more.
    pub(super) fn pump(&mut self, station: &Station) -> Pumped {
        loop {
            if self.under_way.is_none() {
                self.under_way = self.next(station).map(|bytes| (bytes, 0));
            }
            let Some((bytes, sent)) = &mut self.under_way else {
                return if self.ended {
                    Pumped::Gone
                } else {
                    Pumped::Idle
                };
            };
            let rest = bytes.get(*sent..).unwrap_or_default();
            match send(
                &self.stream,
                rest,
                SendFlags::DONTWAIT | SendFlags::NOSIGNAL,
            ) {
                Ok(count) => *sent += count,
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => return Pumped::Blocked,
                Err(_) => return Pumped::Gone,
            }
            if *sent >= bytes.len() {
                self.under_way = None;
            }
        }
    }

    /// The next message.
    fn next(&mut self, station: &Station) -> Option<Bytes> {
        if !self.greeted {
            self.greeted = true;
            return Some(station.hello());
        }
        // The frame that waits has the newest vertices, and so needs the newest surfaces.
        for body in 0.. {
            let Some((epoch, surface)) = station.surface(body) else {
                break;
            };
            match self.epochs.get_mut(body) {
                Some(sent) if *sent == epoch => continue,
                Some(sent) => *sent = epoch,
                None => self.epochs.push(epoch),
            }
            return Some(surface);
        }
        if let Some(waiting) = self.waiting.take() {
            return Some(self.encode(waiting, station));
        }
        let end = station.end().filter(|_| !self.ended)?;
        self.ended = true;
        Some(end)
    }

    fn encode(&mut self, waiting: Waiting, station: &Station) -> Bytes {
        let (mut frame, mut moved) = match waiting {
            Waiting::Shared(shared)
                if self.has_vertices && self.dropped + shared.frame.dropped == 0 =>
            {
                return station.shared(&shared);
            }
            Waiting::Shared(shared) => (Box::new(shared.frame.clone()), shared.moved.clone()),
            Waiting::Merged(frame, moved) => (frame, moved),
        };
        if !self.has_vertices {
            moved.fill(true);
            self.has_vertices = true;
        }
        self.dropped += frame.dropped;
        frame.dropped = self.dropped;
        station.encode(*frame, &moved)
    }
}
