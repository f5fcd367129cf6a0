//! The host's end of a subscription: takes a snapshot after a step if one is due.

use super::due::When;
use super::ring::{Missing, Policy, Reader, Writer, ring};
use super::{Contents, Known, Snapshot, Watchers};
use crate::engine::Engine;
use std::sync::Arc;
use std::time::Instant;

/// Buffers for viewers: one that the host fills, one that waits, and one that the reader has.
const VIEWED: usize = 3;

/// The host's end.
pub struct Subscriber {
    when: When,
    contents: Contents,
    /// By body.
    known: Vec<Known>,
    ring: Writer,
    missing: Arc<Missing>,
}

impl Subscriber {
    /// A subscriber to the steps of `engine`, which knows the bodies as they are now, with `buffers` buffers, and the end of
    /// its reader.
    pub fn new(
        engine: &Engine,
        when: When,
        contents: Contents,
        (policy, buffers): (Policy, usize),
    ) -> (Self, Reader) {
        let bodies = engine.bodies();
        let missing = Arc::<Missing>::default();
        let (ring, reader) = ring(policy, buffers, Arc::clone(&missing), || {
            Snapshot::with_room(bodies, contents)
        });
        let known = bodies.iter().map(|body| Known {
            epoch: body.body().epoch() as u32,
            edits: 0,
        });
        let subscriber = Self {
            when,
            contents,
            known: known.collect(),
            ring,
            missing,
        };
        (subscriber, reader)
    }

    /// A subscriber for viewers: a step that finds no buffer makes no snapshot, and copies are made only while there are
    /// `watchers`.
    pub fn watched(engine: &Engine, watchers: Watchers) -> (Self, Reader) {
        let when = When::watched(watchers);
        Self::new(engine, when, Contents::Surfaces, (Policy::Skip, VIEWED))
    }

    /// Takes a snapshot if one is due at `now`, after the step that was due at `time_ns`. `skipped` is the number of steps
    /// left out so far.
    pub fn after_step(&mut self, now: Instant, time_ns: u64, skipped: u64, engine: &Engine) {
        let Some(mut snapshot) = self.due(now, time_ns, engine) else {
            return;
        };
        let due = (time_ns, skipped);
        snapshot.take(engine, due, self.contents, &mut self.known);
        self.ring.send(snapshot);
    }

    /// The buffer for a snapshot that is due, with what depends on its time.
    fn due(&mut self, now: Instant, time_ns: u64, engine: &Engine) -> Option<Box<Snapshot>> {
        match &mut self.when {
            When::Series(schedule) => {
                let number = schedule.due(time_ns, &self.missing)?;
                let buffer = self.ring.buffer();
                if buffer.is_none() {
                    self.missing.count_unwritten();
                }
                let mut snapshot = buffer?;
                snapshot.number = number;
                Some(snapshot)
            }
            When::Watched(watched) => {
                let mut rate = watched.rate;
                if !watched.watchers.any() || !rate.is_due(now) {
                    return None;
                }
                // A snapshot that finds no buffer is made after a later step, as soon as there is a buffer.
                let mut snapshot = self.ring.buffer()?;
                watched.rate = rate;
                snapshot.host.medians = watched.medians.at(now, engine.stats());
                Some(snapshot)
            }
        }
    }
}
