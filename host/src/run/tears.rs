//! The tears of a run as events: each edit of a sheet, passed from the host to the log, to viewers and to the summary.
//!
//! After a step, the host passes on the edits that the step made. The channels have room for all edits that the reserves
//! of the sheets allow, so the host never waits, drops nothing and allocates nothing. Bodies that do not tear have no
//! channel.

use crate::engine::body::HostBody;
use physics::Vec3;
use physics::topology::{NONE, Pieces};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// An edit by which a tear of a body grew.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TearEvent {
    /// Index of the body.
    pub body: u32,
    /// Number of the edit in the body, from one.
    pub number: u32,
    /// Number of the host step, from one.
    pub step: u64,
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// Topology epoch after the step.
    pub epoch: u32,
    /// The vertex from which the tear grew.
    pub from: u32,
    /// Position of that vertex at rest (m).
    pub at: Vec3,
    /// The new tip, and that of the growth to the other side; `u32::MAX` where there is none.
    pub tips: [u32; 2],
    /// Length of the opened edges at rest (m).
    pub length: f64,
    /// The energy that the opened edges take (J).
    pub energy: f64,
    /// Whether the tear starts with this edit.
    pub starts: bool,
    /// Number of pieces of the sheet after the step.
    pub pieces: u32,
}

impl TearEvent {
    /// What a person should hear of, in words; `None` for an edit by which a tear only goes on. `pieces` is the number of
    /// pieces before.
    pub fn words(&self, pieces: u32) -> Option<String> {
        let [x, y, z] = [self.at.x, self.at.y, self.at.z].map(|x| 1e3 * x);
        let at = format!("at x {x:.1}, y {y:.1}, z {z:.1} mm at rest");
        if self.pieces > pieces {
            Some(format!("the sheet came apart {at}: {} pieces", self.pieces))
        } else if self.tips[0] == NONE {
            Some(format!("a tear reached a border {at}"))
        } else if self.starts {
            Some(format!("a tear started {at}"))
        } else {
            None
        }
    }
}

/// The host's end.
#[derive(Default)]
pub struct TearTap {
    /// By body: what is known of a sheet that tears; `None` for any other body.
    known: Vec<Option<Known>>,
    /// Those who listen.
    listeners: Vec<SyncSender<TearEvent>>,
    /// Edits that the reserves allow.
    room: usize,
}

/// What has been passed on of a sheet.
struct Known {
    /// Number of edits.
    edits: usize,
    pieces: Pieces,
}

impl TearTap {
    /// A tap for the sheets among `bodies` that tear; `None` where nothing tears.
    pub(super) fn new(bodies: &[HostBody]) -> Option<Self> {
        let mut room = 0;
        let known: Vec<_> = bodies
            .iter()
            .map(|body| {
                let surface = body.tears().and_then(|_| body.body().surface())?;
                // Every edit adds a vertex.
                room += surface.limits().vertices - surface.vertex_count();
                Some(Known {
                    edits: 0,
                    pieces: Pieces::new(surface),
                })
            })
            .collect();
        known.iter().any(Option::is_some).then(|| Self {
            known,
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
        let pieces = self.known.iter().map(|known| {
            let known = known.as_ref();
            known.map_or(1, |known| known.pieces.count() as u32)
        });
        TearEvents {
            pieces: pieces.collect(),
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
            let Some(newer) = grown.get(known.edits..).filter(|newer| !newer.is_empty()) else {
                continue;
            };
            let body = body.body();
            if let Some(surface) = body.surface()
                && newer.iter().any(|grown| grown.parted)
            {
                known.pieces.find(surface);
            }
            for grown in newer {
                known.edits += 1;
                let event = TearEvent {
                    body: index,
                    number: known.edits as u32,
                    step,
                    time_ns,
                    epoch: body.epoch() as u32,
                    from: grown.from,
                    at: (body.rest_positions().get(grown.from as usize))
                        .copied()
                        .unwrap_or_default(),
                    tips: grown.tips,
                    length: grown.length,
                    energy: grown.energy,
                    starts: grown.starts,
                    pieces: known.pieces.count() as u32,
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
