//! The host loop's work: stages in their order, ending in a published local model.
//!
//! `handles -> assemble -> solve -> condense -> publish`. This is the one place that joins the physics to
//! the tick. It owns no thread and reads no clock: under the real clock a thread drives it, under virtual
//! time the run's one loop does. What a stage costs is measured through the [`Stopwatch`] that the caller
//! hands in; nothing in the state depends on it.

pub mod beside;
pub mod body;
pub mod build;
pub mod choice;
mod clock;
pub mod faults;
pub mod pacer;
pub mod path;
pub mod plan;
pub mod solver;
pub mod stats;
mod stored;
pub mod virtual_coupling;

use body::HostBody;
use faults::Faults;
use pacer::Due;
use physics::fem::BodyError;
use rt_core::{LocalModel, TickRecord};
use stats::{EngineStats, Stopwatch};

/// All bodies of a scene, stepped together.
pub struct Engine {
    bodies: Vec<HostBody>,
    faults: Faults,
    stats: EngineStats,
}

impl Engine {
    /// An engine over `bodies`.
    pub fn new(bodies: Vec<HostBody>) -> Self {
        Self {
            bodies,
            faults: Faults::default(),
            stats: EngineStats::new(),
        }
    }

    /// Makes it fail on purpose.
    pub fn set_faults(&mut self, faults: Faults) {
        self.faults = faults;
    }

    /// Until when (ns) it does nothing, if a stall begins at `now_ns`: the loop that drives it waits.
    pub fn stall(&mut self, now_ns: u64) -> Option<u64> {
        self.faults.stall(now_ns)
    }

    /// The same bodies made of something else, from the next step on: `bodies` in the engine's order.
    ///
    /// # Errors
    /// [`BodyError`] where one is not of the mesh of the one it replaces.
    pub fn exchange(&mut self, bodies: Vec<HostBody>) -> Result<(), BodyError> {
        for (body, other) in self.bodies.iter_mut().zip(bodies) {
            body.exchange(other)?;
        }
        Ok(())
    }

    /// Takes one tick's record: where the hands were. Records are taken in order, none left out.
    pub fn follow(&mut self, record: &TickRecord) {
        for body in &mut self.bodies {
            body.follow(record);
        }
    }

    /// One host step of all bodies; gives `publish` a local model of each if the step is one that
    /// publishes. A body whose step fails keeps its last good state and publishes nothing: its model ages,
    /// and the tick fades its force.
    pub fn step(
        &mut self,
        due: Due,
        watch: &impl Stopwatch,
        mut publish: impl FnMut(usize, &LocalModel),
    ) {
        self.faults.panic_if_due(due.time_ns);
        self.stats.steps += 1;
        for (index, body) in self.bodies.iter_mut().enumerate() {
            match body.step(due.publishes, watch, &mut self.stats) {
                Ok(Some(model)) => {
                    let spoilt = self.faults.spoilt(due.time_ns, model);
                    publish(index, spoilt.as_ref().unwrap_or(model));
                }
                Ok(None) => {}
                Err(fault) => self.stats.fault(index, &fault),
            }
        }
    }

    /// The bodies.
    pub fn bodies(&self) -> &[HostBody] {
        &self.bodies
    }

    /// What the steps cost and met so far.
    pub fn stats(&self) -> &EngineStats {
        &self.stats
    }
}
