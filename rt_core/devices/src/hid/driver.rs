//! The driver `hid` opens the device that a scene names by its numbers or by its path.

use super::{HidDevice, HidError, HidSelector};
use crate::firmware::{GreetingError, watchdog_us};
use crate::registry::{Driver, Kind, OpenError, Request};
use runner::AnyDevice;

/// Devices that speak the firmware protocol over USB HID.
///
/// Addresses: `VID:PID`, the numbers of the USB device (four hexadecimal digits each); if two devices of the same kind
/// are connected, `VID:PID:SERIAL` or `VID:PID:@PORT`, with the port of USB; or the path of the device, `/dev/hidrawN` or
/// a link that leads there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hid;

/// The allowed addresses.
const ADDRESSES: &str = "hid:VID:PID, hid:VID:PID:SERIAL or hid:VID:PID:@PORT, with the numbers of the USB device as \
                         `lsusb` prints them (four hexadecimal digits each) and its USB port as `palpate device list` \
                         prints it, or hid:/dev/hidrawN or a link that leads there";

impl Driver for Hid {
    fn name(&self) -> &'static str {
        "hid"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn reaches(&self, address: &str) -> Vec<String> {
        HidSelector::parse(address).map_or_else(Vec::new, |selector| vec![selector.reaches()])
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
        let refused = |source: HidError| OpenError::Refused {
            source: Box::new(source),
            allowed: "a device that is connected and may be opened",
        };
        let device = HidDevice::open(
            &selector,
            request.model.capabilities(),
            watchdog_us(request.period),
            request.priority,
        );
        let device = device.map_err(refused)?;
        if let Some(name) = device.name() {
            let agreed = request.name_agrees(name);
            agreed.map_err(|error| refused(GreetingError::from(error).into()))?;
        }
        request.has_firmware(device.firmware());
        Ok(Box::new(device))
    }
}
