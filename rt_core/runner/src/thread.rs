//! The thread that ticks.
//!
//! [`spawn`] starts it and returns once it is set up (core, priority, memory), so that what it has to do
//! without is known before the first tick. What it does then is in `body`. It ends after a given number of
//! ticks, when asked to, or by a panic; in each case every device is first commanded no force. Where it is
//! asked to be strict, it does not start without what it asked for, and a system call that it may not make
//! ends it in the same order.
//!
//! The host may come and go: the loop ticks on without it (the force fades to the safe hold) until it is
//! asked to stop. Dropping the [`TickThread`] asks.

mod body;

use crate::cores::CoreChoice;
use crate::degradation::Degradation;
use crate::latency::Latencies;
use crate::link::{TickCounters, TickEnd};
use crate::memory::LockedMemory;
use crate::schedule::{DEFAULT_PRIORITY, KeepAwake, WAKE_LATENCY};
use crate::seccomp::{CallPolicy, FilterError, ForbiddenCall};
use crate::setup::Setup;
use crate::tick_loop::{AnyDevice, TickLoop};
use body::{body, message};
use rt_core::Controller;
use std::any::Any;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread::JoinHandle;

/// How the thread runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunnerConfig {
    /// From one deadline to the next (ns).
    pub period_ns: u64,
    /// How many ticks to do; `None`: until asked to stop. Deadlines that are missed are not among them.
    pub ticks: Option<u64>,
    /// Which core to run on.
    pub core: CoreChoice,
    /// Priority under SCHED_FIFO (1 to 99); `None`: stay under the ordinary scheduler.
    pub priority: Option<u8>,
    /// Whether to lock the loop's memory. It is touched ahead in any case.
    pub lock_memory: bool,
    /// Whether to keep the processor out of its deeper sleep states.
    pub keep_awake: bool,
    /// Where that is asked for: [`WAKE_LATENCY`], or a file that stands in for it.
    pub wake_latency: &'static str,
    /// Whether to refuse to start where the system does not grant one of the above.
    pub insist: bool,
    /// The system calls that the thread may make; any other ends the loop. `None`: nobody looks.
    pub calls: Option<CallPolicy>,
}

impl Default for RunnerConfig {
    /// 1 kHz until asked to stop, with everything that the system gives.
    fn default() -> Self {
        Self {
            period_ns: 1_000_000,
            ticks: None,
            core: CoreChoice::default(),
            priority: Some(DEFAULT_PRIORITY),
            lock_memory: true,
            keep_awake: true,
            wake_latency: WAKE_LATENCY,
            insist: false,
            calls: None,
        }
    }
}

/// Asks a loop to end after the tick it is in.
#[derive(Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Not asked yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Asks. There is no way back.
    pub fn request(&self) {
        // Relaxed here and below: the flag carries nothing but itself.
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether somebody has asked.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// The flag itself, for a signal handler to set.
    pub fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.0)
    }
}

