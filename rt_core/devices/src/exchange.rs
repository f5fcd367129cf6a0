//! Devices that answer only when they are asked, or that may block: a thread of its own for each.
//!
//! Some protocols have no stream of states: the device sends its state in answer to a command ([WoodenHaptics], the
//! Novint Falcon). Other devices can be reached only through calls that block or allocate (a vendor's library). Neither
//! belongs in the tick. Such a device is an [`Exchange`]. [`Exchanged`] gives it a thread, and is the [`Device`] that
//! the tick sees.
//!
//! The tick hands its wrench over and wakes the thread, which exchanges at once. The state that comes back waits in a
//! ring for the next tick. A state is therefore older than a state that the device sends by itself, by at most one period
//! of the tick.
//!
//! The thread never repeats a force on its own, and commands none that waited while the process was stopped. Where the
//! tick hands over no wrench for [`LET_GO`], or for four periods of a slow loop ([`Exchanged::for_loop`]), the thread
//! commands zero. The state that comes back says so ([`rt_core::Rendering`]), and no wrench from before that state is
//! commanded ([`Gate`]): the force returns along the tick's ramp. Where the device is lost, the thread tries to reopen it
//! every [`RETRY`], and the device comes back without a restart of the run.
//!
//! [WoodenHaptics]: https://woodenhaptics.org

mod gate;
mod thread;

use crate::hid::watchdog_us;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Wrench};
use rtrb::{Consumer, Producer};
use runner::ring::{prefaulted, take_newest};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

pub use gate::Gate;

/// Time without a wrench from the tick after which the thread commands zero.
pub const LET_GO: Duration = Duration::from_millis(10);
/// Time between two attempts to reopen a lost device.
pub const RETRY: Duration = Duration::from_millis(100);
/// Longest time that the end of a run waits for the release of a device. A thread that blocks longer, in a vendor's
/// library, is left behind until the process ends.
const LAST_WAIT: Duration = Duration::from_secs(2);
/// Number of wrenches, and of answers, that may wait. A healthy device is never behind by more than one.
const SLOTS: usize = 4;
/// Time between two looks whether the thread has ended.
const POLL: Duration = Duration::from_micros(200);
/// Error number for a device whose thread has ended (ESHUTDOWN).
const ENDED: i32 = 108;

/// A device that takes a wrench and answers with its state. The calls may block, for a bounded time.
pub trait Exchange: Send {
    /// Sends `wrench` (N, N m on the hand, device axes), and returns the newest state of the device.
    ///
    /// # Errors
    /// [`DeviceError::Disconnected`] where the device is gone: the thread then calls [`reopen`](Self::reopen) until the
    /// device is back. Any other error is one missing state.
    fn exchange(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError>;

    /// Lets the device go: zero wrench, amplifiers off. Called at the end, whatever happened before.
    fn release(&mut self);

    /// Tries once to connect a lost device again, and brings it to the state in which it answers. Counters and clocks of
    /// the driver begin anew.
    ///
    /// # Errors
    /// As [`exchange`](Self::exchange).
    fn reopen(&mut self) -> Result<(), DeviceError>;

    /// The source of the motion to force: the thread measures it, unless the device states it.
    fn motion_to_force(&self) -> MotionSource {
        MotionSource::Thread
    }

    /// Number of wrenches that the device refused so far. `None` where the device does not tell.
    fn refused_wrenches(&self) -> Option<u64> {
        None
    }
}

/// Who knows the time from the reading of a device's encoders to the force that answers it (motion to force).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionSource {
    /// The thread: the device never tells. The thread takes the time from the request for the state to the request that
    /// brings the force (ns, clock of the program). The encoders are read a transfer after the first request, and the
    /// force acts a transfer after the second.
    Thread,
    /// The device, in its own clock (ns), where the last exchange showed the time.
    Device(Option<u64>),
}

/// The time since this call (ns): a clock for a driver.
pub(crate) fn clock() -> impl FnMut() -> u64 + Send {
    let start = Instant::now();
    move || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX)
}

