//! A device with scheduled faults: a wrapper around any other device, with a list of faults.

use devices::AnyDevice;
use rt_core::{
    Capabilities, Corruption, Device, DeviceError, DeviceState, Probe, Rendering, Wrench,
};
use std::ops::Range;

/// A fault of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The device sends no report.
    Silent,
    /// The device is disconnected: reads and writes fail, and its motors hold no force.
    Gone,
    /// Reports and commands are lost in transit: no report arrives, and the motors hold no force. Writes succeed.
    Vanished,
    /// The reports of the device are damaged.
    Corrupt(Corruption),
    /// The device sends a position with a NaN.
    NotANumber,
    /// The device accepts no wrench, and holds the last wrench.
    RefusesCommands,
    /// The device lets go: its motors hold no force, and its states report that. The device refuses the wrenches, and
    /// counts them.
    LetsGo,
    /// The device lets go as under `LetsGo`, because of a fault with this number.
    Broken(u8),
}

/// A device with faults, each in a span of time (ns). The device inside moves during a fault, too.
pub struct Faulty {
    device: AnyDevice,
    faults: Vec<(Range<u64>, Fault)>,
    /// Wrenches that the faults refused.
    refused_wrenches: u64,
}

/// Error number of a disconnected device (ENODEV).
const NO_DEVICE: i32 = 19;

impl Faulty {
    /// Wraps `device` with faults. If two faults overlap, the first in the list acts.
    pub fn new(device: AnyDevice, faults: Vec<(Range<u64>, Fault)>) -> Self {
        Self {
            device,
            faults,
            refused_wrenches: 0,
        }
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
            None | Some(Fault::RefusesCommands) => state,
            Some(Fault::LetsGo) => Ok(DeviceState {
                rendering: Rendering::LetGo,
                ..state?
            }),
            Some(Fault::Broken(fault)) => Ok(DeviceState {
                rendering: Rendering::Fault(fault),
                ..state?
            }),
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
            Some(Fault::RefusesCommands) => Err(DeviceError::Busy),
            Some(Fault::Gone) => {
                self.device.write(now_ns, &Wrench::zero())?;
                Err(DeviceError::Disconnected(NO_DEVICE))
            }
            Some(Fault::Vanished) => self.device.write(now_ns, &Wrench::zero()),
            Some(Fault::LetsGo | Fault::Broken(_)) => {
                self.refused_wrenches += 1;
                self.device.write(now_ns, &Wrench::zero())
            }
            _ => self.device.write(now_ns, wrench),
        }
    }

    fn probe(&self) -> Option<Probe> {
        self.device.probe()
    }

    fn refused_wrenches(&self) -> Option<u64> {
        let own = self.device.refused_wrenches().unwrap_or(0);
        Some(own.saturating_add(self.refused_wrenches))
    }
}
