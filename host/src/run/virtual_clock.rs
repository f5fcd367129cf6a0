//! A run under virtual time: devices, hands, host and log on one clock, in one thread.
//!
//! Every tick and host step happens at a time counted in integer nanoseconds. A host step starts when it is
//! due and the host is free, sees the records of the ticks before it, and its model arrives after the
//! scene's latency. Nothing here asks the machine for the time, except the stopwatch that measures what a
//! stage costs, which never enters the state: two runs give the same bytes, whatever the load.

use super::setup::{Running, Setup};
use crate::engine::stats::WallStopwatch;
use rt_core::LocalModel;
use runner::link::LogRecord;

/// Runs `setup` for its whole length. `sink` is given every tick's telemetry in order, and each model
/// before it; `progress` the ticks done, now and then.
pub fn run(
    setup: Setup,
    mut sink: impl FnMut(LogRecord<'_>),
    mut progress: impl FnMut(u64),
) -> Running {
    let Setup {
        mut tick,
        mut host,
        mut log,
        mut engine,
        mut pacer,
        timing,
    } = setup;
    let watch = WallStopwatch::start();
    let mut in_flight: Vec<Option<(u64, LocalModel)>> = vec![None; engine.bodies().len()];
    let mut free_at = 0;
    for k in 0..timing.ticks {
        let now = k * timing.period_ns;
        loop {
            for (body, slot) in in_flight.iter_mut().enumerate() {
                if let Some((_, model)) = slot.take_if(|(arrival, _)| *arrival <= now) {
                    // A full ring is counted by the link.
                    let _ = host.publish(body, &model);
                }
            }
            let due = pacer.due();
            let start = due.time_ns.max(free_at);
            if start > now {
                break;
            }
            host.drain(|record| engine.follow(record));
            engine.step(due, &watch, |body, model| {
                in_flight[body] = Some((start + timing.latency_ns, *model));
            });
            if due.publishes {
                free_at = start + timing.latency_ns;
            }
            pacer.done(free_at.max(start));
        }
        tick.tick(now, 0);
        log.records(&mut sink);
        if k % 256 == 0 {
            progress(k);
        }
    }
    tick.release(timing.ticks * timing.period_ns);
    Running {
        tick,
        host,
        log,
        engine,
        pacer,
    }
}
