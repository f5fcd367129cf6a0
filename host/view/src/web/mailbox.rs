//! The messages that wait for a browser: at most one of each kind, so that a browser that takes nothing costs a bounded
//! memory.

use crate::door::Queue;
use host::live::{Folded, Frame, Message, Playback};
use std::collections::BTreeMap;
use tungstenite::Message as Packet;

/// Frames that a page has received and not confirmed, at most.
const UNCONFIRMED: u32 = 2;

/// A message on its way to a browser.
pub(super) struct Outgoing(Message);

impl From<Outgoing> for Packet {
    fn from(Outgoing(message): Outgoing) -> Self {
        let mut bytes = Vec::new();
        message.encode(&mut bytes);
        Self::binary(bytes)
    }
}

/// The mailbox of a browser.
#[derive(Default)]
pub(super) struct Mailbox {
    hello: Option<Message>,
    surfaces: BTreeMap<u32, Message>,
    history: Option<Message>,
    playback: Option<Box<Playback>>,
    frame: Option<Box<Frame>>,
    end: Option<Message>,
    unconfirmed: u32,
    dropped: u64,
}

impl Mailbox {
    /// Adds a message. A frame is merged into the frame that waits.
    pub(super) fn deliver(&mut self, message: &Message) {
        match message {
            Message::Hello(_) => {
                self.hello = Some(message.clone());
                self.surfaces.clear();
                (self.history, self.playback) = (None, None);
                (self.frame, self.end) = (None, None);
            }
            Message::Surface(surface) => {
                self.surfaces.insert(surface.body, message.clone());
            }
            Message::History(_) => {
                self.history = Some(message.clone());
                if let Some(frame) = &mut self.frame {
                    frame.folded = Folded::default();
                    frame.events.clear();
                }
            }
            Message::Playback(playback) => self.play(playback),
            Message::Frame(frame) => {
                if let Some(older) = self.frame.take() {
                    self.dropped += 1;
                    let mut later = frame.clone();
                    later.merge_before(*older);
                    // The frames that this mailbox drops are counted apart.
                    later.dropped = frame.dropped;
                    self.frame = Some(later);
                } else {
                    self.frame = Some(frame.clone());
                }
            }
            Message::End(_) | Message::Refused(_) => self.end = Some(message.clone()),
        }
    }

    /// Notes that the page has drawn a frame.
    pub(super) fn confirm(&mut self) {
        self.unconfirmed = self.unconfirmed.saturating_sub(1);
    }

    /// Keeps the events and the overview of a message that waits, if the later message has none.
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
}

impl Queue for Mailbox {
    type Item = Outgoing;

    fn pop(&mut self, closing: bool) -> Option<Outgoing> {
        let surface = |surfaces: &mut BTreeMap<u32, Message>| Some(surfaces.pop_first()?.1);
        let first = (self.hello.take())
            .or_else(|| surface(&mut self.surfaces))
            .or_else(|| self.history.take());
        if let Some(message) = first {
            return Some(Outgoing(message));
        }
        // While a frame waits for the page, the message of the playback waits with the frame.
        let held = self.unconfirmed >= UNCONFIRMED && self.frame.is_some();
        if !held {
            if let Some(playback) = self.playback.take() {
                return Some(Outgoing(Message::Playback(playback)));
            }
            if let Some(mut frame) = self.frame.take() {
                self.unconfirmed += 1;
                frame.dropped = frame.dropped.saturating_add(self.dropped);
                return Some(Outgoing(Message::Frame(frame)));
            }
        }
        self.end.take_if(|_| !held || closing).map(Outgoing)
    }
}
