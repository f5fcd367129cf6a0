//! The common part of the drivers of the firmware protocol, over any connection: the reasons to refuse a device, the
//! comparison with its profile, the watchdog that the driver asks for, and the session.

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

use crate::stated::{Mismatch, Name, Stated};
use firmware_proto::host::HostError;
use firmware_proto::report::{Model, ReportError, Sends, WATCHDOG_MOST_US, WATCHDOG_US};
use rt_core::Capabilities;
use std::hash::{BuildHasher, RandomState};
use std::num::NonZeroU32;

/// Error number of a device that is not the one of the profile (ENODEV).
pub(crate) const NO_DEVICE: i32 = 19;
/// Error number of a device that does not answer (ETIMEDOUT).
pub(crate) const TIMED_OUT: i32 = 110;

/// The reason why a device is not used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GreetingError {
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
    /// The driver refuses the reports of the device.
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
    /// The device is not that of its profile.
    #[error(transparent)]
    Profile(#[from] Mismatch),
}

impl GreetingError {
    /// The system's error number that describes the reason best.
    pub(crate) fn number(&self) -> i32 {
        match self {
            Self::Ended(number) => *number,
            Self::Silent | Self::Garbage | Self::Deaf | Self::Refused(_) => TIMED_OUT,
            _ => NO_DEVICE,
        }
    }
}

/// Checks that a device sends poses, agrees with `profile` and has the whole force of the profile. Returns the limits
/// that hold.
pub(crate) fn check(model: &Model, profile: &Capabilities) -> Result<Capabilities, GreetingError> {
    if model.sends != Sends::Poses {
        let name = Name(model.name);
        return Err(GreetingError::Counts { name });
    }
    Ok(Stated::of(model).agree(profile, 1.0)?)
}

/// The watchdog for a loop of a period (s): four ticks, so that a late tick does not count as silence, but not less
/// than the device's own watchdog.
pub(crate) fn watchdog_us(period: f64) -> u32 {
    // The conversion saturates.
    let ticks = (period * 4e6) as u32;
    ticks.clamp(WATCHDOG_US, WATCHDOG_MOST_US)
}

/// A session that another host can have only by chance. The number is random: the standard library draws the keys of
/// its hashes at random.
pub(crate) fn session() -> NonZeroU32 {
    let number = RandomState::new().hash_one(0_u8);
    NonZeroU32::new(number as u32).unwrap_or(NonZeroU32::MAX)
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
        match check(model, &profile) {
            Ok(limits) => format!("agreed on {} N", limits.max_force),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn another_devices_profile_is_refused_with_both_numbers() {
        assert_eq!(refused(&model()), "agreed on 8 N");
        let stronger = Model {
            max_force: 9_000_000,
            ..model()
        };
        assert_eq!(refused(&stronger), "agreed on 8 N");
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
        let far = Model {
            workspace_radius: u32::MAX,
            ..model()
        };
        assert!(refused(&far).contains("4.294967295e2 m"));
        let counts = Model {
            sends: Sends::Counts { encoders: 3 },
            ..model()
        };
        assert!(refused(&counts).contains("counts of its encoders"));
    }

    #[test]
    fn each_error_has_the_number_that_says_most() {
        let counts = GreetingError::Counts {
            name: Name::new("arm"),
        };
        for (error, number) in [
            (GreetingError::Ended(5), 5),
            (GreetingError::Silent, 110),
            (GreetingError::Garbage, 110),
            (GreetingError::Deaf, 110),
            (counts, 19),
        ] {
            assert_eq!(error.number(), number, "{error}");
        }
    }

    #[test]
    fn a_slow_loop_asks_for_a_longer_watchdog() {
        let watchdogs = [1e-4, 1e-3, 2.5e-3, 5e-3, 1.0].map(watchdog_us);
        assert_eq!(watchdogs, [10_000, 10_000, 10_000, 20_000, 100_000]);
    }
}
