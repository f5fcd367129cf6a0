//! The code of the thread: setup, loop, and a final command of zero force.
//!
//! For each deadline the thread sleeps, measures its lateness, ticks, and measures the duration of the tick. The hot
//! path (`run`) consists of the clock, the sleep and the tick with the calls of the devices.

use super::{Held, Outcome, SpawnError, Stop, TickPanic, TickReport};
use crate::clock::{now_ns, sleep_until};
use crate::latency::LatencyRecorder;
use crate::memory::LockedMemory;
use crate::pace::Pace;
use crate::seccomp::confine;
use crate::setup::{Granted, RunnerConfig, set_up};
use crate::tick_loop::TickLoop;
use crate::trap;
use alloc_count::calls;
use rt_core::{TickTime, Wrench};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;

/// The main function of the thread.
pub(super) fn body(
    config: RunnerConfig,
    mut tick_loop: Box<TickLoop>,
    mut tick_time: LatencyRecorder,
    stop: &Stop,
    ticks: &AtomicU64,
    sender: &SyncSender<Result<Granted, SpawnError>>,
) -> (Outcome, Held) {
    let counted = calls::are_counted();
    let mut locked = LockedMemory::new();
    let (mut granted, awake) = set_up(&config, &tick_loop, &mut locked);
    let held = Held {
        _awake: awake,
        _locked: locked,
    };
    let ready = ready(&config, &granted);
    // The first deadline is a whole period ahead, so the first tick has as much time as the others.
    granted.first_deadline_ns = now_ns().saturating_add(config.period_ns);
    let length = if ready.is_ok() { config.ticks } else { Some(0) };
    // The thread that called `spawn` waits for this message. If it no longer waits, `stop` still ends the run.
    let _ = sender.send(ready.map(|()| granted.clone()));

    let mut pace = Pace::new(granted.first_deadline_ns, config.period_ns);
    // The message may have taken a system call that a tick may not make.
    trap::clear();
    let allocated = calls::so_far();
    let ran = catch_unwind(AssertUnwindSafe(|| {
        run(
            &mut tick_loop,
            &mut tick_time,
            &mut pace,
            length,
            stop,
            ticks,
        );
    }));
    // Both are read here, because the calls of the thread from now on belong to its exit.
    let forbidden_call = trap::first();
    let allocator_calls = counted.then(|| calls::so_far() - allocated);
    let released = release_each(&mut tick_loop, pace.nominal_ns());
    if let Err(payload) = ran.and(released) {
        let panic = TickPanic {
            message: message(payload.as_ref()),
            ticks: tick_loop.ticks,
        };
        return (Err(panic), held);
    }
    let report = Box::new(TickReport {
        missed_deadlines: pace.missed(),
        longest_miss: pace.longest_miss(),
        slots: pace.slots(),
        degradations: granted.degradations,
        core: granted.core,
        isolated: granted.isolated,
        priority: granted.priority,
        locked_bytes: granted.locked_bytes,
        kept_awake: granted.kept_awake,
        forbidden_call,
        allocator_calls,
        ..TickReport::from(*tick_loop)
    });
    (Ok(report), held)
}

/// The last stage before the first tick: refuses to start if a grant that `config` requires is missing, then
/// forbids every system call that `config` does not allow.
fn ready(config: &RunnerConfig, granted: &Granted) -> Result<(), SpawnError> {
    if config.require_grants && !granted.degradations.is_empty() {
        return Err(SpawnError::NotGranted(granted.degradations.clone()));
    }
    Ok(config.calls.map_or(Ok(()), confine)?)
}

/// The loop itself: the hot path. It is a separate function in the binary, so `tests/tests/no_lock.rs` can follow every
/// function that it calls.
#[inline(never)]
fn run(
    tick_loop: &mut TickLoop,
    tick_time: &mut LatencyRecorder,
    pace: &mut Pace,
    length: Option<u64>,
    stop: &Stop,
    ticks: &AtomicU64,
) {
    let over = |done| stop.is_requested() || length.is_some_and(|length| done >= length);
    while !over(tick_loop.ticks) && !trap::noted() {
        let deadline = pace.deadline_ns();
        let woke = sleep_until(deadline);
        let time = TickTime {
            now_ns: pace.nominal_ns(),
            lateness_ns: woke.saturating_sub(deadline),
        };
        tick_loop.timed(time, || now_ns().saturating_sub(woke));
        let ended = now_ns();
        tick_time.record(ended.saturating_sub(woke));
        ticks.store(tick_loop.ticks, Ordering::Relaxed);
        pace.advance(ended);
    }
}

/// Commands zero force on every device, twice. Each write is caught separately, so a device that panics does not keep
/// the others from their command.
fn release_each(tick_loop: &mut TickLoop, now_ns: u64) -> Result<(), Box<dyn Any + Send>> {
    let mut result = Ok(());
    for _ in 0..2 {
        for device in &mut tick_loop.devices {
            let zero = Wrench::zero();
            let written = catch_unwind(AssertUnwindSafe(|| {
                // A device that refuses the command holds its last wrench until its own watchdog releases the force.
                let _ = device.write(now_ns, &zero);
            }));
            result = result.and(written);
        }
    }
    result
}

/// The message of a panic.
pub(super) fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    let owned = || payload.downcast_ref::<String>().map(String::as_str);
    text.or_else(owned)
        .unwrap_or("a panic without a message")
        .to_owned()
}
