//! The contacts of each host step, passed from the host to the observers of a run.
//!
//! The host fills a free buffer and sends it; the observers' end gives it back. The host never waits: without a free buffer
//! the step is counted as missing. Two channels carry the buffers, as for snapshots (`snapshot/ring.rs`). A run has them
//! only if something may touch, and if an output has contacts.

use crate::engine::Engine;
use crate::record::contact::{ContactPoint, ContactStep, ContactSum, MOST_POINTS};
use crate::scene::Scene;
use physics::motion::contacts::{Contacts, Side};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

/// Time that a listener may take between two looks (s): ten periods of the log's thread under the real clock.
const PATIENCE: f64 = 0.2;
/// Least number of buffers of a listener.
const WAITING: usize = 8;

/// The host's end.
pub struct ContactSender {
    /// The number in records of each side of the physics.
    numbers: Vec<u32>,
    filled: SyncSender<Box<ContactStep>>,
    free: Receiver<Box<ContactStep>>,
    missing: Arc<AtomicU64>,
    /// All contacts of a step: size of the force (N), number, contact. The buffer is kept for its capacity.
    all: Vec<(f64, usize, ContactPoint)>,
}

/// Where the observers receive buffers, and where they give the buffers back.
type Ends = (Receiver<Box<ContactStep>>, SyncSender<Box<ContactStep>>);

/// The end of the observers. By default it hears nothing.
#[derive(Default)]
pub(super) struct ContactSteps {
    ends: Option<Ends>,
    /// Steps whose ticks have not come.
    early: VecDeque<Box<ContactStep>>,
    missing: Arc<AtomicU64>,
}

/// The two ends for the contacts of `engine`; `None` if nothing touches.
pub(super) fn channel(scene: &Scene, engine: &Engine) -> Option<(ContactSender, ContactSteps)> {
    let sides = engine.contact()?.contacts().sides();
    let number = |side: &Side| match side {
        Side::Body(body) => *body as u32,
        Side::Obstacle(obstacle) => (scene.bodies.len() + obstacle) as u32,
    };
    let buffers = WAITING.max((PATIENCE * scene.host.step_rate) as usize);
    let (filled, to_read) = sync_channel(buffers);
    let (returned, free) = sync_channel(buffers);
    for _ in 0..buffers {
        let step = ContactStep {
            sums: Vec::with_capacity(sides.len() * (sides.len() + 1) / 2),
            points: Vec::with_capacity(MOST_POINTS),
            ..ContactStep::default()
        };
        // The channel has as many places.
        let _ = returned.try_send(Box::new(step));
    }
    let missing = Arc::<AtomicU64>::default();
    let sender = ContactSender {
        numbers: sides.iter().map(number).collect(),
        filled,
        free,
        missing: Arc::clone(&missing),
        all: Vec::new(),
    };
    let steps = ContactSteps {
        ends: Some((to_read, returned)),
        early: VecDeque::new(),
        missing,
    };
    Some((sender, steps))
}

impl ContactSender {
    /// Passes on the contacts of the step that was due at `time_ns` and has the number `step`.
    pub(super) fn after_step(&mut self, time_ns: u64, step: u64, contacts: &Contacts) {
        let Ok(mut record) = self.free.try_recv() else {
            // Relaxed: no other memory depends on this number.
            self.missing.fetch_add(1, Ordering::Relaxed);
            return;
        };
        (record.step, record.time_ns) = (step, time_ns);
        record.sums.clear();
        let sums = contacts.touching().iter().map(|found| ContactSum {
            sides: found.sides.map(|side| self.numbers[side]),
            count: found.count as u32,
            slipping: found.slipping as u32,
            normal: found.normal,
            friction: found.friction,
            force: found.force,
            depth: found.depth,
        });
        record.sums.extend(sums);
        // The physics has the obstacles that are meshes before the others.
        record.sums.sort_unstable_by_key(|sum| sum.sides);
        self.find_strongest(contacts);
        record.points.clear();
        (record.points).extend(self.all.iter().map(|(_, _, point)| *point));
        // There are as many places as buffers. It fails after the observers have ended.
        let _ = self.filled.try_send(record);
    }

    /// Finds the contacts with the largest forces, in the order of the physics.
    fn find_strongest(&mut self, contacts: &Contacts) {
        self.all.clear();
        let numbers = &self.numbers;
        let points = contacts.points().enumerate();
        self.all.extend(points.map(|(number, (sides, at, touch))| {
            let force = touch.force();
            let point = ContactPoint {
                sides: sides.map(|side| numbers[side]),
                at,
                force,
                depth: (-touch.response.gap).max(0.0),
            };
            (force.norm(), number, point)
        }));
        if self.all.len() > MOST_POINTS {
            let stronger = |a: &(f64, usize, _), b: &(f64, usize, _)| {
                b.0.total_cmp(&a.0).then_with(|| a.1.cmp(&b.1))
            };
            self.all.select_nth_unstable_by(MOST_POINTS - 1, stronger);
            self.all.truncate(MOST_POINTS);
            self.all.sort_unstable_by_key(|(_, number, _)| *number);
        }
    }
}

impl ContactSteps {
    /// Gives `take` the steps that came and were due until `now_ns`, in order. Under the real clock a step may come before the
    /// records of the ticks until then.
    pub(super) fn until(&mut self, now_ns: u64, mut take: impl FnMut(&mut ContactStep)) {
        let Some((filled, free)) = &self.ends else {
            return;
        };
        self.early.extend(filled.try_iter());
        while self
            .early
            .front()
            .is_some_and(|step| step.time_ns <= now_ns)
        {
            if let Some(mut step) = self.early.pop_front() {
                take(&mut step);
                // It fails after the host has ended.
                let _ = free.try_send(step);
            }
        }
    }

    /// Number of steps for which no buffer was free.
    pub(super) fn missing(&self) -> u64 {
        self.missing.load(Ordering::Relaxed)
    }
}