/// Why the thread could not be started.
#[derive(Debug, thiserror::Error)]
pub enum SpawnError {
    /// A loop without a period.
    #[error("the period of the tick is 0 ns; it must be 1 ns or more (1000000 for 1 kHz)")]
    NoPeriod,
    /// Not the devices that the controller was made for.
    #[error("the controller is made for {expected} devices and was given {found}")]
    Devices {
        /// What the controller was made for.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// The system gave no thread.
    #[error("the system gave no thread to tick in: {0}")]
    Thread(#[from] std::io::Error),
    /// The thread ended before its first tick.
    #[error("the thread ended while it was being set up")]
    Setup,
    /// Not everything was granted that it insists on.
    #[error("the system did not grant what the tick insists on:{}", lines(.0))]
    NotGranted(Vec<Degradation>),
    /// Its system calls cannot be watched.
    #[error(transparent)]
    Filter(#[from] FilterError),
}

fn lines(degradations: &[Degradation]) -> String {
    let each = degradations.iter().map(|each| format!("\n  {each}"));
    each.collect()
}

/// A panic inside the tick. Every device was commanded no force before the thread ended.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the loop panicked after {ticks} ticks: {message}")]
pub struct TickPanic {
    /// What the panic said.
    pub message: String,
    /// Ticks done before.
    pub ticks: u64,
}

/// What a run leaves.
pub struct TickReport {
    /// The devices, back.
    pub devices: Vec<AnyDevice>,
    /// The controller, with its counters.
    pub controller: Controller,
    /// How late, how long, how old.
    pub latencies: Latencies,
    /// Ticks done.
    pub ticks: u64,
    /// Deadlines that passed while a tick was late or long. With `ticks` they add up to `slots`.
    pub missed_deadlines: u64,
    /// Most deadlines missed in one go.
    pub longest_miss: u64,
    /// Deadlines between start and end.
    pub slots: u64,
    /// What the rings refused and lost.
    pub link: TickCounters,
    /// Wrenches that a device did not take.
    pub refused_wrenches: u64,
    /// What the run did without.
    pub degradations: Vec<Degradation>,
    /// The core that the tick was pinned to.
    pub core: Option<usize>,
    /// Whether the kernel keeps that core aside.
    pub isolated: bool,
    /// The priority under SCHED_FIFO that the tick had; `None` under the ordinary scheduler.
    pub priority: Option<u8>,
    /// Memory held in place (bytes).
    pub locked_bytes: usize,
    /// The system call that ended the run, if one did.
    pub forbidden_call: Option<ForbiddenCall>,
}

impl fmt::Debug for TickReport {
    /// Without the devices, which need not tell of themselves.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TickReport")
            .field("ticks", &self.ticks)
            .field("missed_deadlines", &self.missed_deadlines)
            .field("forbidden_call", &self.forbidden_call)
            .finish_non_exhaustive()
    }
}

type Outcome = Result<Box<TickReport>, TickPanic>;

/// What the system granted for as long as it is held. Whoever joins the thread lets it go: that takes
/// system calls which the thread itself may not make.
#[derive(Debug)]
struct Held {
    _awake: Option<KeepAwake>,
    _locked: LockedMemory,
}

/// A running loop. Dropping it ends the loop and waits for that.
#[derive(Debug)]
pub struct TickThread {
    handle: Option<JoinHandle<(Outcome, Held)>>,
    stop: Arc<Stop>,
    ticks: Arc<AtomicU64>,
    setup: Setup,
}

/// Starts a loop over `devices` (in the controller's order). Returns when the thread is set up, about one
/// period before its first deadline. `stop` ends it from outside.
///
/// # Errors
/// [`SpawnError`] where it cannot run. What it merely has to do without is in
/// [`TickThread::degradations`].
pub fn spawn(
    config: RunnerConfig,
    controller: Controller,
    devices: Vec<AnyDevice>,
    end: TickEnd,
    stop: Arc<Stop>,
) -> Result<TickThread, SpawnError> {
    if config.period_ns == 0 {
        return Err(SpawnError::NoPeriod);
    }
    let expected = controller.safety_counters().count();
    if devices.len() != expected {
        return Err(SpawnError::Devices {
            expected,
            found: devices.len(),
        });
    }
    // On the heap: a controller with its local models takes some hundred KB.
    let tick_loop = Box::new(TickLoop::new(controller, devices, end));
    let ticks = Arc::new(AtomicU64::new(0));
    let (tell, told) = sync_channel(1);
    let theirs = (Arc::clone(&stop), Arc::clone(&ticks));
    let handle = std::thread::Builder::new()
        .name("palpate-tick".into())
        .spawn(move || body(config, tick_loop, &theirs.0, &theirs.1, &tell))?;
    let setup = match told.recv() {
        Ok(Ok(setup)) => setup,
        Ok(Err(refusal)) => {
            // It ends by itself, without a tick; what it panics with on the way is of no use to anybody.
            let _ = handle.join();
            return Err(refusal);
        }
        Err(_) => return Err(SpawnError::Setup),
    };
    Ok(TickThread {
        handle: Some(handle),
        stop,
        ticks,
        setup,
    })
}

impl TickThread {
    /// Ticks done so far. Cheap enough to ask at any rate; the loop does not notice.
    pub fn ticks(&self) -> u64 {
        self.ticks.load(Ordering::Relaxed)
    }

    /// What the run does without.
    pub fn degradations(&self) -> &[Degradation] {
        &self.setup.degradations
    }

    /// The core that the tick is pinned to.
    pub fn core(&self) -> Option<usize> {
        self.setup.core
    }

    /// Memory held in place for it (bytes).
    pub fn locked_bytes(&self) -> usize {
        self.setup.locked_bytes
    }

    /// Whether the loop has ended, so that joining does not wait.
    pub fn is_finished(&self) -> bool {
        self.handle.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Asks the loop to end after the tick it is in.
    pub fn stop(&self) {
        self.stop.request();
    }

    /// Waits for the end of the loop, without asking for it.
    ///
    /// # Errors
    /// [`TickPanic`] where the loop ended by a panic (a device's, say).
    pub fn join(mut self) -> Result<TickReport, TickPanic> {
        let ended = self.handle.take().map(JoinHandle::join);
        match ended {
            Some(Ok((outcome, _held))) => outcome.map(|report| *report),
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
            // Nobody is left to be told of a panic; the panic hook has spoken.
            let _ = handle.join();
        }
    }
}
