//! What waits for a browser: of everything at most one, so that a browser that takes nothing costs a bounded memory.

use super::merge;
use host::live::{Frame, Message, Playback};
use std::collections::BTreeMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Frames that a page has received and not confirmed, at most.
const UNCONFIRMED: u32 = 2;
/// Longest answers to pings that wait (bytes). A browser that sends more pings than it takes answers is disconnected.
const CONTROL: usize = 16 * 1024;

/// What the thread of a connection sends next.
pub(super) enum Outgoing {
    /// Bytes of the WebSocket protocol, such as the answer to a ping.
    Control(Vec<u8>),
    /// A line of text.
    Line(String),
    /// A message.
    Message(Message),
    /// The end: the code of RFC 6455, section 7.4, and the reason.
    Close(u16, &'static str),
}

/// The mailbox of a browser.
#[derive(Default)]
pub(super) struct Mailbox {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    control: Vec<u8>,
    line: Option<String>,
    hello: Option<Message>,
    surfaces: BTreeMap<u32, Message>,
    history: Option<Message>,
    playback: Option<Box<Playback>>,
    frame: Option<Box<Frame>>,
    end: Option<Message>,
    unconfirmed: u32,
    dropped: u64,
    closing: Option<(u16, &'static str)>,
    closed: bool,
}

impl Mailbox {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a message. A frame is merged into the frame that waits.
    pub(super) fn deliver(&self, message: &Message) {
        let mut waiting = self.lock();
        match message {
            Message::Hello(_) => {
                waiting.hello = Some(message.clone());
                waiting.surfaces.clear();
                (waiting.history, waiting.playback) = (None, None);
                (waiting.frame, waiting.end) = (None, None);
            }
            Message::Surface(surface) => {
                waiting.surfaces.insert(surface.body, message.clone());
            }
            Message::History(_) => {
                waiting.history = Some(message.clone());
                if let Some(frame) = &mut waiting.frame {
                    frame.folded = Default::default();
                    frame.events.clear();
                }
            }
            Message::Playback(playback) => waiting.play(playback),
            Message::Frame(frame) => {
                if let Some(older) = waiting.frame.take() {
                    waiting.dropped += 1;
                    waiting.frame = Some(Box::new(merge::frames(*older, frame)));
                } else {
                    waiting.frame = Some(frame.clone());
                }
            }
            Message::End(_) | Message::Refused(_) => waiting.end = Some(message.clone()),
        }
        self.changed.notify_all();
    }

    /// Notes that the page has drawn a frame.
    pub(super) fn confirm(&self) {
        let mut waiting = self.lock();
        waiting.unconfirmed = waiting.unconfirmed.saturating_sub(1);
        self.changed.notify_all();
    }

    /// Replaces the line that waits.
    pub(super) fn say(&self, line: String) {
        self.lock().line = Some(line);
        self.changed.notify_all();
    }

    /// Adds bytes of the protocol; `false` if too many wait.
    pub(super) fn control(&self, bytes: &[u8]) -> bool {
        let mut waiting = self.lock();
        let fits = waiting.control.len() + bytes.len() <= CONTROL;
        if fits {
            waiting.control.extend(bytes);
            self.changed.notify_all();
        }
        fits
    }

    /// Ends the connection, after a message of the end if one waits.
    pub(super) fn close(&self, code: u16, reason: &'static str) {
        self.lock().closing.get_or_insert((code, reason));
        self.changed.notify_all();
    }

    /// Notes that the connection has ended.
    pub(super) fn has_closed(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Waits until the connection has ended, at most for `longest`.
    pub(super) fn wait_until_closed(&self, longest: Duration) {
        let open = |waiting: &mut Waiting| !waiting.closed;
        drop(self.changed.wait_timeout_while(self.lock(), longest, open));
    }

    /// Waits for the next thing to send; `None` when the connection has ended.
    pub(super) fn next(&self) -> Option<Outgoing> {
        let mut waiting = self.lock();
        loop {
            if waiting.closed {
                return None;
            }
            if let Some(next) = waiting.next() {
                return Some(next);
            }
            let changed = self.changed.wait(waiting);
            waiting = changed.unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Waiting {
    /// Keeps the events and the overview of a message that waits, where the later message has none.
    fn play(&mut self, later: &Playback) {
        let mut later = Box::new(later.clone());
        if let Some(older) = self.playback.take() {
            if later.events.is_empty() {
                later.events = older.events;
            }
            if later.overview.is_empty() {
                later.overview = older.overview;
            }
        }
        self.playback = Some(later);
    }

    fn next(&mut self) -> Option<Outgoing> {
        if !self.control.is_empty() {
            return Some(Outgoing::Control(std::mem::take(&mut self.control)));
        }
        if let Some(line) = self.line.take() {
            return Some(Outgoing::Line(line));
        }
        if let Some(hello) = self.hello.take() {
            return Some(Outgoing::Message(hello));
        }
        if let Some((_, surface)) = self.surfaces.pop_first() {
            return Some(Outgoing::Message(surface));
        }
        if let Some(history) = self.history.take() {
            return Some(Outgoing::Message(history));
        }
        // While a frame waits for the page, the message of the playback waits with the frame.
        let held = self.unconfirmed >= UNCONFIRMED && self.frame.is_some();
        if !held {
            if let Some(playback) = self.playback.take() {
                return Some(Outgoing::Message(Message::Playback(playback)));
            }
            if let Some(mut frame) = self.frame.take() {
                self.unconfirmed += 1;
                frame.dropped = frame.dropped.saturating_add(self.dropped);
                return Some(Outgoing::Message(Message::Frame(frame)));
            }
        }
        if let Some(end) = self.end.take_if(|_| !held || self.closing.is_some()) {
            return Some(Outgoing::Message(end));
        }
        self.closing
            .map(|(code, reason)| Outgoing::Close(code, reason))
    }
}
