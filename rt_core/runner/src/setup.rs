//! The requests of the tick's thread to the system before its first tick, and their outcome.

use crate::clock::now_ns;
use crate::cores::Cores;
use crate::degradation::Degradation;
use crate::memory::{LockedMemory, MemoryRange, STACK_AHEAD, touch_stack};
use crate::schedule::{KeepAwake, pin, realtime, sharpen_timers};
use crate::thread::RunnerConfig;
use crate::tick_loop::TickLoop;
use std::path::Path;

/// The outcome of the requests.
#[derive(Clone, Debug, Default)]
pub(crate) struct Setup {
    pub(crate) degradations: Vec<Degradation>,
    pub(crate) core: Option<usize>,
    pub(crate) isolated: bool,
    pub(crate) priority: Option<u8>,
    pub(crate) locked_bytes: usize,
    /// Whether the processor is kept out of its deeper sleep states.
    pub(crate) kept_awake: bool,
}

/// Makes all the requests of `config`, from the thread that will tick. The returned request and the locked memory must
/// be held until the last tick.
pub(crate) fn set_up(
    config: &RunnerConfig,
    tick_loop: &TickLoop,
    locked: &mut LockedMemory,
) -> (Setup, Option<KeepAwake>) {
    let mut setup = Setup::default();
    sharpen_timers();
    // The first reading of the clock finds out where the clock can be read without the kernel.
    now_ns();
    let machine = Cores::of_this_machine();
    match pin(config.core, &machine) {
        Ok(core) => {
            setup.core = core;
            setup.isolated = core.is_some_and(|core| machine.is_isolated(core));
        }
        Err(degradation) => setup.degradations.push(degradation),
    }
    match config.priority.map(realtime) {
        Some(Ok(priority)) => setup.priority = Some(priority),
        Some(Err(degradation)) => setup.degradations.push(degradation),
        None => {}
    }
    let mut awake = None;
    if config.keep_awake {
        match KeepAwake::hold(Path::new(config.wake_latency)) {
            Ok(held) => {
                awake = Some(held);
                setup.kept_awake = true;
            }
            Err(degradation) => setup.degradations.push(degradation),
        }
    }
    if config.lock_memory {
        setup.degradations.extend(lock_all(tick_loop, locked));
        setup.locked_bytes = locked.bytes();
    } else {
        touch_stack();
    }
    (setup, awake)
}

/// The memory that the tick uses, without its stack: the most important ranges first.
fn ranges(tick_loop: &TickLoop) -> Vec<MemoryRange> {
    let own = [
        MemoryRange::of(tick_loop),
        MemoryRange::of(&*tick_loop.controller),
        MemoryRange::of(tick_loop.devices.as_slice()),
    ];
    let devices = tick_loop.devices.iter();
    let devices = devices.map(|device| MemoryRange::of(&**device));
    let own = own.into_iter().chain(devices);
    own.chain(tick_loop.end.memory().iter().copied()).collect()
}

/// The bytes of the ranges and of the stack.
fn wanted(ranges: &[MemoryRange]) -> usize {
    STACK_AHEAD + ranges.iter().map(MemoryRange::bytes).sum::<usize>()
}

/// Locks the memory that the tick uses.
fn lock_all(tick_loop: &TickLoop, locked: &mut LockedMemory) -> Option<Degradation> {
    let ranges = ranges(tick_loop);
    let wanted = wanted(&ranges);
    let mut refusal = locked.lock_stack().err();
    for range in ranges {
        // A range that is refused leaves room for smaller ranges.
        let refused = locked.lock(range).err();
        refusal = refusal.or(refused);
    }
    refusal.map(|error| Degradation {
        missing: format!(
            "only {} of {wanted} bytes of the tick's memory are locked",
            locked.bytes()
        ),
        reason: error.to_string(),
        cost: "under memory pressure a tick may wait milliseconds for a page",
        remedy: format!(
            "allow {} MiB with `memlock` in /etc/security/limits.d, or LimitMEMLOCK in the service",
            wanted.div_ceil(1 << 20) + 1
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_memory_of_the_tick_is_that_of_its_stack_and_of_all_ranges() {
        let (one, other) = ([0_u8; 100], [0_u8; 24]);
        let ranges = [MemoryRange::of(&one), MemoryRange::of(&other)];
        assert_eq!(wanted(&[]), STACK_AHEAD);
        assert_eq!(wanted(&ranges), STACK_AHEAD + 124);
    }
}
