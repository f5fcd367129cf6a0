//! Why a device over a stream is not used, and whether a device is that of its profile.

#![cfg_attr(
    not(test),
    deny(
        clippy::arithmetic_side_effects,
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

use crate::wire::axes_of;
use core::fmt;
use firmware_proto::host::HostError;
use firmware_proto::report::{Model, ReportError, Sends};
use rt_core::Capabilities;

/// Error number of a device that is not the one of the profile (ENODEV).
pub(super) const NO_DEVICE: i32 = 19;
/// Error number of a device that says nothing (ETIMEDOUT).
pub(super) const TIMED_OUT: i32 = 110;
/// Units of a report in one newton, and in one newton metre.
const UNITS: f64 = 1e6;

/// Why a device is not used.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SerialError {
    /// The connection could not be opened, or ended during the greeting.
    #[error("the connection ended (system error {0}); check the cable and the power of the device")]
    Ended(i32),
    /// Nothing came.
    #[error(
        "the device did not answer within a second. Check its address, its power, and that its firmware speaks version 2 \
         of the firmware protocol over this line"
    )]
    Silent,
    /// Bytes came, but no report.
    #[error(
        "the device did not answer within a second, and its bytes are no packets of the firmware protocol. Check its \
         address, and the speed of a serial line (tty:PATH@BAUD)"
    )]
    Garbage,
    /// The device sends states, but does not answer.
    #[error(
        "the device sends states, but did not answer the greeting within a second. Check the line towards the device"
    )]
    Deaf,
    /// The device sends reports that are not used.
    #[error("the device did not answer within a second: {0}")]
    Refused(HostError),
    /// The device speaks another version of the protocol.
    #[error("{0}")]
    Version(ReportError),
    /// The device sends the counts of its encoders.
    #[error(
        "the device {name} sends the counts of its encoders, and this driver has no kinematics; use a firmware that \
         sends poses"
    )]
    Counts {
        /// The name of the device's model.
        name: Name,
    },
    /// The degrees of freedom differ.
    #[error(
        "the device {name} {verb} the axes {device}, and its profile {profile}: this is another device's profile; name \
         the profile of the device"
    )]
    Freedom {
        /// The name of the device's model.
        name: Name,
        /// Senses or actuates.
        verb: &'static str,
        /// The axes of the device.
        device: AxisNames,
        /// The axes of the profile.
        profile: AxisNames,
    },
    /// The device is weaker than its profile.
    #[error(
        "the largest {quantity} of the device {name} is {device} {unit}, and that of its profile {profile} {unit}: this \
         is another device's profile; name the profile of the device"
    )]
    Weaker {
        /// The name of the device's model.
        name: Name,
        /// Force or moment.
        quantity: &'static str,
        /// Its unit.
        unit: &'static str,
        /// The largest of the device.
        device: f64,
        /// The largest of the profile.
        profile: f64,
    },
}

impl SerialError {
    /// The system's error number that says most.
    pub(super) fn number(self) -> i32 {
        match self {
            Self::Ended(number) => number,
            Self::Silent | Self::Garbage | Self::Deaf | Self::Refused(_) => TIMED_OUT,
            _ => NO_DEVICE,
        }
    }
}

/// The name of a device's model, as a report has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name(pub [u8; 16]);

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"")?;
        for byte in self.0.into_iter().take_while(|&byte| byte != 0) {
            write!(f, "{}", char::from(byte).escape_default())?;
        }
        f.write_str("\"")
    }
}

/// Axes of a handle, see [`axes`](firmware_proto::report::axes).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisNames(pub u8);

impl fmt::Display for AxisNames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut bits = self.0;
        let mut between = "";
        for name in ["x", "y", "z", "rx", "ry", "rz"] {
            if bits & 1 != 0 {
                write!(f, "{between}{name}")?;
                between = " ";
            }
            bits >>= 1;
        }
        f.write_str(if between.is_empty() { "none" } else { "" })
    }
}

/// Checks that a device is as strong as `profile` at least, and has the same degrees of freedom.
pub(super) fn check(model: &Model, profile: &Capabilities) -> Result<(), SerialError> {
    let name = Name(model.name);
    if model.sends != Sends::Poses {
        return Err(SerialError::Counts { name });
    }
    let sensed = ("senses", model.sensed, axes_of(profile.sensed));
    let actuated = ("actuates", model.actuated, axes_of(profile.actuated));
    for (verb, device, profile) in [sensed, actuated] {
        if device != profile {
            return Err(SerialError::Freedom {
                name,
                verb,
                device: AxisNames(device),
                profile: AxisNames(profile),
            });
        }
    }
    let force = ("force", "N", model.max_force, profile.max_force);
    let moment = ("moment", "N m", model.max_moment, profile.max_moment);
    for (quantity, unit, device, profile) in [force, moment] {
        let device = f64::from(device) / UNITS;
        // The device rounds its limit to a unit.
        if device + 1.0 / UNITS <= profile {
            return Err(SerialError::Weaker {
                name,
                quantity,
                unit,
                device,
                profile,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceModel;
    use firmware_proto::report::axes;

    fn model() -> Model {
        Model {
            sensed: axes::TRANSLATIONS,
            actuated: axes::TRANSLATIONS,
            max_force: 8_000_000,
            rate: [1000; 2],
            name: *b"falcon\0\0\0\0\0\0\0\0\0\0",
            ..Model::default()
        }
    }

    fn refused(model: &Model) -> String {
        let profile = DeviceModel::named("falcon")
            .expect("built in")
            .capabilities();
        check(model, &profile).map_or_else(|error| error.to_string(), |()| "agreed".to_owned())
    }

    #[test]
    fn another_devices_profile_is_refused_with_both_numbers() {
        assert_eq!(refused(&model()), "agreed");
        let stronger = Model {
            max_force: 9_000_000,
            ..model()
        };
        assert_eq!(refused(&stronger), "agreed");
        let weaker = Model {
            max_force: 7_999_999,
            ..model()
        };
        let text = "the largest force of the device \"falcon\" is 7.999999 N, and that of its profile 8 N: this is \
                    another device's profile; name the profile of the device";
        assert_eq!(refused(&weaker), text);
        let six = Model {
            sensed: axes::ALL,
            ..model()
        };
        let text = "the device \"falcon\" senses the axes x y z rx ry rz, and its profile x y z: this is another \
                    device's profile; name the profile of the device";
        assert_eq!(refused(&six), text);
        let passive = Model {
            actuated: 0,
            ..model()
        };
        assert!(refused(&passive).contains("actuates the axes none, and its profile x y z"));
        let counts = Model {
            sends: Sends::Counts { encoders: 3 },
            ..model()
        };
        assert!(refused(&counts).contains("counts of its encoders"));
    }
}
