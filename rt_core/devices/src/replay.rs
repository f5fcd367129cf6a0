//! A device that returns the readings of a recorded run, one per tick.

use rt_core::Reading;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Wrench};
use std::sync::mpsc::{Sender, channel};

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
/// let mut device = ReplayDevice::new(capabilities, [Ok(DeviceState::resting())]);
/// assert_eq!(device.read(0), Ok(DeviceState::resting()));
/// assert_eq!(device.read(1_000_000), Err(DeviceError::NoReport));
/// ```
#[derive(Clone, Debug)]
pub struct ReplayDevice<R> {
    capabilities: Capabilities,
    readings: R,
}

impl<R: Iterator<Item = Reading>> ReplayDevice<R> {
    /// A device that returns `readings` in order, one per call, and then no more reports. `capabilities` are those with
    /// which the device was driven during the recording. Its profile may exceed them.
    pub fn new(
        capabilities: Capabilities,
        readings: impl IntoIterator<Item = Reading, IntoIter = R>,
    ) -> Self {
        Self {
            capabilities,
            readings: readings.into_iter(),
        }
    }
}

/// A recorded device that returns the readings from a sender, so that a long recording needs no memory.
pub fn fed(
    capabilities: Capabilities,
) -> (
    Sender<Reading>,
    ReplayDevice<impl Iterator<Item = Reading> + Send>,
) {
    let (sender, readings) = channel();
    let next = move || readings.try_recv().ok();
    let device = ReplayDevice::new(capabilities, std::iter::from_fn(next));
    (sender, device)
}

impl<R: Iterator<Item = Reading>> Device for ReplayDevice<R> {
    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    /// The next reading, whatever the time: a missed deadline has no recorded reading.
    fn read(&mut self, _now_ns: u64) -> Result<DeviceState, DeviceError> {
        self.readings.next().unwrap_or(Err(DeviceError::NoReport))
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

    const CAPABILITIES: Capabilities = Capabilities {
        sensed: Freedom::Three,
        actuated: Freedom::Three,
        max_force: 1.0,
        max_moment: 0.0,
        workspace_radius: 0.1,
        position_step: 1e-5,
    };

    #[test]
    fn readings_come_back_in_order_errors_among_them_and_then_nothing() {
        let mut state = DeviceState::resting();
        state.buttons = 3;
        let readings = [
            Ok(state),
            Err(DeviceError::Busy),
            Ok(DeviceState::resting()),
        ];
        let mut device = ReplayDevice::new(CAPABILITIES, readings);
        for expected in readings {
            assert_eq!(device.read(0), expected);
            assert_eq!(device.write(0, &Wrench::zero()), Ok(()));
        }
        assert_eq!(device.read(0), Err(DeviceError::NoReport));
        assert_eq!(device.capabilities(), CAPABILITIES);
    }

    #[test]
    fn a_fed_device_returns_each_reading_once() {
        let (sender, mut device) = fed(CAPABILITIES);
        assert_eq!(device.read(0), Err(DeviceError::NoReport));
        for buttons in 1..4 {
            let state = DeviceState {
                buttons,
                ..DeviceState::resting()
            };
            sender.send(Ok(state)).expect("the device is there");
            assert_eq!(device.read(0), Ok(state));
            assert_eq!(device.read(0), Err(DeviceError::NoReport));
        }
    }
}
