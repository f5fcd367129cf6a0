//! The counts of the host after a step, and the times of its stages.

use crate::engine::Engine;
use crate::engine::stats::EngineStats;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// Time from one computation of a median to the next. A median costs some 30 µs.
const MEDIAN_PERIOD: Duration = Duration::from_millis(333);

/// The host.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct HostCounts {
    /// Steps done.
    pub steps: u64,
    /// Steps left out because the host was late.
    pub skipped: u64,
    /// Steps a second over the last second of the run's own time (Hz).
    pub step_rate: f64,
    /// Local models published.
    pub publications: u64,
    /// Background refactorizations.
    pub factors: u64,
    /// Steps or publications that failed.
    pub faults: u64,
    /// Time of the stages in the last step, over all bodies (s): solve, condense. `None` for a stage that the
    /// step did not have.
    pub stages: [Option<f64>; 2],
    /// Median time of the stages since the start (s).
    pub medians: [f64; 2],
    /// Iterations of the solver in the last step, the largest of all bodies.
    pub iterations: u64,
}

impl HostCounts {
    /// Takes the counts of `engine`, which left out `skipped` steps. The medians and the rate of the steps stay as they are.
    pub(super) fn count(&mut self, engine: &Engine, skipped: u64) {
        let stats = engine.stats();
        self.steps = stats.steps;
        self.skipped = skipped;
        self.publications = stats.publications;
        self.factors = stats.factors;
        self.faults = stats.faults;
        self.stages = [None; 2];
        self.iterations = 0;
        for body in engine.bodies() {
            let tally = body.tally();
            let times = [tally.solve, tally.condense];
            for (sum, ns) in self.stages.iter_mut().zip(times) {
                if let Some(ns) = ns {
                    *sum = Some(sum.unwrap_or(0.0) + ns as f64 * 1e-9);
                }
            }
            let iterations = tally.solved.map_or(0, |(iterations, ..)| iterations as u64);
            self.iterations = self.iterations.max(iterations);
        }
    }
}

/// The median times of the stages since the start (s): solve, condense.
pub(super) fn medians(stats: &EngineStats) -> [f64; 2] {
    [0, 1].map(|stage| median(stage, stats))
}

fn median(stage: usize, stats: &EngineStats) -> f64 {
    [&stats.solve, &stats.condense][stage].summary().p50 as f64 * 1e-9
}

/// The medians of the stages, renewed one after the other.
#[derive(Debug, Default)]
pub(super) struct Medians {
    values: [f64; 2],
    next: usize,
    renewed: Option<Instant>,
}

impl Medians {
    pub(super) fn at(&mut self, now: Instant, stats: &EngineStats) -> [f64; 2] {
        match self.renewed {
            None => self.values = medians(stats),
            Some(before) if now.duration_since(before) < MEDIAN_PERIOD => return self.values,
            Some(_) => {
                self.values[self.next] = median(self.next, stats);
                self.next = (self.next + 1) % self.values.len();
            }
        }
        self.renewed = Some(now);
        self.values
    }
}
