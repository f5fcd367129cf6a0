//! The driver `falcon`: finds, opens and boots the device that a scene names.

use super::boot::{Firmware, Tries};
use super::driver::{Falcon, Settings};
use crate::exchange::{Exchanged, clock, first_then};
use crate::found::Which;
use crate::found::known::FALCON;
use crate::ftdi::Chip;
use crate::registry::{Driver, Kind, OpenError, Request, file_of};
use crate::usbfs::{Selector, UsbDevice};
use rt_core::Capabilities;
use runner::AnyDevice;
use std::error::Error;
use std::path::Path;

/// Largest force (N) that the driver commands, whatever the profile. The limit of the torques allows this force in
/// every direction within 30 mm of the centre. The limit would shorten a larger force in a weak direction, and the
/// account of energy would not know.
pub const MOST_FORCE: f64 = 5.0;

/// The Novint Falcon. The scene names the firmware file, which the driver uploads. There is no force before the
/// operator has homed the device. To home it, the operator pulls the grip out and pushes it in once.
///
/// Addresses: none if one Falcon is connected; its serial number; or `@PORT`, its port of USB.
#[derive(Clone, Copy, Debug, Default)]
pub struct FalconDriver;

/// The Falcon that an address names; `None` if the address has no form of one.
fn selector(address: &str) -> Option<Selector> {
    let which = Which::parse(address);
    let is_port = matches!(which, Which::Port(_));
    (is_port || !address.contains([':', '/'])).then_some(Selector {
        kind: "falcon",
        numbers: FALCON.numbers,
        which,
    })
}

impl Driver for FalconDriver {
    fn name(&self) -> &'static str {
        "falcon"
    }

    fn kind(&self) -> Kind {
        Kind::Real
    }

    fn protocol(&self) -> Option<&'static str> {
        Some("falcon")
    }

    fn reaches(&self, address: &str) -> Vec<String> {
        let Some(selector) = selector(address) else {
            return Vec::new();
        };
        vec![match selector.find(Path::new("/")) {
            Ok(file) => file_of(&file),
            Err(_) => format!("Falcon {address}"),
        }]
    }

    fn open(&self, request: &Request<'_>) -> Result<AnyDevice, OpenError> {
        let refused = |source: Box<dyn Error + Send + Sync>| OpenError::Refused {
            source,
            allowed: "a Novint Falcon that is connected and may be opened",
        };
        let Some(selector) = selector(request.address) else {
            return Err(OpenError::Address {
                found: request.address.to_owned(),
                allowed: "falcon, where one Falcon is connected; falcon:SERIAL; or falcon:@PORT, with the USB port that \
                          `palpate device list` prints",
            });
        };
        let Some(file) = request.firmware else {
            let problem = "a Falcon needs its firmware: name the file by `firmware = \"FILE\"`. It is the firmware image of \
                           Novint's SDK, or the one in the folder `firmware` of a checkout of libnifalcon";
            return Err(refused(problem.into()));
        };
        let firmware = Firmware::load(file).map_err(|error| refused(Box::new(error)))?;
        let first = UsbDevice::open(&selector).map_err(|error| refused(Box::new(error)))?;
        // The thread of the device makes the later attempts, and needs only a number.
        let again = move || match UsbDevice::open(&selector) {
            Ok(usb) => Ok(Chip::new(usb)),
            Err(error) => Err(error.number()),
        };
        let open = first_then(Chip::new(first), again);
        let settings = Settings {
            firmware,
            tries: Tries::default(),
            period: request.period,
        };
        let falcon = Falcon::connect(open, clock(), settings);
        let falcon = falcon.map_err(|error| refused(Box::new(error)))?;
        let device = Exchanged::start(
            falcon,
            limited(request.model.capabilities()),
            request.period,
            request.priority,
        );
        let device = device.map_err(|error| refused(Box::new(error)))?;
        Ok(Box::new(device))
    }
}

/// The capabilities of a profile, with the largest force that the driver commands.
fn limited(profile: Capabilities) -> Capabilities {
    Capabilities {
        max_force: profile.max_force.min(MOST_FORCE),
        ..profile
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::DeviceModel;

    fn refusal(address: &str, firmware: Option<&Path>) -> String {
        let model = DeviceModel::named("falcon").expect("a built-in device");
        let request = Request {
            firmware,
            ..Request::new(&model, address)
        };
        match FalconDriver.open(&request) {
            Ok(_) => "open".to_owned(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn the_driver_has_the_protocol_of_the_emulator() {
        assert_eq!(
            (FalconDriver.name(), FalconDriver.protocol()),
            ("falcon", Some("falcon"))
        );
    }

    #[test]
    fn what_is_missing_is_named_before_anything_is_opened() {
        let text = refusal("tcp:localhost:1", None);
        assert!(text.contains("falcon:SERIAL"), "{text}");
        let text = refusal("", None);
        assert!(text.contains("firmware = \"FILE\""), "{text}");
        let text = refusal("", Some(Path::new("no/such/firmware.bin")));
        assert!(
            text.contains("no/such/firmware.bin cannot be read"),
            "{text}"
        );
    }

    #[test]
    fn the_torques_of_the_largest_force_are_within_the_limit_near_the_centre() {
        use super::super::geometry::{CENTRE, Jacobian, inverse, torque_counts, torque_of};
        use rt_core::Vec3;
        // 26 directions of the place and of the force.
        let directions: Vec<Vec3> = (0..27)
            .map(|k| {
                Vec3::new(
                    f64::from(k / 9 - 1),
                    f64::from(k / 3 % 3 - 1),
                    f64::from(k % 3 - 1),
                )
            })
            .filter_map(|direction| direction.try_normalize(0.0))
            .collect();
        for place in &directions {
            let position = CENTRE + place * 0.03;
            let angles = inverse(&position).expect("in the workspace");
            let jacobian = Jacobian::at(&position, &angles).expect("in the workspace");
            for direction in &directions {
                let torques = jacobian.torques(&(direction * MOST_FORCE));
                for (torque, count) in torques.iter().zip(torque_counts(&torques)) {
                    // The counts are rounded, and not limited.
                    assert!(
                        (torque - torque_of(count)).abs() < 1e-4,
                        "{place} {direction}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_limit_of_the_driver_holds_where_it_is_the_lower_one() {
        let profile = crate::scripted::small(rt_core::Freedom::Three);
        let with = |max_force| Capabilities {
            max_force,
            ..profile
        };
        assert_eq!(limited(with(8.0)), with(MOST_FORCE));
        assert_eq!(limited(with(2.0)), with(2.0));
    }
}
