//! The driver `hid` opens the device that the settings in a scene name.

use super::{HidDevice, HidSelector};
use crate::registry::{Driver, Kind, OpenError, Request};
use runner::AnyDevice;

/// Devices that speak the firmware protocol over USB HID.
///
/// Settings: `vendor` and `product`, the numbers of the USB device; `serial`, where two devices of the same kind are
/// connected.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hid;

/// Settings of this driver.
const SETTINGS: [&str; 3] = ["vendor", "product", "serial"];

impl Driver for Hid {
    fn name(&self) -> &'static str {
        "hid"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        let settings = &request.settings;
        settings.only(&SETTINGS)?;
        let selector = HidSelector {
            vid: settings.number_u16("vendor")?,
            pid: settings.number_u16("product")?,
            serial: settings.text("serial")?,
        };
        match HidDevice::open(&selector, request.model.capabilities()) {
            Ok(device) => Ok(Box::new(device)),
            Err(error) => Err(OpenError::Refused {
                source: Box::new(error),
                allowed: "a device that is connected and may be opened",
            }),
        }
    }
}