/// Opens a connection: gives `first`, which is open, at the first call, and calls `again` afterwards.
pub(crate) fn first_then<T: Send>(
    first: T,
    mut again: impl FnMut() -> Result<T, i32> + Send,
) -> impl FnMut() -> Result<T, i32> + Send {
    let mut first = Some(first);
    move || first.take().map_or_else(&mut again, Ok)
}

/// The answer of one exchange.
type Answer = Result<DeviceState, DeviceError>;

/// Time without a wrench, of a loop of `period` (s), after which the thread commands zero: as the watchdog that such a
/// loop asks of a device.
pub fn let_go_after(period: f64) -> Duration {
    Duration::from_micros(watchdog_us(period).into())
}

/// What the tick hands over.
#[derive(Clone, Copy, Debug)]
struct Handed {
    wrench: Wrench,
    /// The number of the exchange whose state the wrench answers; zero where the tick had no new state.
    answers: u64,
    /// The number of the newest exchange whose state the tick has read; zero before the first.
    seen: u64,
}

impl Default for Handed {
    /// No force.
    fn default() -> Self {
        Self {
            wrench: Wrench::zero(),
            answers: 0,
            seen: 0,
        }
    }
}

/// What comes back.
#[derive(Clone, Copy, Debug)]
struct Reply {
    answer: Answer,
    /// The number of the exchange, from one.
    number: u64,
    motion_to_force_ns: Option<u64>,
    refused_wrenches: Option<u64>,
}

impl Default for Reply {
    fn default() -> Self {
        Self {
            answer: Err(DeviceError::NoReport),
            number: 0,
            motion_to_force_ns: None,
            refused_wrenches: None,
        }
    }
}

/// Counts of a device's exchanges, which any thread may read. The counts only grow.
#[derive(Debug, Default)]
pub struct Counts {
    states: AtomicU64,
    failures: AtomicU64,
    losses: AtomicU64,
    returns: AtomicU64,
    unread: AtomicU64,
    let_go: AtomicU64,
}

impl Counts {
    /// Exchanges that gave a state.
    pub fn states(&self) -> u64 {
        self.states.load(Ordering::Relaxed)
    }

    /// Exchanges that gave no state from a device that was there.
    pub fn failures(&self) -> u64 {
        self.failures.load(Ordering::Relaxed)
    }

    /// Times that the device was lost.
    pub fn losses(&self) -> u64 {
        self.losses.load(Ordering::Relaxed)
    }

    /// Times that a lost device came back.
    pub fn returns(&self) -> u64 {
        self.returns.load(Ordering::Relaxed)
    }

    /// Answers that the tick did not read in time.
    pub fn unread(&self) -> u64 {
        self.unread.load(Ordering::Relaxed)
    }

    /// Times that the thread commanded zero because the tick handed over no wrench.
    pub fn let_go(&self) -> u64 {
        self.let_go.load(Ordering::Relaxed)
    }

    fn add(count: &AtomicU64) {
        count.fetch_add(1, Ordering::Relaxed);
    }
}

/// The tick's end of a device that has a thread of its own. Dropping it releases the device, and waits up to two seconds
/// until that is done. It must not be dropped inside the tick.
pub struct Exchanged {
    wrenches: Option<Producer<Handed>>,
    replies: Consumer<Reply>,
    /// What the last read found. Without an answer, its number is zero.
    last: Reply,
    /// The number of the newest exchange whose state was read.
    seen: u64,
    refused_wrenches: Option<u64>,
    thread: Option<JoinHandle<()>>,
    capabilities: Capabilities,
    counts: Arc<Counts>,
    /// Time without a wrench after which the thread commands zero (ns).
    let_go_ns: Arc<AtomicU64>,
    /// The system's error number while the device is lost.
    gone: Option<i32>,
    clock: Continued,
}

