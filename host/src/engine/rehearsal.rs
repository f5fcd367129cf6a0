//! A rehearsal: some steps of a scene's bodies, timed, without devices and without a run. The hands move as fast as
//! hands explore, so that the solvers have work to do.

use super::Engine;
use super::build::{self, How};
use super::pacer::Pacer;
use super::stats::{StepTimes, WallStopwatch};
use super::threads::{Threads, awake};
use crate::bodies::Built;
use crate::scene::{LoadedScene, SceneError};
use crate::stage::Stage;
use rt_core::{MAX_DEVICES, TickRecord, Vec3};

/// Most steps of a rehearsal, and the measured time after which three suffice (s).
const STEPS: u64 = 20;
const ENOUGH: f64 = 1.0;
/// Speed of the hands (m/s).
const SPEED: f64 = 0.01;

/// The mean time of a host step of the scene on this machine, with its share of the publications (s). The time depends
/// on the machine; nothing else does.
///
/// # Errors
/// As [`build::bodies`].
pub fn step_time(loaded: &LoadedScene) -> Result<f64, SceneError> {
    step_time_of(loaded, build::settled(loaded)?)
}

/// As [`step_time`], with the bodies of the scene, which are settled.
///
/// # Errors
/// As [`build::bodies`].
pub fn step_time_of(loaded: &LoadedScene, settled: Vec<Built>) -> Result<f64, SceneError> {
    let scene = &loaded.scene;
    let held = build::with_solvers(loaded, How::default(), settled)?;
    Stage::Timing.begin();
    let mut record = TickRecord::empty();
    for body in &held {
        for (device, pose) in body.hands() {
            if let Some((proxy, _)) = record.proxies.get_mut(device) {
                *proxy = pose;
            }
            record.device_count = record.device_count.max(device as u8 + 1);
        }
    }
    let start = record.proxies;
    let threads = Threads::new(scene.host.threads);
    let mut engine = Engine::new(held).on(scene.host.threads);
    let mut pacer = Pacer::new(scene.host.step_rate, build::steps_per_publication(scene));
    let watch = WallStopwatch::start();
    let mut times = StepTimes::new(build::steps_per_publication(scene));
    loop {
        let due = pacer.begin(pacer.next_ns());
        record.tick += 1;
        record.time_ns = due.time_ns;
        let moved = Vec3::x() * (SPEED * due.time_ns as f64 * 1e-9);
        for ((proxy, twist), (first, _)) in record.proxies.iter_mut().zip(start).take(MAX_DEVICES) {
            proxy.position = first.position + moved;
            twist.linear = Vec3::x() * SPEED;
        }
        engine.follow(&record);
        threads.run(|| awake(|| engine.step(due, &watch, |_, _| {})));
        times.take(engine.stats());
        let (steps, time) = (engine.stats().steps, engine.stats().total_time());
        if steps >= STEPS || (steps >= 3 && time >= ENOUGH) {
            return Ok(times.typical());
        }
    }
}
