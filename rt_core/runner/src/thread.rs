//! The thread of the tick.
//!
//! [`spawn`] starts the thread and returns once the thread is set up (core, priority, memory). The caller therefore
//! knows before the first tick which requests the system did not grant. The module `body` has the code of the thread.
//! The thread ends after a given number of ticks, on request, or by a panic. In each case it first commands zero force
//! on every device. In strict mode, the thread does not start without the grants that it requires, and a forbidden
//! system call ends the loop in the same manner.
//!
//! The loop does not depend on the host. Without the host, the loop continues to tick until it is asked to stop, and
//! the force fades to the safe hold. Dropping the [`TickThread`] asks the loop to stop.

mod body;

use crate::degradation::Degradation;
use crate::latency::{Latencies, LatencyReader, recorder};
use crate::link::{TickCounters, TickEnd};
use crate::memory::LockedMemory;
use crate::schedule::KeepAwake;
use crate::setup::{Granted, RunnerConfig};
use crate::tick_loop::{AnyDevice, TickLoop};
use crate::trap::{FilterError, ForbiddenCall};
use body::{body, message};
use rt_core::Controller;
use std::any::Any;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;

/// Stack of a thread (bytes): the default of the standard library. Threads are given this size, so that no variable of the
/// environment (`RUST_MIN_STACK`) makes the stack too small.
pub const STACK: usize = 2 << 20;

/// A request to a loop to end after the current tick.
#[derive(Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// A request that has not been made yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes the request. A request cannot be withdrawn.
    pub fn request(&self) {
        // Relaxed order is enough here and below, because the flag guards no other data.
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the request was made.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The flag itself, for a signal handler to set.
    pub fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.0)
    }
}

/// The reason why the thread could not be started.
#[derive(Debug, thiserror::Error)]
pub enum SpawnError {
    /// The period is zero.
    #[error("the period of the tick is 0 ns; it must be 1 ns or more (1000000 for 1 kHz)")]
    NoPeriod,
    /// The number of devices differs from that of the controller.
    #[error("the controller is made for {expected} devices and was given {found}")]
    Devices {
        /// Number of devices of the controller.
        expected: usize,
        /// Number of devices that were given.
        found: usize,
    },
    /// The system gave no thread.
    #[error("the system gave no thread for the tick: {0}")]
    Thread(#[from] std::io::Error),
    /// The thread ended before its first tick.
    #[error("the thread of the tick ended before its first tick")]
    Ended,
    /// The system did not grant everything that the configuration requires.
    #[error("the system did not grant what the tick requires:{}", lines(.0))]
    NotGranted(Vec<Degradation>),
    /// The system calls of the thread cannot be watched.
    #[error(transparent)]
    Filter(#[from] FilterError),
}

fn lines(degradations: &[Degradation]) -> String {
    let each = degradations.iter().map(|each| format!("\n  {each}"));
    each.collect()
}

/// A panic inside the tick. Zero force was commanded on every device before the thread ended.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the tick panicked after {ticks} ticks, and every device was commanded zero force: {message}"
)]
pub struct TickPanic {
    /// The message of the panic.
    pub message: String,
    /// Number of ticks before the panic.
    pub ticks: u64,
}

/// The result of a run.
pub struct TickReport {
    /// The devices, returned to the caller.
    pub devices: Vec<AnyDevice>,
    /// The controller, with its counters.
    pub controller: Box<Controller>,
    /// Histograms of the lateness, of the duration of a tick and of the age of the models.
    pub latencies: Latencies,
    /// Number of ticks.
    pub ticks: u64,
    /// Number of deadlines that passed while a tick was late or long. `ticks` and `missed_deadlines` add up to `slots`.
    pub missed_deadlines: u64,
    /// Largest number of consecutive deadlines that were missed.
    pub longest_miss: u64,
    /// Number of deadlines between start and end.
    pub slots: u64,
    /// Counts of the records that the rings refused and lost.
    pub link: TickCounters,
    /// Number of wrenches that a device did not accept.
    pub refused_wrenches: u64,
    /// The requests that the system did not grant to the run.
    pub degradations: Vec<Degradation>,
    /// The core to which the tick was pinned.
    pub core: Option<usize>,
    /// Whether the kernel isolates that core.
    pub isolated: bool,
    /// The priority under SCHED_FIFO that the tick had; `None` under the ordinary scheduler.
    pub priority: Option<u8>,
    /// Size of the locked memory (bytes).
    pub locked_bytes: usize,
    /// Whether the processor was kept out of its deeper sleep states.
    pub kept_awake: bool,
    /// The system call that ended the run, if one did.
    pub forbidden_call: Option<ForbiddenCall>,
    /// Number of allocations, reallocations and frees in the ticks. `None` if [`alloc_count::calls::Counting`] is not
    /// the allocator of the program.
    pub allocator_calls: Option<u64>,
}

/// The report of a run in virtual time: no deadline was missed, and the system got no request.
impl From<TickLoop> for TickReport {
    fn from(done: TickLoop) -> Self {
        Self {
            link: done.end.counters(),
            devices: done.devices,
            controller: done.controller,
            latencies: done.latencies,
            ticks: done.ticks,
            missed_deadlines: 0,
            longest_miss: 0,
            slots: done.ticks,
            refused_wrenches: done.refused_wrenches,
            degradations: Vec::new(),
            core: None,
            isolated: false,
            priority: None,
            locked_bytes: 0,
            kept_awake: false,
            forbidden_call: None,
            allocator_calls: None,
        }
    }
}

