//! A device that returns the readings of a recorded run, one per tick, and its driver, `replay`.

use crate::registry::{Driver, Kind, OpenError, Request};
use rt_core::controller::Reading;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Wrench};
use runner::AnyDevice;

/// The driver of recorded devices, which return their readings again. It has no settings.
#[derive(Clone, Debug)]
pub struct Replay {
    readings: Vec<Vec<Reading>>,
}

impl Replay {
    /// A driver for devices with these readings, by index in the scene. A device beyond the list has no readings.
    pub fn new(readings: Vec<Vec<Reading>>) -> Self {
        Self { readings }
    }
}

impl Driver for Replay {
    fn name(&self) -> &'static str {
        "replay"
    }

    fn kind(&self) -> Kind {
        Kind::Recorded
    }

    fn reaches(&self, _: &str) -> Vec<String> {
        Vec::new()
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        request.no_address()?;
        let readings = self.readings.get(request.index).cloned();
        Ok(Box::new(ReplayDevice::new(
            request.model.capabilities(),
            readings.unwrap_or_default(),
        )))
    }
}

/// A recorded device. Wrenches change nothing, because the motion of the hand is recorded.
///
/// ```
/// use rt_core::{Capabilities, Device, DeviceError, DeviceState, Freedom};
/// use devices::ReplayDevice;
///
/// let capabilities = Capabilities {
///     sensed: Freedom::Three,
///     actuated: Freedom::Three,
///     max_force: 1.0,
///     max_moment: 0.0,
///     workspace_radius: 0.1,
///     position_step: 1e-5,
/// };
/// let mut device = ReplayDevice::new(capabilities, vec![Ok(DeviceState::resting())]);
/// assert_eq!(device.read(0), Ok(DeviceState::resting()));
/// assert_eq!(device.read(1_000_000), Err(DeviceError::NoReport));
/// ```
#[derive(Clone, Debug)]
pub struct ReplayDevice {
    capabilities: Capabilities,
    readings: Vec<Reading>,
    next: usize,
}

impl ReplayDevice {
    /// A device that returns `readings` in order, one per call, and then no more reports.
    pub fn new(capabilities: Capabilities, readings: Vec<Reading>) -> Self {
        Self {
            capabilities,
            readings,
            next: 0,
        }
    }
}

impl Device for ReplayDevice {
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    /// The next reading, whatever the time: a missed deadline has no recorded reading.
    fn read(&mut self, _now_ns: u64) -> Result<DeviceState, DeviceError> {
        let reading = self.readings.get(self.next).copied();
        self.next = self.next.saturating_add(1);
        reading.unwrap_or(Err(DeviceError::NoReport))
    }

    /// Never fails.
    fn write(&mut self, _now_ns: u64, _wrench: &Wrench) -> Result<(), DeviceError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Freedom;

    #[test]
    fn readings_come_back_in_order_errors_among_them_and_then_nothing() {
        let capabilities = Capabilities {
            sensed: Freedom::Three,
            actuated: Freedom::Three,
            max_force: 1.0,
            max_moment: 0.0,
            workspace_radius: 0.1,
            position_step: 1e-5,
        };
        let mut state = DeviceState::resting();
        state.buttons = 3;
        let readings = vec![
            Ok(state),
            Err(DeviceError::Busy),
            Ok(DeviceState::resting()),
        ];
        let mut device = ReplayDevice::new(capabilities, readings.clone());
        for expected in readings {
            assert_eq!(device.read(0), expected);
            assert_eq!(device.write(0, &Wrench::zero()), Ok(()));
        }
        assert_eq!(device.read(0), Err(DeviceError::NoReport));
        assert_eq!(device.capabilities(), capabilities);
    }
}
