//! The trouble of a run, around its link and its host.

use super::world::World;
use crate::StudyError;
use crate::stress::chance::Chance;
use host::engine::Engine;
use host::engine::build::{self, How};
use host::engine::pacer::Due;
use host::engine::stats::Stopwatch;
use host::run::late::LateLink;
use host::run::timeline::Host;
use rt_core::{LocalModel, TickRecord};

/// A clock for a run under virtual time, which measures nothing.
struct NoWatch;

impl Stopwatch for NoWatch {
    fn now_ns(&self) -> u64 {
        0
    }
}

/// A link that is late at random, and loses models and records.
pub(super) struct Lossy<'a> {
    link: LateLink,
    world: &'a World,
    chance: Chance,
    /// Number of records so far.
    records: u64,
}

impl<'a> Lossy<'a> {
    pub(super) fn new(link: LateLink, world: &'a World, chance: Chance) -> Self {
        Self {
            link,
            world,
            chance,
            records: 0,
        }
    }

    /// Passes the records that are not lost to `see`.
    fn drain(&mut self, mut see: impl FnMut(&TickRecord)) {
        let (lost, chance) = (self.world.draw.records_lost, self.chance);
        let records = &mut self.records;
        self.link.drain(|record| {
            *records += 1;
            if chance.of("record").unit(*records) >= lost {
                see(record);
            }
        });
    }

    /// Sends the model of publication `number`, of the state at `time_ns`, unless it is lost.
    fn send(&mut self, time_ns: u64, number: u64, body: usize, model: &LocalModel) {
        let (draw, chance) = (&self.world.draw, self.chance);
        let late = draw.jitter * (draw.latency + 1.0 / draw.rate);
        let delay = draw.latency + late * chance.of("late").unit(number);
        if chance.of("model").unit(number) >= draw.models_lost {
            self.link.send(time_ns + (delay * 1e9) as u64, body, model);
        }
    }
}

/// A host that steps at a fixed rate, independent of the rate at which it publishes.
pub(super) struct Steady<'a> {
    engine: Engine,
    link: Lossy<'a>,
    /// The number of the next step, and the number of the last publication that was due.
    next: u64,
    published: u64,
}

impl<'a> Steady<'a> {
    pub(super) fn new(engine: Engine, link: Lossy<'a>) -> Self {
        Self {
            engine,
            link,
            next: 1,
            published: 0,
        }
    }

    /// The time at which the next step starts (ns).
    fn time_ns(&self) -> u64 {
        let rate = self.link.world.loaded.scene.host.step_rate;
        (self.next as f64 * 1e9 / rate) as u64
    }

    /// Moves the handles along the records that have arrived.
    fn follow(&mut self) {
        let engine = &mut self.engine;
        self.link.drain(|record| engine.follow(record));
    }

    fn step(&mut self) {
        let time_ns = self.time_ns();
        self.next += 1;
        self.follow();
        let rate = self.link.world.draw.rate;
        // A publication is due at the first step at or after each multiple of the period. A late host does not repeat
        // publications that it missed.
        let due = (time_ns as f64 * 1e-9 * rate * (1.0 + 1e-12)) as u64;
        let publishes = due > self.published;
        self.published = due;
        let link = &mut self.link;
        self.engine
            .step(Due { time_ns, publishes }, &NoWatch, |body, model| {
                link.send(time_ns, due, body, model);
            });
    }
}

/// A host that stalls, and whose bodies soften. A stalled host takes no steps, and resumes at the present poses of the
/// hands.
pub(super) struct Troubled<'a> {
    host: Steady<'a>,
    world: &'a World,
    /// The time at which the bodies softened here (ns), and whether the tick has received a model of each softened
    /// body.
    softened: Option<u64>,
    received: Vec<bool>,
}

impl<'a> Troubled<'a> {
    pub(super) fn new(host: Steady<'a>, world: &'a World) -> Self {
        Self {
            host,
            world,
            softened: None,
            received: vec![false; world.loaded.scene.bodies.len()],
        }
    }

    /// The physics.
    pub(super) fn engine(&self) -> &Engine {
        &self.host.engine
    }

    /// Whether the tick has yet to receive a model of a softened body.
    pub(super) fn awaits_model(&self) -> bool {
        self.received.contains(&false)
    }
}

impl Host for Troubled<'_> {
    type Error = StudyError;

    fn next_ns(&self) -> Option<u64> {
        Some(self.host.time_ns())
    }

    fn step(&mut self) -> Result<(), StudyError> {
        let draw = &self.world.draw;
        let time_ns = self.host.time_ns();
        let time = time_ns as f64 * 1e-9;
        if draw.stalls.iter().any(|stall| stall.holds(time)) {
            self.host.next += 1;
            return Ok(());
        }
        if let (None, Some(softening), Some(soft)) =
            (self.softened, draw.softening, &self.world.soft)
            && time >= softening.at
        {
            self.softened = Some(time_ns);
            self.host.follow();
            let others = build::bodies(soft, How::default())?;
            self.host.engine.exchange(others)?;
        }
        self.host.step();
        Ok(())
    }

    fn deliver(&mut self, now_ns: u64) {
        let (softened, received) = (self.softened, &mut self.received);
        self.host.link.link.deliver(now_ns, |body, model| {
            received[body] |= softened.is_some_and(|at| model.time_ns >= at);
        });
    }
}
