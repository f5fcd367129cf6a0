//! The devices that a run can have, as one type: no box is opened inside the tick.

use rt_core::{Capabilities, Device, DeviceError, DeviceState, Wrench};
use sim::{EnergyAccount, SimDevice, Wired};

/// A simulated device, with or without its wire.
#[derive(Debug)]
pub enum AnyDevice {
    /// Read and written directly.
    Bare(Box<SimDevice>),
    /// Behind the firmware protocol's reports.
    Wired(Box<Wired<SimDevice>>),
}

impl AnyDevice {
    /// The device itself: where it truly is, and what its motors hold.
    pub fn simulated(&self) -> &SimDevice {
        match self {
            Self::Bare(device) => device,
            Self::Wired(device) => device.device(),
        }
    }

    /// What the simulation knows of its energy, integrated between ticks.
    pub fn energy(&self) -> &EnergyAccount {
        self.simulated().energy()
    }
}

impl Device for AnyDevice {
    fn capabilities(&self) -> Capabilities {
        match self {
            Self::Bare(device) => device.capabilities(),
            Self::Wired(device) => device.capabilities(),
        }
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        match self {
            Self::Bare(device) => device.read(now_ns),
            Self::Wired(device) => device.read(now_ns),
        }
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        match self {
            Self::Bare(device) => device.write(now_ns, wrench),
            Self::Wired(device) => device.write(now_ns, wrench),
        }
    }
}
