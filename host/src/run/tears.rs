//! The tears of a run as events: each edit of a sheet, passed from the host to the log, to viewers and to the summary.
//!
//! After a step, the host passes on the edits that the step made. The channels have room for all edits that the reserves
//! of the sheets allow, so the host never waits, drops nothing and allocates nothing. Bodies that do not tear have no
//! channel.

use crate::engine::body::HostBody;
use crate::record::TearEvent;
use physics::topology::NONE;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// The host's end.
#[derive(Default)]
pub struct TearSender {
    /// By body: the number of edits that have been passed on; `None` for a body that does not tear.
    known: Vec<Option<usize>>,
    /// By body: the number of pieces at the start.
    pieces: Vec<u32>,
    /// Those who listen.
    listeners: Vec<SyncSender<TearEvent>>,
    /// Edits that the reserves allow.
    room: usize,
}

impl TearSender {
    /// A sender for the sheets among `bodies` that tear; `None` if nothing tears.
    pub(super) fn new(bodies: &[HostBody]) -> Option<Self> {
        let mut room = 0;
        let known: Vec<_> = bodies
            .iter()
            .map(|body| {
                let surface = body.tears().and_then(|_| body.body().surface())?;
                // Every edit adds a vertex.
                room += surface.limits().vertices - surface.vertex_count();
                Some(0)
            })
            .collect();
        let pieces = bodies.iter().map(|body| {
            let tears = body.tears();
            tears.map_or(1, |tears| tears.pieces().count() as u32)
        });
        known.iter().any(Option::is_some).then(|| Self {
            known,
            pieces: pieces.collect(),
            listeners: Vec::new(),
            room,
        })
    }

    /// Which of the bodies tear.
    pub(super) fn tearing(&self) -> Vec<bool> {
        self.known.iter().map(Option::is_some).collect()
    }

    /// A further listener. It gets the edits from now on.
    pub(crate) fn listen(&mut self) -> TearEvents {
        let (sender, receiver) = sync_channel(self.room);
        self.listeners.push(sender);
        TearEvents {
            pieces: self.pieces.clone(),
            receiver: Some(receiver),
        }
    }

    /// Passes on the edits that the step made that was due at `time_ns` and has the number `step`.
    pub(super) fn after_step(&mut self, time_ns: u64, step: u64, bodies: &[HostBody]) {
        for ((index, known), body) in (0..).zip(&mut self.known).zip(bodies) {
            let (Some(known), Some(tears)) = (known, body.tears()) else {
                continue;
            };
            let grown = tears.tearing().grown();
            let newer = grown.get(*known..).unwrap_or_default();
            let body = body.body();
            for grown in newer {
                *known += 1;
                let at = |vertex: u32| body.rest_positions().get(vertex as usize).copied();
                let end = match grown.met {
                    [NONE, NONE] => grown.tips[0],
                    [NONE, met] | [met, _] => met,
                };
                let event = TearEvent {
                    body: index,
                    number: *known as u32,
                    step,
                    time_ns,
                    epoch: body.epoch() as u32,
                    from: grown.from,
                    at: at(grown.from).unwrap_or_default(),
                    end: at(end).unwrap_or_default(),
                    tips: grown.tips,
                    length: grown.length,
                    energy: grown.energy,
                    starts: grown.starts,
                    pieces: tears.pieces().count() as u32,
                };
                for listener in &self.listeners {
                    // There is room for all edits. It fails after the listener has ended.
                    let _ = listener.try_send(event);
                }
            }
        }
    }
}

/// The end of a listener. By default it hears nothing.
#[derive(Debug, Default)]
pub(crate) struct TearEvents {
    /// By body: the number of pieces.
    pieces: Vec<u32>,
    receiver: Option<Receiver<TearEvent>>,
}

impl TearEvents {
    /// The next edit, and what a person should hear of it in words.
    pub(crate) fn next(&mut self) -> Option<(TearEvent, Option<String>)> {
        let event = self.receiver.as_ref()?.try_recv().ok()?;
        let words = match self.pieces.get_mut(event.body as usize) {
            Some(before) => event.words(std::mem::replace(before, event.pieces)),
            None => None,
        };
        Some((event, words))
    }
}
