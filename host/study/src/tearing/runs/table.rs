//! The times of the steps of a sheet that tears (thesis, table 4.1).
//!
//! The engine of the scene steps on one thread, at the pace of the real clock, as in a run under the real clock: new
//! factors are made on other threads. The time is the processor time of the thread that steps, so other programs do not
//! count. The hands follow the waypoints of the scene.

use crate::StudyError;
use crate::hands::Hands;
use crate::speed::clock::{Times, cpu_time};
use host::engine::Engine;
use host::engine::build::{self, BuildOptions};
use host::engine::pacer::Pacer;
use host::engine::stats::{EngineStats, Stopwatch};
use host::scene::LoadedScene;
use host::world::World;
use runner::latency::LatencyHistogram;
use serde::Serialize;
use std::time::{Duration, Instant};

/// The time that a step may take (s).
pub const MOST: f64 = 1e-3;
/// The first steps find no memory in the caches.
const FIRST: usize = 5;

/// Mean and largest number of iterations of some steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Iterations {
    /// Number of steps.
    pub steps: usize,
    /// Mean number of iterations.
    pub mean: f64,
    /// Largest number of iterations.
    pub most: f64,
}

/// The times of a scene (s).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Name of the scene.
    pub scene: String,
    /// Triangles at the start.
    pub triangles: usize,
    /// Steps in which the topology changed.
    pub torn: usize,
    /// Factors of new topologies that were taken.
    pub renewed: u64,
    /// Time of the finite elements: assembly and solution.
    pub fem: Times,
    /// Time of the tears before the first edit.
    pub tear_before: Times,
    /// Time of the tears from the first edit on.
    pub tear_after: Times,
    /// Time of the tears in steps with an edit.
    pub tear_edit: Times,
    /// Time of the local model, in steps that publish.
    pub model: Times,
    /// Time of a whole step, with everything.
    pub total: Times,
    /// Time of a whole step with an edit.
    pub total_edit: Times,
    /// The part of the tears in the time of all steps (1).
    pub tear_share: f64,
    /// The part of the local models in the time of all steps (1).
    pub model_share: f64,
    /// The part of the steps that took less than [`MOST`] (1).
    pub in_time: f64,
    /// Iterations before the first edit, in the step after each edit, and in the other steps.
    pub iterations: [Iterations; 3],
    /// Faults of the host.
    pub faults: u64,
}

/// Processor time of the calling thread.
struct ThreadTime;

impl Stopwatch for ThreadTime {
    fn now_ns(&self) -> u64 {
        (cpu_time() * 1e9) as u64
    }
}

/// The times and counts of a step.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    fem: f64,
    tear: f64,
    model: f64,
    total: f64,
    iterations: f64,
    torn: bool,
    publishes: bool,
}

/// Sums over all steps so far.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    fem: f64,
    tear: f64,
    model: f64,
    iterations: f64,
    torn: u64,
}

impl Sums {
    fn of(stats: &EngineStats) -> Self {
        let sum = |times: &LatencyHistogram| {
            let summary = times.summary();
            summary.mean * summary.count as f64
        };
        Self {
            fem: 1e-9 * sum(&stats.solve),
            tear: 1e-9 * sum(&stats.tear),
            model: 1e-9 * sum(&stats.condense),
            iterations: sum(&stats.iterations),
            torn: stats.torn,
        }
    }
}

