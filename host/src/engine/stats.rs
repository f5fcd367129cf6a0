//! Times and counts of the host's steps.

use super::change::ChangeError;
use physics::{BodyError, CondenseError, StepError, TearReport, TearingError};
use runner::latency::LatencyHistogram;
use rustix::time::{ClockId, clock_gettime};

/// Reads a clock for measurement only: nothing in the state may depend on the time that it returns.
pub trait Stopwatch: Sync {
    /// Time since some fixed start (ns).
    fn now_ns(&self) -> u64;
}

/// A stopwatch on the machine's monotonic clock.
#[derive(Clone, Copy, Debug)]
pub struct WallStopwatch(std::time::Instant);

impl WallStopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self(std::time::Instant::now())
    }
}

impl Stopwatch for WallStopwatch {
    fn now_ns(&self) -> u64 {
        u64::try_from(self.0.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }
}

/// A stopwatch on the processor time of the thread that reads it. Other programs of a busy machine do not count. Of a stage
/// that several threads share, the time is that of the thread that leads it: its own parts, and its search for parts while it
/// waits for those of other threads.
#[derive(Clone, Copy, Debug)]
pub struct ProcessorStopwatch;

impl Stopwatch for ProcessorStopwatch {
    fn now_ns(&self) -> u64 {
        let time = clock_gettime(ClockId::ThreadCPUTime);
        let part = |value: i64| u64::try_from(value).unwrap_or_default();
        part(time.tv_sec) * 1_000_000_000 + part(time.tv_nsec)
    }
}

/// Why a body did not step or publish.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StepFault {
    /// The time step failed; the last good state is kept.
    #[error("step: {0}")]
    Step(#[from] StepError),
    /// The condensation failed; nothing was published.
    #[error("condensation: {0}")]
    Condense(#[from] CondenseError),
    /// A change could not be made; the body continues as it was.
    #[error("change: {0}")]
    Change(#[from] ChangeError),
    /// A stepper for a new topology could not follow the body; the old stepper stays in use.
    #[error("tear: {0}")]
    Tear(#[from] TearingError),
    /// The body refused its state.
    #[error("body: {0}")]
    Body(#[from] BodyError),
    /// The joints of the body do not follow its new mesh.
    #[error(
        "joints: they do not follow the new mesh of the body, which is joined to no other body from now on"
    )]
    Parted,
    /// The surface of the body after a tear or a change is none that contact can use.
    #[error(
        "contact: the triangles of the changed body are no surface; it touches with the surface that it had before"
    )]
    Surface,
    /// The state of a body that tears is no longer finite. The body stands still from then on.
    #[error("the state is no longer finite; the body stands still from now on")]
    NotFinite,
    /// The energy of a body that tears grew without work of hands. The body stands still from then on.
    #[error(
        "the state diverges: the body has gained {gained:.3} J, though the hands did {work:.3} J of work; the body \
         stands still from now on"
    )]
    Diverged {
        /// The energy that the body has gained since the start (J).
        gained: f64,
        /// The sum of the magnitudes of the work of the hands (J).
        work: f64,
    },
}

/// Counts and times of one body's part of a step. Bodies are stepped beside each other, so each has a tally of its own.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Time to solve (ns).
    pub(crate) solve: Option<u64>,
    /// Time to condense and publish (ns).
    pub(crate) condense: Option<u64>,
    /// Iterations of the solver, whether it converged, and the relative residual.
    pub(crate) solved: Option<(usize, bool, f64)>,
    /// Factors that were made in the background and then taken.
    pub(super) factors: u64,
    /// Time of the tears (ns), for a body that can tear.
    pub(crate) tear: Option<u64>,
    /// Whether the topology has changed.
    pub(crate) torn: bool,
    /// Steppers for new topologies that were taken.
    pub(crate) renewed: u64,
    /// The largest clipped eigenvalue, relative to the largest eigenvalue of its matrix, if one was clipped.
    pub(super) clip: Option<f64>,
}

/// Counts and times over all bodies.
#[derive(Clone, Debug)]
pub struct EngineStats {
    /// Host steps so far.
    pub steps: u64,
    /// Local models made so far.
    pub publications: u64,
    /// Time to solve (ns a step).
    pub solve: LatencyHistogram,
    /// Time to condense and publish (ns a publication).
    pub condense: LatencyHistogram,
    /// Solver iterations a step.
    pub iterations: LatencyHistogram,
    /// Factors that were made in the background and then taken.
    pub factors: u64,
    /// Changes of topology or constraints that have landed.
    pub changes: u64,
    /// Time of the tears (ns a step), of bodies that can tear.
    pub tear: LatencyHistogram,
    /// What tore so far, by body; zero for bodies that do not tear.
    pub tears: Vec<TearReport>,
    /// Steps in which the topology changed.
    pub torn: u64,
    /// Steppers for new topologies that were taken.
    pub renewed: u64,
    /// Steps that stopped at the iteration limit.
    pub unconverged: u64,
    /// Largest relative residual of any step.
    pub worst_residual: f64,
    /// Publications in which an eigenvalue was clipped.
    pub clipped: u64,
    /// The largest clipped eigenvalue, relative to the largest eigenvalue of its matrix.
    pub worst_clip: f64,
    /// Steps or publications that failed.
    pub faults: u64,
    /// The message of the first failure.
    pub first_fault: Option<String>,
}