impl Exchanged {
    /// Starts the thread of a device that is open. `capabilities` are the capabilities of the device.
    ///
    /// # Errors
    /// The error of the system, where it gave no thread.
    pub fn start(
        exchange: impl Exchange + 'static,
        capabilities: Capabilities,
    ) -> std::io::Result<Self> {
        let (wrenches, commands, _) = prefaulted(SLOTS, Handed::default());
        let (results, replies, _) = prefaulted(SLOTS, Reply::default());
        let counts = Arc::new(Counts::default());
        let let_go_ns = Arc::new(AtomicU64::new(LET_GO.as_nanos() as u64));
        let shared = (Arc::clone(&counts), Arc::clone(&let_go_ns));
        let thread = thread::start(exchange, commands, results, shared)?;
        Ok(Self {
            wrenches: Some(wrenches),
            replies,
            last: Reply::default(),
            seen: 0,
            refused_wrenches: None,
            thread: Some(thread),
            capabilities,
            counts,
            let_go_ns,
            gone: None,
            clock: Continued::default(),
        })
    }

    /// The same device for a loop of `period` (s), whose pauses between two wrenches are no silence.
    #[must_use]
    pub fn for_loop(self, period: f64) -> Self {
        let let_go_ns = let_go_after(period).as_nanos() as u64;
        self.let_go_ns.store(let_go_ns, Ordering::Relaxed);
        self
    }

    /// The counts of the exchanges, which another thread may keep and read while the device runs.
    pub fn counts(&self) -> Arc<Counts> {
        Arc::clone(&self.counts)
    }
}

impl Device for Exchanged {
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    /// The newest answer since the last read.
    fn read(&mut self, _now_ns: u64) -> Result<DeviceState, DeviceError> {
        // The end of the ring is read first, so that the answers before the end are still found below.
        let ended = self.replies.is_abandoned();
        let reply = take_newest(&mut self.replies, |reply, _| *reply);
        self.last = reply.unwrap_or_default();
        if let Some(reply) = reply {
            self.refused_wrenches = reply.refused_wrenches;
        }
        match reply.map(|reply| reply.answer) {
            Some(Ok(mut state)) => {
                self.gone = None;
                self.seen = self.last.number;
                state.device_time_ns = self.clock.advance(state.device_time_ns);
                Ok(state)
            }
            Some(Err(error)) => {
                if let DeviceError::Disconnected(number) = error {
                    self.gone = Some(number);
                }
                Err(error)
            }
            None if ended => Err(DeviceError::Disconnected(ENDED)),
            None => Err(self
                .gone
                .map_or(DeviceError::NoReport, DeviceError::Disconnected)),
        }
    }

    fn write(&mut self, _now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        if let Some(number) = self.gone {
            // The thread reopens the device and needs no wrench for that.
            return Err(DeviceError::Disconnected(number));
        }
        let (Some(ring), Some(thread)) = (&mut self.wrenches, &self.thread) else {
            return Err(DeviceError::Busy);
        };
        let state = self.last.answer.is_ok();
        let pushed = ring.push(Handed {
            wrench: *wrench,
            answers: if state { self.last.number } else { 0 },
            seen: self.seen,
        });
        thread.thread().unpark();
        pushed.map_err(|_| DeviceError::Busy)
    }

    fn motion_to_force_ns(&self) -> Option<u64> {
        self.last.motion_to_force_ns
    }

    fn refused_wrenches(&self) -> Option<u64> {
        self.refused_wrenches
    }
}

impl Drop for Exchanged {
    fn drop(&mut self) {
        self.wrenches = None;
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let start = Instant::now();
            while !thread.is_finished() {
                if start.elapsed() > LAST_WAIT {
                    return;
                }
                std::thread::sleep(POLL);
            }
            // A thread that panicked has nothing left to release.
            let _ = thread.join();
        }
    }
}

impl fmt::Debug for Exchanged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Exchanged")
            .field("capabilities", &self.capabilities)
            .field("counts", &self.counts)
            .field("gone", &self.gone)
            .finish_non_exhaustive()
    }
}

/// A clock that continues where the clock of a device starts anew, so that its time never decreases.
#[derive(Clone, Copy, Debug, Default)]
struct Continued {
    /// What is added to the device's own time (ns).
    offset: u64,
    last: u64,
}

impl Continued {
    fn advance(&mut self, time_ns: u64) -> u64 {
        let time = time_ns.saturating_add(self.offset);
        if time < self.last {
            self.offset = self.last.saturating_sub(time_ns);
            return self.last;
        }
        self.last = time;
        time
    }
}

#[cfg(test)]
mod tests;
