//! The tick's end of a device whose reports the tick reads itself: no thread, no clock and no connection.
//!
//! A device is lost when a read fails. A device of another name than before, or one that is not that of its profile, counts
//! as lost, too, and gets no wrench.

use super::{NO_DEVICE, Reports};
use crate::firmware::check;
use crate::stated::Name;
use firmware_proto::report::LENGTH;
use rt_core::{Capabilities, DeviceError, Reading, Wrench};
use std::num::NonZeroU32;

/// The tick's end of a device.
#[derive(Clone, Debug)]
pub struct TickEnd {
    /// The protocol, with the counts of the reports.
    pub(super) reports: Reports,
    /// The limits that hold.
    pub(super) capabilities: Capabilities,
    /// The name that the device stated first. A device of another name is another device.
    pub(super) name: Option<Name>,
    /// The system's error number, while the device is lost.
    gone: Option<i32>,
}

impl TickEnd {
    /// The end of a device with a profile of these `capabilities`, in a session in which it is asked for a watchdog of
    /// `watchdog_us`. `name` is what it stated, if it was greeted before.
    pub fn new(
        session: NonZeroU32,
        watchdog_us: u32,
        capabilities: Capabilities,
        name: Option<Name>,
    ) -> Self {
        Self {
            reports: Reports::new(session, watchdog_us),
            capabilities,
            name,
            gone: None,
        }
    }

    /// The hello to write before the first tick.
    pub fn greet(&mut self) -> [u8; LENGTH] {
        self.reports.greet()
    }

    /// The error of a device that is lost; `None` of a device that is there.
    pub fn lost(&self) -> Option<DeviceError> {
        self.gone.map(DeviceError::Disconnected)
    }

    /// The device is open again.
    pub fn reopened(&mut self) {
        self.gone = None;
    }

    /// Whether the device may be the one of the profile, and the one of before.
    fn agrees(&mut self) -> bool {
        let Some(report) = self.reports.host().capabilities() else {
            // It gets no wrench before it has answered.
            return true;
        };
        let name = Name(report.model.name);
        let first = *self.name.get_or_insert(name);
        first == name && check(&report.model, &self.capabilities).is_ok()
    }

    /// The reading of the tick at `now_ns`. `next` fills the buffer with the next report that waits, and returns its
    /// length, zero for none, or the error number of the system, with which the device is lost.
    ///
    /// # Errors
    /// If no state has come, or the device is another one.
    pub fn read(
        &mut self,
        now_ns: u64,
        mut next: impl FnMut(&mut [u8]) -> Result<usize, i32>,
    ) -> Reading {
        let sensed = self.capabilities.sensed;
        let result = self.reports.newest(sensed, now_ns, |buffer| {
            next(buffer).map_err(DeviceError::Disconnected)
        });
        if let Err(DeviceError::Disconnected(number)) = result {
            self.gone = Some(number);
        }
        if self.agrees() {
            result
        } else {
            Err(DeviceError::Disconnected(NO_DEVICE))
        }
    }

    /// The report to write in the tick of `now_ns`, if any, for a `wrench` in device axes.
    ///
    /// # Errors
    /// If the device is lost, or is another one.
    pub fn command(
        &mut self,
        now_ns: u64,
        wrench: &Wrench,
    ) -> Result<Option<[u8; LENGTH]>, DeviceError> {
        if let Some(error) = self.lost() {
            return Err(error);
        }
        if !self.agrees() {
            return Err(DeviceError::Disconnected(NO_DEVICE));
        }
        Ok(self.reports.command(wrench, now_ns))
    }

    /// Number of reports that the device refused.
    pub fn refused_wrenches(&self) -> u64 {
        self.reports.refused_by_device
    }
}