impl fmt::Debug for TickReport {
    /// The devices are left out, because they need not implement `Debug`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TickReport")
            .field("ticks", &self.ticks)
            .field("missed_deadlines", &self.missed_deadlines)
            .field("forbidden_call", &self.forbidden_call)
            .finish_non_exhaustive()
    }
}

type Outcome = Result<Box<TickReport>, TickPanic>;

/// The grants of the system that last as long as this value. The thread that joins drops the value, because dropping it
/// takes system calls that the thread of the tick may not make.
#[derive(Debug)]
struct Held {
    _awake: Option<KeepAwake>,
    _locked: LockedMemory,
}

/// A running loop. Dropping it ends the loop and waits for the end.
#[derive(Debug)]
pub struct TickThread {
    handle: Option<JoinHandle<(Outcome, Held)>>,
    stop: Arc<Stop>,
    ticks: Arc<AtomicU64>,
    tick_time: LatencyReader,
    granted: Granted,
}

/// Starts a loop over `devices` (in the order of the controller). Returns when the thread is set up, about one period
/// before the first deadline. `stop` ends the loop from outside.
///
/// # Errors
/// [`SpawnError`] if the loop cannot run. [`TickThread::degradations`] lists the requests that the system did not grant
/// to a loop that runs.
pub fn spawn(
    config: RunnerConfig,
    controller: impl Into<Box<Controller>>,
    devices: Vec<AnyDevice>,
    end: TickEnd,
    stop: Arc<Stop>,
) -> Result<TickThread, SpawnError> {
    if config.period_ns == 0 {
        return Err(SpawnError::NoPeriod);
    }
    let controller = controller.into();
    let expected = controller.safety_counters().count();
    if devices.len() != expected {
        return Err(SpawnError::Devices {
            expected,
            found: devices.len(),
        });
    }
    let mut tick_loop = Box::new(TickLoop::new(controller, devices, end));
    tick_loop.measure_devices();
    let ticks = Arc::new(AtomicU64::new(0));
    let (recorder, tick_time) = recorder(Latencies::TICK_BOUND_NS);
    let (sender, ready) = sync_channel(1);
    let theirs = (Arc::clone(&stop), Arc::clone(&ticks));
    let handle = std::thread::Builder::new()
        .stack_size(STACK)
        .name("palpate-tick".into())
        .spawn(move || body(config, tick_loop, recorder, &theirs.0, &theirs.1, &sender))?;
    let granted = match ready.recv() {
        Ok(Ok(granted)) => granted,
        Ok(Err(refusal)) => {
            // The thread ends by itself, without a tick. A panic on exit is ignored, because the refusal already names
            // the cause.
            let _ = handle.join();
            return Err(refusal);
        }
        Err(_) => return Err(SpawnError::Ended),
    };
    Ok(TickThread {
        handle: Some(handle),
        stop,
        ticks,
        tick_time,
        granted,
    })
}

impl TickThread {
    /// Number of ticks since the start. A call is one relaxed load and does not disturb the loop.
    pub fn ticks(&self) -> u64 {
        self.ticks.load(Ordering::Relaxed)
    }

    /// Reads the histogram of the duration of a tick while the loop runs, and after. Reading does not disturb the loop.
    pub fn tick_time(&self) -> LatencyReader {
        self.tick_time.clone()
    }

    /// The requests that the system did not grant to the run.
    pub fn degradations(&self) -> &[Degradation] {
        &self.granted.degradations
    }

    /// The core to which the tick is pinned.
    pub fn core(&self) -> Option<usize> {
        self.granted.core
    }

    /// The number of the thread, for the system.
    pub fn number(&self) -> i32 {
        self.granted.thread
    }

    /// The first deadline (ns, the monotonic clock). The times of the ticks count from there.
    pub fn first_deadline_ns(&self) -> u64 {
        self.granted.first_deadline_ns
    }

    /// Size of the memory that is locked for the loop (bytes).
    pub fn locked_bytes(&self) -> usize {
        self.granted.locked_bytes
    }

    /// Whether the loop has ended; a join then does not wait.
    pub fn is_finished(&self) -> bool {
        self.handle.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Asks the loop to end after the current tick.
    pub fn stop(&self) {
        self.stop.request();
    }

    /// Waits for the end of the loop. Does not ask the loop to end.
    ///
    /// # Errors
    /// [`TickPanic`] if the loop ended by a panic, for example of a device.
    pub fn join(mut self) -> Result<TickReport, TickPanic> {
        let ended = self.handle.take().map(JoinHandle::join);
        match ended {
            Some(Ok((outcome, _held))) => outcome.map(|mut report| {
                // This thread copies the histogram, because the copy takes memory.
                report.latencies.tick_time = self.tick_time.read();
                *report
            }),
            Some(Err(payload)) => Err(self.panic(payload.as_ref())),
            None => Err(self.panic(&"the thread had been joined before")),
        }
    }

    fn panic(&self, payload: &(dyn Any + Send)) -> TickPanic {
        TickPanic {
            message: message(payload),
            ticks: self.ticks(),
        }
    }
}

impl Drop for TickThread {
    fn drop(&mut self) {
        if let Some(handle) = self.handle.take() {
            self.stop.request();
            // The result is dropped, because no caller remains. The panic hook has already printed a panic.
            let _ = handle.join();
        }
    }
}
