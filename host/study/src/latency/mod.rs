//! The latency of the whole loop: how late, how often, and where from.
//!
//! A run under the real clock stamps every stage of its ticks. An observer ([`gather`]) collects the stamps by deadline
//! ([`deadlines`]), states percentiles with intervals ([`percentile`]), and keeps the worst ticks with what the kernel counted
//! around them ([`worst`]).

pub mod beside;
pub mod chart;
pub mod deadlines;
pub mod edges;
pub mod gather;
pub mod percentile;
pub mod result;
pub mod stages;
pub mod text;
pub mod worst;

use gather::{Gathered, Gatherer};
use host::run::observer::Observers;
use host::run::summary::RunSummary;
use host::run::{Progress, RunError, RunOptions, run_watched};
use host::world::World;
use std::sync::mpsc::channel;

/// Runs a world under the real clock of `options`, and collects its latencies. `progress` is called from time to time.
///
/// # Errors
/// [`RunError`].
pub fn measure(
    world: &World<'_>,
    options: &RunOptions,
    progress: &mut dyn FnMut(Progress),
) -> Result<(Gathered, RunSummary), RunError> {
    let scene = &world.loaded.scene;
    let duration = options.duration.unwrap_or(scene.duration);
    let ticks = (duration * scene.realtime.rate).round() as u64;
    let (to, gathered) = channel();
    let observers = Observers::new().with(Gatherer::new(scene, ticks, to));
    let summary = run_watched(world, options, observers, progress)?;
    // Only a log's thread that panicked sends nothing.
    let gathered = gathered
        .recv()
        .map_err(|error| RunError::Thread(std::io::Error::other(error)))?;
    Ok((gathered, summary))
}
