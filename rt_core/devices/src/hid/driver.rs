//! The driver `hid` opens the device that a scene names by its numbers or by its path.

use super::{HidDevice, HidSelector};
use crate::registry::{Driver, Kind, OpenError, Request};
use firmware_proto::report::{WATCHDOG_MOST_US, WATCHDOG_US};
use runner::AnyDevice;

/// Devices that speak the firmware protocol over USB HID.
///
/// Addresses: `VID:PID`, the numbers of the USB device (four hexadecimal digits each); `VID:PID:SERIAL`, where two
/// devices of the same kind are connected; or `/dev/hidrawN`, the path of the device.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hid;

/// The allowed addresses.
const ADDRESSES: &str = "hid:VID:PID or hid:VID:PID:SERIAL, with the numbers of the USB device as `lsusb` prints them \
                         (four hexadecimal digits each), or hid:/dev/hidrawN";

/// The watchdog for a loop of a period (s): four ticks, so that a late tick is no silence, but not less than the
/// device's own.
pub(crate) fn watchdog_us(period: f64) -> u32 {
    // The conversion saturates.
    let ticks = (period * 4e6) as u32;
    ticks.clamp(WATCHDOG_US, WATCHDOG_MOST_US)
}

impl Driver for Hid {
    fn name(&self) -> &'static str {
        "hid"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        let Some(selector) = HidSelector::parse(request.address) else {
            let found = match request.address {
                "" => "nothing",
                address => address,
            };
            return Err(OpenError::Address {
                found: found.to_owned(),
                allowed: ADDRESSES,
            });
        };
        match HidDevice::open(
            &selector,
            request.model.capabilities(),
            watchdog_us(request.period),
        ) {
            Ok(device) => Ok(Box::new(device)),
            Err(error) => Err(OpenError::Refused {
                source: Box::new(error),
                allowed: "a device that is connected and may be opened",
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_loop_asks_for_a_longer_watchdog() {
        let watchdogs = [1e-4, 1e-3, 2.5e-3, 5e-3, 1.0].map(watchdog_us);
        assert_eq!(watchdogs, [10_000, 10_000, 10_000, 20_000, 100_000]);
    }
}