impl EngineStats {
    /// Empty statistics. Times are resolved up to ten seconds.
    pub fn new() -> Self {
        let times = || LatencyHistogram::new(10_000_000_000);
        Self {
            steps: 0,
            publications: 0,
            solve: times(),
            condense: times(),
            iterations: LatencyHistogram::new(100_000),
            factors: 0,
            changes: 0,
            tear: times(),
            tears: Vec::new(),
            torn: 0,
            renewed: 0,
            unconverged: 0,
            worst_residual: 0.0,
            clipped: 0,
            worst_clip: 0.0,
            faults: 0,
            first_fault: None,
        }
    }

    /// Time of all steps so far (s): to solve, to tear and to publish. The times of bodies add up, though several
    /// threads may step bodies beside each other.
    pub fn total_time(&self) -> f64 {
        let sum = |times: &LatencyHistogram| {
            let summary = times.summary();
            summary.mean * summary.count as f64
        };
        1e-9 * (sum(&self.solve) + sum(&self.tear) + sum(&self.condense))
    }

    /// Mean time of a step (s), with its share of the publications.
    pub fn mean_step(&self) -> f64 {
        self.total_time() / self.steps.max(1) as f64
    }

    /// Adds the tally of a body.
    pub(super) fn add(&mut self, tally: &Tally) {
        for (times, time) in [
            (&mut self.solve, tally.solve),
            (&mut self.condense, tally.condense),
            (&mut self.tear, tally.tear),
        ] {
            if let Some(time) = time {
                times.record(time);
            }
        }
        if let Some((iterations, converged, relative_residual)) = tally.solved {
            self.iterations.record(iterations as u64);
            self.unconverged += u64::from(!converged);
            self.worst_residual = self.worst_residual.max(relative_residual);
        }
        self.publications += u64::from(tally.condense.is_some());
        self.factors += tally.factors;
        self.torn += u64::from(tally.torn);
        self.renewed += tally.renewed;
        if let Some(clip) = tally.clip {
            self.clipped += 1;
            self.worst_clip = self.worst_clip.max(clip);
        }
    }

    pub(super) fn fault(&mut self, body: usize, fault: &StepFault) {
        self.faults += 1;
        if self.first_fault.is_none() {
            self.first_fault = Some(format!("body {body}: {fault}"));
        }
    }
}

/// The times of steps, one by one, but for the first step, which finds no memory in the caches.
#[derive(Clone, Debug)]
pub struct StepTimes {
    /// Steps from one publication to the next.
    cycle: usize,
    /// Total time at the last step (s); `None` before the first.
    total: Option<f64>,
    /// Time of each step (s).
    steps: Vec<f64>,
}

impl StepTimes {
    /// No times yet. Every `cycle`-th step publishes.
    pub fn new(cycle: u64) -> Self {
        Self {
            cycle: usize::try_from(cycle).unwrap_or(usize::MAX).max(1),
            total: None,
            steps: Vec::new(),
        }
    }

    /// Takes the time of the step that has just been made.
    pub fn take(&mut self, stats: &EngineStats) {
        let total = stats.total_time();
        if let Some(before) = self.total.replace(total) {
            self.steps.push(total - before);
        }
    }

    /// The typical time of a step (s), with its share of a publication: the median over whole cycles of publications, so
    /// that another program that held up a few steps does not count. The mean if there is no whole cycle; zero
    /// before the second step.
    pub fn typical(&self) -> f64 {
        let mean = |times: &[f64]| times.iter().sum::<f64>() / times.len().max(1) as f64;
        let mut cycles: Vec<f64> = self.steps.chunks_exact(self.cycle).map(mean).collect();
        cycles.sort_by(f64::total_cmp);
        cycles
            .get(cycles.len() / 2)
            .copied()
            .unwrap_or_else(|| mean(&self.steps))
    }
}

impl Default for EngineStats {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn processor_time_runs_while_a_thread_works_and_stands_while_it_waits() {
        let now = || ProcessorStopwatch.now_ns();
        let start = now();
        while now() < start + 1_000_000 {
            std::hint::spin_loop();
        }
        let before = now();
        std::thread::sleep(Duration::from_millis(200));
        // A thread that sleeps uses no processor, however busy the machine is.
        assert!(now() - before < 100_000_000);
    }
}
