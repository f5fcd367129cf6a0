//! The requests of the tick's thread to the system before its first tick, and their outcome.

use crate::clock::now_ns;
use crate::cores::{CoreChoice, Cores};
use crate::degradation::Degradation;
use crate::memory::{LockedMemory, MemoryRange, STACK_AHEAD, touch_stack};
use crate::schedule::{DEFAULT_PRIORITY, KeepAwake, WAKE_LATENCY, pin, realtime, sharpen_timers};
use crate::seccomp::CallPolicy;
use crate::tick_loop::TickLoop;
use rustix::thread::gettid;
use std::path::Path;

/// The cost of memory that is not locked.
pub const COST_OF_UNLOCKED_MEMORY: &str =
    "under memory pressure a tick may wait milliseconds for a page";

/// Configuration of the thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunnerConfig {
    /// Time between two deadlines (ns).
    pub period_ns: u64,
    /// Number of ticks; `None`: until asked to stop. Missed deadlines do not count.
    pub ticks: Option<u64>,
    /// The core of the thread.
    pub core: CoreChoice,
    /// Priority under SCHED_FIFO (1 to 99); `None`: stay under the ordinary scheduler.
    pub priority: Option<u8>,
    /// Whether to lock the memory of the loop. The memory is touched in advance in any case.
    pub lock_memory: bool,
    /// Whether to keep the processor out of its deeper sleep states.
    pub keep_awake: bool,
    /// The file in which the latency is requested: [`WAKE_LATENCY`], or a file that replaces it in tests.
    pub wake_latency: &'static str,
    /// Whether to refuse to start if the system does not grant one of the items above.
    pub require_grants: bool,
    /// The system calls that the thread may make; any other call ends the loop. `None`: the calls are not watched.
    pub calls: Option<CallPolicy>,
}

impl Default for RunnerConfig {
    /// 1 kHz until asked to stop, with every privilege that the system grants.
    fn default() -> Self {
        Self {
            period_ns: 1_000_000,
            ticks: None,
            core: CoreChoice::default(),
            priority: Some(DEFAULT_PRIORITY),
            lock_memory: true,
            keep_awake: true,
            wake_latency: WAKE_LATENCY,
            require_grants: false,
            calls: None,
        }
    }
}

/// What the system granted, and what it did not.
#[derive(Clone, Debug, Default)]
pub(crate) struct Granted {
    pub(crate) degradations: Vec<Degradation>,
    pub(crate) core: Option<usize>,
    pub(crate) isolated: bool,
    pub(crate) priority: Option<u8>,
    pub(crate) locked_bytes: usize,
    /// Whether the processor is kept out of its deeper sleep states.
    pub(crate) kept_awake: bool,
    /// The number of the thread.
    pub(crate) thread: i32,
    /// The first deadline (ns, the monotonic clock).
    pub(crate) first_deadline_ns: u64,
}

/// Makes all the requests of `config`, from the thread that will tick. The returned request and the locked memory must
/// be held until the last tick.
pub(crate) fn set_up(
    config: &RunnerConfig,
    tick_loop: &TickLoop,
    locked: &mut LockedMemory,
) -> (Granted, Option<KeepAwake>) {
    let mut granted = Granted {
        thread: gettid().as_raw_nonzero().get(),
        ..Granted::default()
    };
    sharpen_timers();
    // The first reading of the clock finds the code that reads the clock without the kernel.
    now_ns();
    let machine = Cores::of_this_machine();
    match pin(config.core, &machine) {
        Ok(core) => {
            granted.core = core;
            granted.isolated = core.is_some_and(|core| machine.is_isolated(core));
        }
        Err(degradation) => granted.degradations.push(degradation),
    }
    match config.priority.map(realtime) {
        Some(Ok(priority)) => granted.priority = Some(priority),
        Some(Err(degradation)) => granted.degradations.push(degradation),
        None => {}
    }
    let mut awake = None;
    if config.keep_awake {
        match KeepAwake::hold(Path::new(config.wake_latency)) {
            Ok(held) => {
                awake = Some(held);
                granted.kept_awake = true;
            }
            Err(degradation) => granted.degradations.push(degradation),
        }
    }
    if config.lock_memory {
        granted.degradations.extend(lock_all(tick_loop, locked));
        granted.locked_bytes = locked.bytes();
    } else {
        touch_stack();
    }
    (granted, awake)
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
        cost: COST_OF_UNLOCKED_MEMORY,
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
