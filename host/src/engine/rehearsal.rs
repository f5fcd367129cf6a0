//! A rehearsal: some steps of a scene's bodies, without devices and without a run. The first step, at rest, shows the
//! directions and the damping that the devices cannot render. Further steps are timed. The hands move in them as fast as
//! hands explore, so that the solvers have work to do.

use super::Engine;
use super::build::{self, BuildOptions};
use super::pacer::{Due, Pacer};
use super::stats::{ProcessorStopwatch, StepTimes};
use super::unrendered::{DampedSummary, StiffSummary};
use crate::scene::SceneError;
use crate::scene::spec::Scene;
use crate::world::World;
use rt_core::{MAX_DEVICES, TickRecord, Vec3};

/// Most steps of a rehearsal, and the measured time after which three suffice (s).
const STEPS: u64 = 20;
const ENOUGH: f64 = 1.0;
/// Speed of the hands (m/s).
const SPEED: f64 = 0.01;

/// The bodies of a scene with their solvers, and hands that have not moved.
pub struct Rehearsal<'a> {
    scene: &'a Scene,
    engine: Engine,
    /// The record of a tick at time zero.
    record: TickRecord,
}

impl<'a> Rehearsal<'a> {
    /// Prepares copies of the bodies of a world. Most of the time goes into the factor of each body.
    ///
    /// # Errors
    /// As [`build::bodies`].
    pub fn new(world: &World<'a>) -> Result<Self, SceneError> {
        let scene = &world.loaded.scene;
        let held = build::bodies(world, BuildOptions::default())?;
        let mut record = TickRecord::empty();
        for body in &held {
            for (device, pose) in body.hands() {
                if let Some((proxy, _)) = record.proxies.get_mut(device) {
                    *proxy = pose;
                }
                record.device_count = record.device_count.max(device as u8 + 1);
            }
        }
        Ok(Self {
            scene,
            engine: Engine::new(held).on(scene.host.threads),
            record,
        })
    }

    /// The directions that the devices cannot render of the first models, whose bodies are at rest: body by body, stiffest
    /// first. It takes a step and a condensation.
    pub fn stiff(&mut self) -> Vec<StiffSummary> {
        self.engine.follow(&self.record);
        let due = Due {
            time_ns: 0,
            publishes: true,
        };
        self.step(due);
        let mut found = Vec::new();
        for (number, body) in self.engine.bodies().iter().enumerate() {
            let directions = body.publisher().stiff_directions();
            let each = directions.iter();
            found.extend(each.map(|direction| StiffSummary::new(self.scene, number, direction)));
        }
        found
    }

    /// Where the devices render the least part of the damping of the bodies, as far as the [steps](Self::stiff) have shown.
    pub fn damped(&self) -> Vec<DampedSummary> {
        DampedSummary::all(self.scene, self.engine.bodies())
    }

    /// The typical processor time of a host step of the scene on this machine, with its share of the publications (s):
    /// that of the threads that lead its stages ([`ProcessorStopwatch`]). The time depends on the machine; nothing else
    /// does.
    pub fn step_time(mut self) -> f64 {
        let start = self.record.proxies;
        let cycle = build::steps_per_publication(self.scene);
        let mut pacer = Pacer::new(self.scene.host.step_rate, cycle);
        let mut times = StepTimes::new(cycle);
        loop {
            let due = pacer.begin(pacer.next_ns());
            let record = &mut self.record;
            record.tick += 1;
            record.time_ns = due.time_ns;
            let moved = Vec3::x() * (SPEED * due.time_ns as f64 * 1e-9);
            for ((proxy, twist), (first, _)) in
                record.proxies.iter_mut().zip(start).take(MAX_DEVICES)
            {
                proxy.position = first.position + moved;
                twist.linear = Vec3::x() * SPEED;
            }
            self.engine.follow(&self.record);
            self.step(due);
            times.take(self.engine.stats());
            let (steps, time) = (self.engine.stats().steps, self.engine.stats().total_time());
            if steps >= STEPS || (steps >= 3 && time >= ENOUGH) {
                return times.typical();
            }
        }
    }

    fn step(&mut self, due: Due) {
        self.engine.step(due, &ProcessorStopwatch, &mut |_, _| {});
    }
}
