//! The tick's end of an exchange: the reading of a tick from the replies of the [`Poller`](super::Poller), and the data
//! that the tick hands over with a wrench.

use super::{Handed, Reply};
use rt_core::{DeviceError, Reading, Wrench};

/// The state of the tick's end.
#[derive(Clone, Debug, Default)]
pub struct TickEnd {
    /// The result of the last read. Without a reply, its number is zero.
    last: Reply,
    /// The number of the newest exchange whose state was read.
    seen: u64,
    refused_wrenches: Option<u64>,
    /// The system's error number while the device is lost.
    gone: Option<i32>,
    clock: Continued,
}

impl TickEnd {
    /// The reading of a tick; `newest` is the newest reply since the reading before.
    ///
    /// # Errors
    /// The error of the exchange. Without a reply: [`DeviceError::Disconnected`] while the device is lost, else
    /// [`DeviceError::NoReport`].
    pub fn read(&mut self, newest: Option<Reply>) -> Reading {
        self.last = newest.unwrap_or_default();
        let Some(reply) = newest else {
            let gone = self.gone.map(DeviceError::Disconnected);
            return Err(gone.unwrap_or(DeviceError::NoReport));
        };
        self.refused_wrenches = reply.refused_wrenches;
        match reply.answer {
            Ok(mut state) => {
                self.gone = None;
                self.seen = reply.number;
                state.device_time_ns = self.clock.advance(state.device_time_ns);
                Ok(state)
            }
            Err(error) => {
                if let DeviceError::Disconnected(number) = error {
                    self.gone = Some(number);
                }
                Err(error)
            }
        }
    }

    /// The data that the tick hands over with its `wrench` (N, N m, device axes).
    ///
    /// # Errors
    /// [`DeviceError::Disconnected`] while the device is lost: it is reopened without a wrench.
    pub fn hand(&self, wrench: &Wrench) -> Result<Handed, DeviceError> {
        if let Some(number) = self.gone {
            return Err(DeviceError::Disconnected(number));
        }
        let has_state = self.last.answer.is_ok();
        Ok(Handed {
            wrench: *wrench,
            answers: if has_state { self.last.number } else { 0 },
            seen: self.seen,
        })
    }

    /// The motion to force of the last reading (ns).
    pub fn motion_to_force_ns(&self) -> Option<u64> {
        self.last.motion_to_force_ns
    }

    /// Number of wrenches of the tick that the device refused; `None` if the device does not report it.
    pub fn refused_wrenches(&self) -> Option<u64> {
        self.refused_wrenches
    }
}

/// A clock that continues when the clock of a device starts anew, so that its time never decreases.
#[derive(Clone, Copy, Debug, Default)]
struct Continued {
    /// The offset from the device's own time (ns).
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
