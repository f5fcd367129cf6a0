//! A run under virtual time: devices, hands, host and log on one clock, in one thread.
//!
//! Every tick and host step happens at a time counted in integer nanoseconds. A host step starts when it is
//! due and the host is free, sees the records of the ticks before it, and its model arrives after the
//! scene's latency. Nothing here asks the machine for the time, except the stopwatch that measures what a
//! stage costs, which never enters the state: two runs give the same bytes, whatever the load.

use super::message;
use super::setup::{HostSide, Running, Setup};
use crate::engine::stats::WallStopwatch;
use rt_core::LocalModel;
use runner::link::LogRecord;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs `setup` for its whole length. `sink` is given every tick's telemetry in order, and each model
/// before it; `progress` the ticks done, now and then.
pub fn run(
    setup: Setup,
    mut sink: impl FnMut(LogRecord<'_>),
    mut progress: impl FnMut(u64),
) -> Running {
    let Setup {
        mut tick,
        host,
        mut log,
        engine,
        pacer,
        timing,
    } = setup;
    let watch = WallStopwatch::start();
    let mut in_flight: Vec<Option<(u64, LocalModel)>> = vec![None; engine.bodies().len()];
    // As under the real clock, a host that panics is gone and the tick goes on.
    let mut host = Some(HostSide {
        engine,
        pacer,
        end: host,
    });
    let mut panicked = None;
    let mut free_at = 0;
    for k in 0..timing.ticks {
        let now = k * timing.period_ns;
        while let Some(side) = &mut host {
            for (body, slot) in in_flight.iter_mut().enumerate() {
                if let Some((_, model)) = slot.take_if(|(arrival, _)| *arrival <= now) {
                    // A full ring is counted by the link.
                    let _ = side.end.publish(body, &model);
                }
            }
            let due = side.pacer.due();
            let start = due.time_ns.max(free_at);
            if start > now {
                break;
            }
            if let Some(until_ns) = side.engine.stall(start) {
                free_at = until_ns;
                continue;
            }
            side.end.drain(|record| side.engine.follow(record));
            let stepped = catch_unwind(AssertUnwindSafe(|| {
                side.engine.step(due, &watch, |body, model| {
                    in_flight[body] = Some((start + timing.latency_ns, *model));
                });
            }));
            if let Err(panic) = stepped {
                panicked = Some(message(&*panic).to_owned());
                host = None;
                break;
            }
            if due.publishes {
                free_at = start + timing.latency_ns;
            }
            side.pacer.done(free_at.max(start));
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
        log,
        host,
        panicked,
    }
}
