//! A device that fails on time: a wrapper around any other, with a list of faults.

use devices::AnyDevice;
use rt_core::{Capabilities, Corruption, Device, DeviceError, DeviceState, Probe, Wrench};
use std::ops::Range;

/// What goes wrong with a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It says nothing.
    Silent,
    /// It is gone: it says nothing, and its motors let go.
    Gone,
    /// Its reports and its commands are lost on their way: no report arrives, and its motors let go.
    Vanished,
    /// What it sends is damaged.
    Corrupt(Corruption),
    /// It sends a position that is not a number.
    NotANumber,
    /// It takes no wrench, and holds the last.
    Deaf,
}

/// A device with faults, each in a span of time (ns). The device inside moves on all the same.
pub struct Faulty {
    device: AnyDevice,
    faults: Vec<(Range<u64>, Fault)>,
}

/// Error number of a device that is gone (ENODEV).
const NO_DEVICE: i32 = 19;

impl Faulty {
    /// `device`, with faults. Of two at the same time the first counts.
    pub fn new(device: AnyDevice, faults: Vec<(Range<u64>, Fault)>) -> Self {
        Self { device, faults }
    }

    fn fault(&self, now_ns: u64) -> Option<Fault> {
        let now = self.faults.iter().find(|(span, _)| span.contains(&now_ns));
        now.map(|(_, fault)| *fault)
    }
}

impl Device for Faulty {
    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        let state = self.device.read(now_ns);
        match self.fault(now_ns) {
            None | Some(Fault::Deaf) => state,
            Some(Fault::Silent | Fault::Vanished) => Err(DeviceError::NoReport),
            Some(Fault::Gone) => Err(DeviceError::Disconnected(NO_DEVICE)),
            Some(Fault::Corrupt(what)) => Err(DeviceError::Corrupt(what)),
            Some(Fault::NotANumber) => {
                let mut state = state?;
                state.pose.position.y = f64::NAN;
                Ok(state)
            }
        }
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        match self.fault(now_ns) {
            Some(Fault::Deaf) => Err(DeviceError::Busy),
            Some(Fault::Gone) => {
                self.device.write(now_ns, &Wrench::zero())?;
                Err(DeviceError::Disconnected(NO_DEVICE))
            }
            Some(Fault::Vanished) => self.device.write(now_ns, &Wrench::zero()),
            _ => self.device.write(now_ns, wrench),
        }
    }

    fn probe(&self) -> Option<Probe> {
        self.device.probe()
    }
}
