//! The slot through which the host hands over the positions of all bodies.
//!
//! After a step, the host copies the positions into a free buffer and hands the buffer over; the reader gives the buffer
//! back. Two wait-free rings carry the buffers. The host never waits: without a free buffer it makes no copy. The host
//! copies only while a viewer is connected, and at most sixty times a second of the wall clock. Nothing of this enters
//! the state of the run.

use super::connectivity::mesh_of;
use super::frame::{HostState, Vertices};
use super::rate::Rate;
use super::torn::{TornSurface, vertex_room};
use crate::engine::Engine;
use crate::engine::body::HostBody;
use crate::engine::stats::EngineStats;
use physics::Body;
use physics::mesh::Mesh;
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Buffers: one that the host fills, one that waits, and one that the reader has.
const BUFFERS: usize = 3;
/// Time from one computation of a median to the next. A median costs some 30 µs.
const MEDIAN_PERIOD: Duration = Duration::from_millis(333);

/// Number of viewers. The host reads this number after each step.
#[derive(Clone, Debug, Default)]
pub struct Watchers(Arc<AtomicUsize>);

impl Watchers {
    /// Sets the number.
    pub fn set(&self, count: usize) {
        // Relaxed: no other memory depends on this number.
        self.0.store(count, Ordering::Relaxed);
    }

    /// Whether there is a viewer.
    pub fn any(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 0
    }
}

/// The state of the bodies and of the host after a step.
#[derive(Debug, Default)]
pub struct Moment {
    /// Number of the step, from one; zero before the first step.
    pub step: u64,
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// The bodies, in the scene's order.
    pub bodies: Vec<BodyMoment>,
    /// The counts of the host. The rate of the steps is left at zero.
    pub host: HostState,
}

/// The state of one body after a step.
#[derive(Debug, Default)]
pub struct BodyMoment {
    /// Topology epoch.
    pub epoch: u32,
    /// Positions (m), three numbers a vertex.
    pub positions: Vec<f32>,
    /// The body's mesh at its present positions, where the epoch has changed since the moment before and no tear is the
    /// reason.
    pub changed: Option<Box<Mesh>>,
    /// The body's surface, where a tear has grown since the moment before.
    pub torn: TornSurface,
}

impl Moment {
    /// The present state of `engine`, after the step that was due at `time_ns`. `skipped` is the number of steps left out.
    pub fn of(engine: &Engine, time_ns: u64, skipped: u64) -> Self {
        let bodies = engine.bodies().iter().enumerate();
        let bodies = bodies.map(|(index, body)| BodyMoment {
            positions: Vec::with_capacity(3 * vertex_room(body.body())),
            torn: TornSurface::new(index, body.body()),
            ..BodyMoment::default()
        });
        let mut moment = Self {
            bodies: bodies.collect(),
            ..Self::default()
        };
        moment.copy(engine, time_ns, skipped);
        let stats = engine.stats();
        moment.host.medians = [&stats.solve, &stats.condense].map(median);
        moment
    }

    /// The moment with the meshes of the bodies whose epoch is not that of `epochs`.
    pub(crate) fn since(mut self, epochs: &[u32], engine: &Engine) -> Self {
        let bodies = self.bodies.iter_mut().zip(engine.bodies());
        for (index, ((copy, body), known)) in bodies.zip(epochs).enumerate() {
            if copy.epoch != *known {
                copy.copy_mesh(index, body.body());
            }
        }
        self
    }

    fn copy(&mut self, engine: &Engine, time_ns: u64, skipped: u64) {
        let (stats, bodies) = (engine.stats(), engine.bodies());
        self.step = stats.steps;
        self.time_ns = time_ns;
        self.bodies.resize_with(bodies.len(), Default::default);
        for (copy, body) in self.bodies.iter_mut().zip(bodies) {
            copy.epoch = body.body().epoch() as u32;
            copy.positions.clear();
            let positions = body.body().positions();
            copy.positions.reserve(3 * positions.len());
            positions.for_each(|x| copy.positions.extend([x.x, x.y, x.z].map(|x| x as f32)));
            copy.changed = None;
            copy.torn.clear();
        }
        count(&mut self.host, stats, bodies, skipped);
    }

    /// The vertices of each body, as a frame has them.
    pub fn vertices(&self) -> impl Iterator<Item = Vertices> {
        self.bodies.iter().map(|body| Vertices {
            step: self.step,
            time_ns: self.time_ns,
            epoch: body.epoch,
            count: (body.positions.len() / 3) as u32,
            stressed: false,
            positions: body.positions.clone(),
            stress: Vec::new(),
        })
    }
}

impl BodyMoment {
    /// Adds the surface of `body`, whose epoch has changed.
    fn copy_mesh(&mut self, index: usize, body: &Body) {
        if !self.torn.copy(index, body) {
            self.changed = mesh_of(body).map(Box::new);
        }
    }
}

