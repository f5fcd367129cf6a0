//! What the thread does, from beginning to end: it is set up, runs, and commands no force.
//!
//! Once a deadline: sleep, measure the lateness, tick, measure the time it took. On the hot path (`run`):
//! the clock, the sleep and the devices' own calls, nothing else.

use super::{Held, Outcome, RunnerConfig, SpawnError, Stop, TickPanic, TickReport};
use crate::clock::{now_ns, sleep_until};
use crate::memory::LockedMemory;
use crate::pace::Pace;
use crate::seccomp::confine;
use crate::setup::{Setup, set_up};
use crate::tick_loop::TickLoop;
use crate::trap;
use rt_core::Wrench;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;

/// The thread from beginning to end.
pub(super) fn body(
    config: RunnerConfig,
    mut tick_loop: Box<TickLoop>,
    stop: &Stop,
    ticks: &AtomicU64,
    tell: &SyncSender<Result<Setup, SpawnError>>,
) -> (Outcome, Held) {
    let mut locked = LockedMemory::new();
    let (setup, awake) = set_up(&config, &tick_loop, &mut locked);
    let held = Held {
        _awake: awake,
        _locked: locked,
    };
    let ready = ready(&config, &setup);
    let length = if ready.is_ok() { config.ticks } else { Some(0) };
    // Whoever started the thread is waiting for this; if they are not, the run is still theirs to end.
    let _ = tell.send(ready.map(|()| setup.clone()));

    // The first deadline is a whole period ahead, so that the first tick is as well rested as the others.
    let mut pace = Pace::new(now_ns().saturating_add(config.period_ns), config.period_ns);
    // Telling whoever waits may have taken a call that a tick may not make.
    trap::clear();
    let ran = catch_unwind(AssertUnwindSafe(|| {
        run(&mut tick_loop, &mut pace, length, stop, ticks);
    }));
    // Read here: what the thread does from now on, it does to leave.
    let forbidden_call = trap::first();
    let released = release_each(&mut tick_loop, pace.nominal_ns());
    if let Err(payload) = ran.and(released) {
        let panic = TickPanic {
            message: message(payload.as_ref()),
            ticks: tick_loop.ticks,
        };
        return (Err(panic), held);
    }
    let done = *tick_loop;
    let report = Box::new(TickReport {
        link: done.end.counters(),
        devices: done.devices,
        controller: done.controller,
        latencies: done.latencies,
        ticks: done.ticks,
        missed_deadlines: pace.missed(),
        longest_miss: pace.longest_miss(),
        slots: pace.slots(),
        refused_wrenches: done.refused_wrenches,
        degradations: setup.degradations,
        core: setup.core,
        isolated: setup.isolated,
        priority: setup.priority,
        locked_bytes: setup.locked_bytes,
        forbidden_call,
    });
    (Ok(report), held)
}

/// The last thing before the first tick: whether to go without what was not granted, and from here on no
/// system call that `config` does not allow.
fn ready(config: &RunnerConfig, setup: &Setup) -> Result<(), SpawnError> {
    if config.insist && !setup.degradations.is_empty() {
        return Err(SpawnError::NotGranted(setup.degradations.clone()));
    }
    Ok(config.calls.map_or(Ok(()), confine)?)
}

/// The loop itself: the hot path. A function of its own in the program, so that `tests/tests/no_lock.rs` can follow
/// everything that it calls.
#[inline(never)]
fn run(
    tick_loop: &mut TickLoop,
    pace: &mut Pace,
    length: Option<u64>,
    stop: &Stop,
    ticks: &AtomicU64,
) {
    let over = |done| stop.is_requested() || length.is_some_and(|length| done >= length);
    while !over(tick_loop.ticks) && !trap::noted() {
        let deadline = pace.deadline_ns();
        let woke = sleep_until(deadline);
        tick_loop.tick(pace.nominal_ns(), woke.saturating_sub(deadline));
        let ended = now_ns();
        tick_loop
            .latencies
            .tick_time
            .record(ended.saturating_sub(woke));
        ticks.store(tick_loop.ticks, Ordering::Relaxed);
        pace.advance(ended);
    }
}

/// Commands no force on every device, twice. Each by itself: one that panics must not keep the others
/// from it.
fn release_each(tick_loop: &mut TickLoop, now_ns: u64) -> Result<(), Box<dyn Any + Send>> {
    let mut result = Ok(());
    for _ in 0..2 {
        for device in &mut tick_loop.devices {
            let zero = Wrench::zero();
            let written = catch_unwind(AssertUnwindSafe(|| {
                // A device that refuses holds its last wrench until its own watchdog drops it.
                let _ = device.write(now_ns, &zero);
            }));
            result = result.and(written);
        }
    }
    result
}

/// What a panic said.
pub(super) fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let owned = || payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(owned)
        .unwrap_or("a panic without a message")
        .to_owned()
}
