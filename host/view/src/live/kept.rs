//! The messages of a run that a feed keeps for displays that join later.

use crate::history::History;
use host::live::{Folded, Frame, Hello, Message};
use host::record::Surface;
use std::collections::BTreeMap;

/// Length of the curves that are kept (s).
const KEPT: f64 = 60.0;

/// The present state of a run.
#[derive(Debug)]
pub(super) struct Kept {
    hello: Option<Box<Hello>>,
    /// By body.
    surfaces: BTreeMap<u32, Surface>,
    history: History,
    /// The last frame, with all vertices.
    frame: Option<Box<Frame>>,
    end: Option<String>,
}

impl Default for Kept {
    fn default() -> Self {
        Self {
            hello: None,
            surfaces: BTreeMap::new(),
            history: History::new(KEPT),
            frame: None,
            end: None,
        }
    }
}

impl Kept {
    /// The facts of the run, once they have come.
    pub(super) fn hello(&self) -> Option<&Hello> {
        self.hello.as_deref()
    }

    /// Takes a message of the run.
    pub(super) fn take(&mut self, message: &Message) {
        match message {
            Message::Hello(hello) => {
                *self = Self {
                    hello: Some(hello.clone()),
                    ..Self::default()
                };
            }
            Message::Surface(surface) => {
                self.surfaces.insert(surface.body, surface.clone());
            }
            Message::Frame(frame) => {
                self.history.push(&frame.folded);
                let mut next = frame.clone();
                // The messages of the log are only for those who were there.
                next.log.clear();
                let before = self.frame.take().map(|frame| frame.bodies);
                for (body, before) in next.bodies.iter_mut().zip(before.unwrap_or_default()) {
                    body.vertices = body.vertices.take().or(before.vertices);
                }
                self.frame = Some(next);
            }
            Message::History(pieces) => self.history.replace(pieces.clone()),
            Message::End(summary) => self.end = Some(summary.clone()),
            Message::Playback(_) | Message::Refused(_) => {}
        }
    }

    /// The messages that describe the present state.
    pub(super) fn present(&self) -> Vec<Message> {
        let hello = self.hello.clone().map(Message::Hello);
        let surfaces = self.surfaces.values().cloned().map(Message::Surface);
        let pieces: Vec<Folded> = self.history.pieces().cloned().collect();
        let history = hello.is_some().then_some(Message::History(pieces));
        // The curves of the frame are in the history.
        let frame = self.frame.clone().map(|mut frame| {
            frame.folded = Folded::default();
            Message::Frame(frame)
        });
        let end = self.end.clone().map(Message::End);
        let head = hello.into_iter().chain(surfaces).chain(history);
        head.chain(frame).chain(end).collect()
    }
}