/// The counts of the host after a step of `bodies`. The medians are left as they are.
fn count(host: &mut HostState, stats: &EngineStats, bodies: &[HostBody], skipped: u64) {
    host.steps = stats.steps;
    host.skipped = skipped;
    host.publications = stats.publications;
    host.factors = stats.factors;
    host.faults = stats.faults;
    host.stages = [None; 2];
    host.iterations = 0;
    for body in bodies {
        let tally = body.tally();
        let times = [tally.solve, tally.condense];
        for (sum, ns) in host.stages.iter_mut().zip(times) {
            if let Some(ns) = ns {
                *sum = Some(sum.unwrap_or(0.0) + ns as f64 * 1e-9);
            }
        }
        let iterations = tally.solved.map_or(0, |(iterations, ..)| iterations as u64);
        host.iterations = host.iterations.max(iterations);
    }
}

fn median(times: &runner::latency::LatencyHistogram) -> f64 {
    times.summary().p50 as f64 * 1e-9
}

/// Makes a slot for the bodies of `engine`. The host copies while `watchers` are there.
pub fn slot(engine: &Engine, watchers: Watchers) -> (SlotWriter, SlotReader) {
    let (filled, to_read) = RingBuffer::new(BUFFERS);
    let (mut returned, free) = RingBuffer::new(BUFFERS);
    for _ in 0..BUFFERS {
        // The ring has as many places. The buffer has its memory from the start.
        let _ = returned.push(Box::new(Moment::of(engine, 0, 0)));
    }
    let epochs = engine.bodies().iter().map(|body| body.body().epoch());
    let writer = SlotWriter {
        watchers,
        rate: Rate::of_frames(),
        filled,
        free,
        epochs: epochs.collect(),
        medians: Medians::default(),
    };
    let reader = SlotReader {
        filled: to_read,
        free: returned,
    };
    (writer, reader)
}

/// The host's end.
pub struct SlotWriter {
    watchers: Watchers,
    rate: Rate,
    filled: Producer<Box<Moment>>,
    free: Consumer<Box<Moment>>,
    /// The epochs that the reader knows, by body.
    epochs: Vec<u64>,
    medians: Medians,
}

impl SlotWriter {
    /// Copies the positions if a viewer is connected and a copy is due. `time_ns` is the due time of the step just done,
    /// and `skipped` the number of steps left out so far.
    pub fn after_step(&mut self, time_ns: u64, skipped: u64, engine: &Engine) {
        if self.watchers.any() {
            self.after_step_at(Instant::now(), time_ns, skipped, engine);
        }
    }

    /// As [`Self::after_step`] with a viewer, at `now`.
    pub fn after_step_at(&mut self, now: Instant, time_ns: u64, skipped: u64, engine: &Engine) {
        // A copy that finds no buffer is made after a later step, as soon as there is a buffer.
        if self.free.is_empty() || !self.rate.is_due(now) {
            return;
        }
        let Ok(mut moment) = self.free.pop() else {
            return;
        };
        moment.copy(engine, time_ns, skipped);
        moment.host.medians = self.medians.at(now, engine.stats());
        let known = moment.bodies.iter_mut().zip(&mut self.epochs);
        for (index, ((copy, known), body)) in known.zip(engine.bodies()).enumerate() {
            let epoch = body.body().epoch();
            if *known != epoch {
                *known = epoch;
                copy.copy_mesh(index, body.body());
            }
        }
        // There are as many places as buffers.
        let _ = self.filled.push(moment);
    }
}

/// The medians of the stages, renewed one after the other.
#[derive(Debug, Default)]
struct Medians {
    values: [f64; 2],
    next: usize,
    renewed: Option<Instant>,
}

impl Medians {
    fn at(&mut self, now: Instant, stats: &EngineStats) -> [f64; 2] {
        let stages = [&stats.solve, &stats.condense];
        match self.renewed {
            None => self.values = stages.map(median),
            Some(before) if now.duration_since(before) < MEDIAN_PERIOD => return self.values,
            Some(_) => {
                self.values[self.next] = median(stages[self.next]);
                self.next = (self.next + 1) % stages.len();
            }
        }
        self.renewed = Some(now);
        self.values
    }
}

/// The reader's end.
pub struct SlotReader {
    filled: Consumer<Box<Moment>>,
    free: Producer<Box<Moment>>,
}

impl SlotReader {
    /// The newest moment, if one has come since the last call. The caller gives it [back](Self::give_back).
    pub fn newest(&mut self) -> Option<Box<Moment>> {
        let mut newest = self.filled.pop().ok()?;
        while let Ok(mut next) = self.filled.pop() {
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
    pub fn give_back(&mut self, mut moment: Box<Moment>) {
        // The host frees no mesh.
        moment
            .bodies
            .iter_mut()
            .for_each(|body| body.changed = None);
        // There are as many places as buffers.
        let _ = self.free.push(moment);
    }
}

#[cfg(test)]
mod tests;
