//! Devices that answer only when they are asked, or that may block. Each gets a thread of its own.
//!
//! Some protocols have no stream of states: the device sends its state in answer to a command ([WoodenHaptics], the
//! Novint Falcon). Other devices can be reached only through calls that block or allocate (a vendor's library). Neither
//! kind belongs in the tick. A device of either kind is an [`Exchange`]. [`Exchanged`] gives the device a thread, and
//! is the [`Device`] that the tick sees.
//!
//! The tick hands its wrench over and wakes the thread, which exchanges at once. The state that comes back waits in a
//! ring for the next tick. Such a state is therefore older than a state of a device that sends its states by itself, by
//! at most one period of the tick.
//!
//! [`Poller`] decides the actions of the thread. [`TickEnd`] decides what the tick reads and hands over. Both are state
//! machines without a thread, a clock or a ring. The thread drives them by the real clock, and `sim::emulated` by
//! virtual time.
//!
//! [WoodenHaptics]: https://woodenhaptics.org

mod gate;
mod poller;
mod thread;
mod tick_end;

use crate::firmware::watchdog_us;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Wrench};
use rtrb::{Consumer, Producer};
use runner::ring::{prefaulted, take_newest};
use std::fmt;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

pub use poller::{Handed, Poller, RETRY_NS, Reply, Step};
pub use tick_end::TickEnd;

/// Number of wrenches, and of replies, that may wait. A healthy device is never behind by more than one.
pub const SLOTS: usize = 4;
/// Longest time that the end of a run waits for the release of a device. If a vendor's library blocks the thread for
/// longer, the thread stays until the process ends.
const LAST_WAIT: Duration = Duration::from_secs(2);
/// Time between two checks whether the thread has ended.
const POLL: Duration = Duration::from_micros(200);
/// Error number for a device whose thread has ended (ESHUTDOWN).
const ENDED: i32 = 108;

/// A device that takes a wrench and answers with its state. The calls may block, for a bounded time.
pub trait Exchange: Send {
    /// Sends `wrench` (N, N m on the hand, device axes), and returns the newest state of the device.
    ///
    /// # Errors
    /// [`DeviceError::Disconnected`] if the device is gone. The thread then calls [`reopen`](Self::reopen) until the
    /// device is back. Any other error counts as one missing state.
    fn exchange(&mut self, wrench: &Wrench) -> Result<DeviceState, DeviceError>;

    /// Releases the device: zero wrench, amplifiers off. The thread calls this function at the end in every case.
    fn release(&mut self);

    /// Tries once to connect a lost device again, and brings it to the state in which it answers. Counters and clocks of
    /// the driver begin anew.
    ///
    /// # Errors
    /// The same errors as those of [`exchange`](Self::exchange).
    fn reopen(&mut self) -> Result<(), DeviceError>;

    /// The source of the motion to force: the thread measures it, unless the device states it.
    fn motion_to_force(&self) -> MotionSource {
        MotionSource::Thread
    }

    /// Number of wrenches that the device refused so far. `None` if the device does not report it.
    fn refused_wrenches(&self) -> Option<u64> {
        None
    }
}

/// The source of the motion to force: the time from the reading of a device's encoders to the force that answers this
/// reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionSource {
    /// The thread, for a device that never reports the time. The thread measures the time from the request for the
    /// state to the request that brings the force (ns, clock of the program). The encoders are read a transfer after
    /// the first request, and the force acts a transfer after the second.
    Thread,
    /// The device, in its own clock (ns). `None` if the last exchange did not show the time.
    Device(Option<u64>),
}

/// The time since this call (ns): a clock for a driver.
pub(crate) fn clock() -> impl FnMut() -> u64 + Send {
    let start = Instant::now();
    move || u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX)
}

/// Opens a connection. The first call returns `first`, which is open already. Later calls call `again`.
pub(crate) fn first_then<T: Send>(
    first: T,
    mut again: impl FnMut() -> Result<T, i32> + Send,
) -> impl FnMut() -> Result<T, i32> + Send {
    let mut first = Some(first);
    move || first.take().map_or_else(&mut again, Ok)
}

/// Time without a wrench after which the poller commands zero, for a loop of `period` (s). The time equals the watchdog
/// that such a loop asks of a device: ten milliseconds, or four periods of a slow loop.
pub fn let_go_after(period: f64) -> Duration {
    Duration::from_micros(watchdog_us(period).into())
}

/// The tick's end of a device that has a thread of its own. Dropping this end releases the device, and waits up to two
/// seconds for the release. This end must not be dropped inside the tick.
pub struct Exchanged {
    wrenches: Option<Producer<Handed>>,
    replies: Consumer<Reply>,
    end: TickEnd,
    thread: Option<JoinHandle<()>>,
    capabilities: Capabilities,
}

impl Exchanged {
    /// Starts the thread of a device that is open, for a loop of `period` (s). `capabilities` are the capabilities of the
    /// device, and `priority` is that of the thread under SCHED_FIFO (1 to 99).
    ///
    /// # Errors
    /// The error of the system, if it gave no thread.
    pub fn start(
        exchange: impl Exchange + 'static,
        capabilities: Capabilities,
        period: f64,
        priority: u8,
    ) -> std::io::Result<Self> {
        let (wrenches, commands, _) = prefaulted(SLOTS, Handed::default());
        let (results, replies, _) = prefaulted(SLOTS, Reply::default());
        let thread = thread::start(exchange, commands, results, let_go_after(period), priority)?;
        Ok(Self {
            wrenches: Some(wrenches),
            replies,
            end: TickEnd::default(),
            thread: Some(thread),
            capabilities,
        })
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
        let reading = self.end.read(reply);
        if ended && reply.is_none() {
            return Err(DeviceError::Disconnected(ENDED));
        }
        reading
    }

    fn write(&mut self, _now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        let handed = self.end.hand(wrench)?;
        let (Some(ring), Some(thread)) = (&mut self.wrenches, &self.thread) else {
            return Err(DeviceError::Busy);
        };
        let pushed = ring.push(handed);
        thread.thread().unpark();
        pushed.map_err(|_| DeviceError::Busy)
    }

    fn motion_to_force_ns(&self) -> Option<u64> {
        self.end.motion_to_force_ns()
    }

    fn refused_wrenches(&self) -> Option<u64> {
        self.end.refused_wrenches()
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
            .field("end", &self.end)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests;
