//! The ring of buffers between the host and a subscriber's reader.
//!
//! The host fills a free buffer and sends it; the reader gives it back. Two channels carry the buffers, which have their
//! memory from the start, so that a step with a free buffer neither waits nor allocates. No thread of the tick takes part,
//! and two of the three rules are not wait-free by their meaning: one waits for the reader, and one makes buffers without
//! bound. The channels are therefore those of the standard library, which can do both.

use super::Snapshot;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};

/// The rule for a snapshot that is due while no buffer is free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// It waits for the reader.
    Wait,
    /// It leaves the snapshot out, and counts it as missing.
    Skip,
    /// It makes a further buffer.
    Grow,
}

/// The snapshots that a subscriber lacks, by reason. Relaxed: the counts are read after the host's thread has ended.
#[derive(Debug, Default)]
pub struct Missing {
    unwritten: AtomicU64,
    skipped: AtomicU64,
}

impl Missing {
    /// No buffer was free.
    pub(super) fn count_unwritten(&self) {
        self.unwritten.fetch_add(1, Ordering::Relaxed);
    }

    /// The host made no step in the time of the snapshot.
    pub(super) fn count_skipped(&self) {
        self.skipped.fetch_add(1, Ordering::Relaxed);
    }

    /// The numbers of snapshots for which no buffer was free, and for which the host made no step.
    pub fn counts(&self) -> [u64; 2] {
        [&self.unwritten, &self.skipped].map(|count| count.load(Ordering::Relaxed))
    }
}

/// The way of a filled buffer: bounded, unless the ring grows.
enum Filled {
    Bounded(SyncSender<Box<Snapshot>>),
    Unbounded(Sender<Box<Snapshot>>),
}

/// The host's end.
pub(super) struct Writer {
    policy: Policy,
    filled: Filled,
    free: Receiver<Box<Snapshot>>,
}

/// The reader's end.
#[derive(Debug)]
pub struct Reader {
    filled: Receiver<Box<Snapshot>>,
    free: SyncSender<Box<Snapshot>>,
    missing: Arc<Missing>,
}

/// A ring of `count` buffers that `make` makes. The subscriber counts in `missing`.
pub(super) fn ring(
    policy: Policy,
    count: usize,
    missing: Arc<Missing>,
    make: impl Fn() -> Snapshot,
) -> (Writer, Reader) {
    let (filled, to_read) = if policy == Policy::Grow {
        let (filled, to_read) = channel();
        (Filled::Unbounded(filled), to_read)
    } else {
        let (filled, to_read) = sync_channel(count);
        (Filled::Bounded(filled), to_read)
    };
    let (returned, free) = sync_channel(count);
    for _ in 0..count {
        // The channel has as many places.
        let _ = returned.try_send(Box::new(make()));
    }
    let writer = Writer {
        policy,
        filled,
        free,
    };
    let reader = Reader {
        filled: to_read,
        free: returned,
        missing,
    };
    (writer, reader)
}

impl Writer {
    /// A buffer to fill. `None` if none is free, or if a reader for whom the host waits has ended.
    pub(super) fn buffer(&self) -> Option<Box<Snapshot>> {
        match self.policy {
            Policy::Wait => self.free.recv().ok(),
            Policy::Skip => self.free.try_recv().ok(),
            Policy::Grow => Some(self.free.try_recv().unwrap_or_default()),
        }
    }

    /// Sends a filled buffer.
    pub(super) fn send(&self, snapshot: Box<Snapshot>) {
        // There are as many places as buffers, so that this never waits. It fails after the reader has ended.
        match &self.filled {
            Filled::Bounded(filled) => drop(filled.try_send(snapshot)),
            Filled::Unbounded(filled) => drop(filled.send(snapshot)),
        }
    }
}

impl Reader {
    /// The next snapshot, in order; waits for it. `None` after the host's end was dropped.
    pub fn wait(&mut self) -> Option<Box<Snapshot>> {
        self.filled.recv().ok()
    }

    /// The next snapshot, in order, if one has come.
    pub fn try_next(&mut self) -> Option<Box<Snapshot>> {
        self.filled.try_recv().ok()
    }

    /// The newest snapshot, if one has come since the last call, with the newest mesh and surface of each body among the
    /// snapshots passed over.
    pub fn newest(&mut self) -> Option<Box<Snapshot>> {
        let mut newest = self.try_next()?;
        while let Some(mut next) = self.try_next() {
            for (next, before) in next.bodies.iter_mut().zip(&mut newest.bodies) {
                let changed = before.changed.take();
                next.changed = next.changed.take().or(changed);
                next.torn.merge_before(&mut before.torn);
            }
            self.give_back(newest);
            newest = next;
        }
        Some(newest)
    }

    /// Gives a buffer back to the host.
    pub fn give_back(&mut self, mut snapshot: Box<Snapshot>) {
        for body in &mut snapshot.bodies {
            // The host frees no mesh.
            body.changed = None;
        }
        // It fails after the host has ended, and for a buffer more than at the start.
        let _ = self.free.try_send(snapshot);
    }

    /// The snapshots that are missing.
    pub fn missing(&self) -> &Arc<Missing> {
        &self.missing
    }
}
