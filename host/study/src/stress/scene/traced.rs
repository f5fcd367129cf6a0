//! A wrapper around a simulated device that records every tick.

use super::measure::DeviceTrace;
use host::run::AnyDevice;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Pose, Wrench};
use sim::Vanishing;

/// A simulated device that records the wrench of its motors and the true position of its handle.
pub(super) struct Traced {
    device: Vanishing<AnyDevice>,
    /// The true pose of the handle at the last reading.
    truly: Pose,
    pub(super) trace: DeviceTrace,
}

impl Traced {
    /// Traces `device` for `ticks` ticks.
    pub(super) fn new(device: Vanishing<AnyDevice>, ticks: usize) -> Self {
        Self {
            device,
            truly: Pose::identity(),
            trace: DeviceTrace {
                force: Vec::with_capacity(ticks),
                moment: Vec::with_capacity(ticks),
                position: Vec::with_capacity(ticks),
                limited: Vec::with_capacity(ticks),
                body: Vec::with_capacity(ticks),
                proxy: Vec::with_capacity(ticks),
                own: Vec::new(),
            },
        }
    }

    /// The true pose of the handle at the last reading.
    pub(super) fn truly(&self) -> Pose {
        self.truly
    }

    /// Work done on the hand (J).
    pub(super) fn on_hand(&self) -> f64 {
        self.device.device().energy().on_hand()
    }
}

impl Device for Traced {
    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        let state = self.device.read(now_ns);
        let simulated = self.device.device().simulated();
        self.truly = Pose {
            position: simulated.position(),
            rotation: simulated.orientation(),
        };
        state
    }

    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        let written = self.device.write(now_ns, wrench);
        let simulated = self.device.device().simulated();
        self.trace.force.push(simulated.force());
        self.trace.moment.push(simulated.moment());
        self.trace.position.push(simulated.position());
        written
    }
}