/// Runs the scene for at most `most` seconds.
///
/// # Errors
/// [`StudyError`] if the scene cannot be built.
pub fn run(loaded: &LoadedScene, most: f64, progress: &dyn Fn(f64)) -> Result<Row, StudyError> {
    let scene = &loaded.scene;
    let how = BuildOptions {
        real: true,
        ..BuildOptions::default()
    };
    let world = World::new(loaded)?;
    let mut engine = Engine::new(build::bodies(&world, how)?);
    let hands = Hands::new(&world, &engine);
    let bodies = engine.bodies().iter();
    let triangles = bodies.map(|body| body.body().element_count()).sum();
    let rates = &scene.host;
    // The steps of a scene are a whole multiple of its publications.
    let every = (rates.step_rate / rates.publish_rate).round() as u64;
    let mut pacer = Pacer::new(rates.step_rate, every);
    let end_ns = (scene.duration.min(most) * 1e9) as u64;
    let mut steps: Vec<Step> = Vec::new();
    let mut before = Sums::default();
    let start = Instant::now();
    loop {
        let due = pacer.begin(pacer.next_ns());
        if due.time_ns > end_ns {
            break;
        }
        if let Some(wait) = Duration::from_nanos(due.time_ns).checked_sub(start.elapsed()) {
            std::thread::sleep(wait);
        }
        engine.follow(&hands.record(steps.len() as u64, due.time_ns));
        let began = cpu_time();
        engine.step(due, &ThreadTime, &mut |_, _| {});
        let total = cpu_time() - began;
        let after = Sums::of(engine.stats());
        steps.push(Step {
            fem: after.fem - before.fem,
            tear: after.tear - before.tear,
            model: after.model - before.model,
            total,
            iterations: after.iterations - before.iterations,
            torn: after.torn > before.torn,
            publishes: due.publishes,
        });
        before = after;
        progress(due.time_ns as f64 / end_ns as f64);
    }
    let stats = engine.stats();
    let counts = (triangles, stats.renewed, stats.faults);
    Ok(row(
        scene.name.clone(),
        counts,
        steps.get(FIRST..).unwrap_or_default(),
    ))
}

/// The table's row of these steps.
fn row(scene: String, (triangles, renewed, faults): (usize, u64, u64), steps: &[Step]) -> Row {
    let first = steps.iter().position(|step| step.torn);
    let (before, after) = steps.split_at(first.unwrap_or(steps.len()));
    let times = |steps: &mut dyn Iterator<Item = f64>| Times::of(steps.collect());
    let sum = |time: fn(&Step) -> f64| steps.iter().map(time).sum::<f64>();
    let total = sum(|step| step.total);
    let in_time = steps.iter().filter(|step| step.total < MOST).count();
    // Each step with the step before.
    let pairs = || {
        after
            .windows(2)
            .map(|pair| (pair[0].torn, pair[1].iterations))
    };
    Row {
        scene,
        triangles,
        torn: steps.iter().filter(|step| step.torn).count(),
        renewed,
        fem: times(&mut steps.iter().map(|step| step.fem)),
        tear_before: times(&mut before.iter().map(|step| step.tear)),
        tear_after: times(&mut after.iter().map(|step| step.tear)),
        tear_edit: times(&mut after.iter().filter(|s| s.torn).map(|s| s.tear)),
        model: times(&mut steps.iter().filter(|s| s.publishes).map(|s| s.model)),
        total: times(&mut steps.iter().map(|step| step.total)),
        total_edit: times(&mut after.iter().filter(|s| s.torn).map(|s| s.total)),
        tear_share: sum(|step| step.tear) / total,
        model_share: sum(|step| step.model) / total,
        in_time: in_time as f64 / steps.len().max(1) as f64,
        iterations: [
            Iterations::of(before.iter().map(|step| step.iterations)),
            Iterations::of(pairs().filter(|(torn, _)| *torn).map(|(_, n)| n)),
            Iterations::of(pairs().filter(|(torn, _)| !*torn).map(|(_, n)| n)),
        ],
        faults,
    }
}

impl Iterations {
    fn of(iterations: impl Iterator<Item = f64>) -> Self {
        let (steps, sum, most) = iterations.fold((0, 0.0, 0.0_f64), |(steps, sum, most), n| {
            (steps + 1, sum + n, most.max(n))
        });
        Self {
            steps,
            mean: sum / steps.max(1) as f64,
            most: most.round(),
        }
    }
}
