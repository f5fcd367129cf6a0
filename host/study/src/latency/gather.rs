//! The observer of a run that collects its latencies.

use super::deadlines::Deadlines;
use super::edges::Edges;
use super::percentile::Series;
use super::stages::{Stage, stages, whole};
use super::worst::Worst;
use host::run::observer::{Observed, Observer};
use host::scene::Scene;
use rt_core::Telemetry;
use runner::kernel::{KernelCounts, KernelWindow};
use runner::link::LogRecord;
use std::sync::mpsc::Sender;

/// Most windows in which the kernel counted something that are kept one by one.
const MOST_WINDOWS: usize = 1000;

/// What a run showed of its latencies.
#[derive(Clone, Debug)]
pub struct Gathered {
    /// Lateness of the wake-up, by deadline.
    pub lateness: Series,
    /// Time to read all devices, by tick.
    pub read: Series,
    /// Time to compute all wrenches, by tick; the newest models are taken in it.
    pub compute: Series,
    /// Time to hand over all wrenches, by tick.
    pub write: Series,
    /// Time from the deadline to the last command, by tick.
    pub whole: Series,
    /// Time from a motion to the force that answers it, by device. Empty if the device does not tell.
    pub motion_to_force: Vec<Series>,
    /// Age of the local model in use, by body and tick.
    pub model_age: Vec<Series>,
    /// Deadlines that were met, skipped, and unknown.
    pub deadlines: Deadlines,
    /// The edges of force of each device whose scene commands a square wave.
    pub edges: Vec<Option<Edges>>,
    /// The worst ticks.
    pub worst: Worst,
    /// What the kernel counted for the tick's thread in the whole run; `None` if the system does not tell.
    pub counted: Option<KernelCounts>,
    /// The first windows in which the kernel counted something.
    pub windows: Vec<KernelWindow>,
    /// Sum of the times of each stage (ns).
    sums: Vec<(Stage, u64)>,
}

impl Gathered {
    fn new(scene: &Scene, ticks: u64) -> Self {
        let series = || Series::new(ticks);
        let period = 1e9 / scene.realtime.rate;
        Self {
            lateness: series(),
            read: series(),
            compute: series(),
            write: series(),
            whole: series(),
            motion_to_force: scene.devices.iter().map(|_| series()).collect(),
            model_age: scene.bodies.iter().map(|_| series()).collect(),
            deadlines: Deadlines::new(period.round() as u64),
            edges: (scene.devices.iter())
                .map(|device| Edges::of(device, ticks as f64 / scene.realtime.rate))
                .collect(),
            worst: Worst::default(),
            counted: None,
            windows: Vec::new(),
            sums: Vec::new(),
        }
    }

    /// The usual time of a stage (ns): its mean.
    pub fn usual(&self, stage: Stage) -> u64 {
        let sum = self.sums.iter().find(|(found, _)| *found == stage);
        sum.map_or(0, |(_, ns)| ns / self.deadlines.met.max(1))
    }

    fn tick(&mut self, telemetry: &Telemetry) {
        let (lateness, now_ns) = (&mut self.lateness, telemetry.time_ns);
        let skipped = self
            .deadlines
            .take(telemetry, |at_ns, late_ns| lateness.record(at_ns, late_ns));
        if skipped > 0 {
            self.worst.skip_after(telemetry.tick - 1, skipped);
        }
        let stages = stages(telemetry);
        let of = |wanted: fn(Stage) -> bool| {
            let stages = stages.iter().filter(|(stage, _)| wanted(*stage));
            stages.map(|(_, ns)| ns).sum()
        };
        let read = of(|stage| matches!(stage, Stage::Read(_)));
        let compute = of(|stage| matches!(stage, Stage::Take | Stage::Compute));
        let write = of(|stage| matches!(stage, Stage::Write(_)));
        self.read.record(now_ns, read);
        self.compute.record(now_ns, compute);
        self.write.record(now_ns, write);
        self.whole.record(now_ns, whole(&stages));
        self.worst.take(telemetry.tick, now_ns, &stages);
        if self.sums.is_empty() {
            self.sums = stages.iter().map(|(stage, _)| (*stage, 0)).collect();
        }
        for ((_, sum), (_, ns)) in self.sums.iter_mut().zip(&stages) {
            *sum += ns;
        }
        let times = telemetry.stamps.motion_to_force_ns;
        for (series, ns) in self.motion_to_force.iter_mut().zip(times) {
            if ns > 0 {
                series.record(now_ns, ns);
            }
        }
        for (series, body) in self.model_age.iter_mut().zip(telemetry.bodies()) {
            // A sequence number of zero means that no model has arrived, so there is no age.
            if body.sequence > 0 {
                series.record(now_ns, body.age_ns);
            }
        }
        for (index, edges) in self.edges.iter_mut().enumerate() {
            if let Some(edges) = edges {
                edges.take(index, telemetry);
            }
        }
    }
}

/// Collects the latencies of a run, and sends them at its end.
#[derive(Debug)]
pub struct Gatherer {
    gathered: Gathered,
    to: Sender<Gathered>,
}

impl Gatherer {
    /// An observer of a run of `scene` with `ticks` deadlines.
    pub fn new(scene: &Scene, ticks: u64, to: Sender<Gathered>) -> Self {
        let gathered = Gathered::new(scene, ticks);
        Self { gathered, to }
    }
}

impl Observer for Gatherer {
    fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = record {
            self.gathered.tick(telemetry);
        }
    }

    fn counted(&mut self, window: &KernelWindow) {
        let Gathered {
            worst,
            counted,
            windows,
            ..
        } = &mut self.gathered;
        worst.count(window);
        *counted = Some(counted.unwrap_or_default().plus(&window.counts));
        if !window.counts.is_zero() && windows.len() < MOST_WINDOWS {
            windows.push(*window);
        }
    }

    fn finish(self: Box<Self>, _: &mut Observed) {
        // The command that waits for the result may have failed.
        let _ = self.to.send(self.gathered);
    }
}
