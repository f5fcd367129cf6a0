//! Runs with all of their ticks.

use host::run::observer::{Observed, Observer, Observers};
use host::run::summary::RunSummary;
use host::run::{RunError, RunOptions, run_watched};
use host::world::World;
use rt_core::Telemetry;
use runner::link::LogRecord;
use std::sync::mpsc::{Sender, channel};

/// Gives away each tick.
struct Ticks(Sender<Telemetry>);

impl Observer for Ticks {
    fn take(&mut self, record: LogRecord<'_>) {
        if let LogRecord::Tick(telemetry) = record {
            // The receiver lives as long as the run.
            let _ = self.0.send(*telemetry);
        }
    }

    fn finish(self: Box<Self>, _observed: &mut Observed) {}
}

/// Runs a world. Returns its summary and all of its ticks.
pub fn ticks(
    world: &World<'_>,
    options: &RunOptions,
) -> Result<(RunSummary, Vec<Telemetry>), RunError> {
    let (sender, ticks) = channel();
    let observers = Observers::new().with(Ticks(sender));
    let summary = run_watched(world, options, observers, &mut |_| {})?;
    Ok((summary, ticks.try_iter().collect()))
}
