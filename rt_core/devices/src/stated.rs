//! The statements of a device about itself, compared with the profile that the scene names.
//!
//! The controller relies on the mass, the damping and the limits of the profile. A device that states other axes, a
//! much larger or smaller workspace, or less force is not the device of the profile. A driver whose devices make such
//! statements checks them when it opens a device, before anything moves, and again after a device was lost or
//! restarted.

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

use crate::models::DeviceFile;
use crate::wire::axes_of;
use core::fmt;
use firmware_proto::report::Model;
use rt_core::Capabilities;

/// Units of a report in one newton, and in one newton metre.
const UNITS: f64 = 1e6;
/// Units of a report in one metre of the workspace.
const RADIUS_UNITS: f64 = 1e7;
/// Largest ratio between the reach of a device and that of its profile. Makers measure the workspace in many ways.
const REACH: f64 = 10.0;
/// A plug-in may state less force than the profile, down to this fraction. A library may state the force that its
/// device renders continuously, or in its weakest direction. The lower limit then holds.
pub(crate) const LEAST: f64 = 0.5;

/// The name of a device's model, as in a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Name(pub [u8; 16]);

impl Name {
    /// The beginning of a text.
    pub(crate) fn new(text: &str) -> Self {
        let mut name = [0; 16];
        for (to, from) in name.iter_mut().zip(text.bytes()) {
            *to = from;
        }
        Self(name)
    }

    /// Compares the name of the device with the name in its profile (empty if the caller knows no name). If both are
    /// names of built-in devices, they must belong to the same device. A user's own device may have any name. If the
    /// names then differ, the result is a note for the user.
    ///
    /// # Errors
    /// [`Mismatch::Name`].
    pub fn agrees(&self, profile: &str) -> Result<Option<String>, Mismatch> {
        let own = self.text();
        let (stated, expected) = (plain(&own), plain(profile));
        // Names in reports are cut.
        let is_same = expected == stated || (own.len() == 16 && expected.starts_with(&stated));
        if profile.is_empty() || is_same {
            return Ok(None);
        }
        let mut built_in = crate::models::FILES
            .iter()
            .filter_map(|(key, _)| Some((*key, DeviceFile::named(key)?.name)));
        let (mut theirs, mut ours) = (None, false);
        for (key, name) in &mut built_in {
            ours |= name == profile;
            if own == key || plain(&name) == stated {
                theirs = Some(name);
            }
        }
        match theirs {
            Some(name) if name == profile => Ok(None),
            Some(_) if ours => Err(Mismatch::Name {
                name: *self,
                profile: profile.to_owned(),
            }),
            _ => Ok(Some(format!(
                "the device calls itself {self}, and its profile is that of {profile:?}"
            ))),
        }
    }

    /// The name as text.
    pub(crate) fn text(&self) -> String {
        self.bytes().map(char::from).collect()
    }

    fn bytes(&self) -> impl Iterator<Item = u8> {
        self.0.into_iter().take_while(|&byte| byte != 0)
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"")?;
        for byte in self.bytes() {
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

/// The statements of a device about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stated {
    /// The name of its model.
    pub name: Name,
    /// The axes that it senses, see [`axes`](firmware_proto::report::axes).
    pub sensed: u8,
    /// The axes that it actuates.
    pub actuated: u8,
    /// The largest force (N).
    pub max_force: f64,
    /// The largest moment (N m).
    pub max_moment: f64,
    /// The radius of the workspace (m); zero if the device states none.
    pub workspace_radius: f64,
}

impl Stated {
    /// The statements of a device of the firmware protocol.
    pub fn of(model: &Model) -> Self {
        Self {
            name: Name(model.name),
            sensed: model.sensed,
            actuated: model.actuated,
            max_force: f64::from(model.max_force) / UNITS,
            max_moment: f64::from(model.max_moment) / UNITS,
            workspace_radius: f64::from(model.workspace_radius) / RADIUS_UNITS,
        }
    }

    /// The statements of a device of this name with these capabilities.
    pub(crate) fn new(name: &str, capabilities: &Capabilities) -> Self {
        Self {
            name: Name::new(name),
            sensed: axes_of(capabilities.sensed),
            actuated: axes_of(capabilities.actuated),
            max_force: capabilities.max_force,
            max_moment: capabilities.max_moment,
            workspace_radius: capabilities.workspace_radius,
        }
    }

    /// Checks that this device agrees with `profile`, and has at least the fraction `least` of the profile's largest
    /// force and moment. Returns the limits that hold: the lower limit of each pair.
    ///
    /// # Errors
    /// [`Mismatch`].
    pub fn agree(&self, profile: &Capabilities, least: f64) -> Result<Capabilities, Mismatch> {
        let name = self.name;
        let sensed = ("senses", self.sensed, axes_of(profile.sensed));
        let actuated = ("actuates", self.actuated, axes_of(profile.actuated));
        for (verb, device, profile) in [sensed, actuated] {
            if device != profile {
                return Err(Mismatch::Freedom {
                    name,
                    verb,
                    device: AxisNames(device),
                    profile: AxisNames(profile),
                });
            }
        }
        let force = ("force", "N", self.max_force, profile.max_force);
        let moment = ("moment", "N m", self.max_moment, profile.max_moment);
        for (quantity, unit, device, profile) in [force, moment] {
            // The device rounds its limit to a unit of a report. A limit that is no number is too low.
            let is_enough = device + 1.0 / UNITS > least * profile;
            if !is_enough {
                return Err(Mismatch::Weaker {
                    name,
                    quantity,
                    unit,
                    device,
                    profile,
                });
            }
        }
        let (device, expected) = (self.workspace_radius, profile.workspace_radius);
        let is_alike = device >= expected / REACH && device <= expected * REACH;
        if device != 0.0 && !is_alike {
            return Err(Mismatch::Reach {
                name,
                device,
                profile: expected,
            });
        }
        // Limits that differ only by rounding count as equal. The profile's own number then holds.
        let lower = |device: f64, profile: f64| {
            if device + 1.0 / UNITS > profile {
                profile
            } else {
                device
            }
        };
        Ok(Capabilities {
            max_force: lower(self.max_force, profile.max_force),
            max_moment: lower(self.max_moment, profile.max_moment),
            ..*profile
        })
    }
}

/// The letters and digits of a name, in lower case.
fn plain(name: &str) -> String {
    let known = name.chars().filter(|c| c.is_alphanumeric());
    known.flat_map(char::to_lowercase).collect()
}

/// A device is not that of its profile.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Mismatch {
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
    /// The workspaces differ by more than ten times.
    #[error(
        "the workspace of the device {name} has a radius of {device:e} m, and that of its profile {profile} m: this is \
         another device's profile; name the profile of the device, or correct the workspace that the device states"
    )]
    Reach {
        /// The name of the device's model.
        name: Name,
        /// The radius of the device (m).
        device: f64,
        /// The radius of the profile (m).
        profile: f64,
    },
    /// The name is that of another built-in device.
    #[error(
        "the device calls itself {name}, and its profile is that of {profile:?}: this is another device's profile; name \
         the profile of the device"
    )]
    Name {
        /// The name of the device's model.
        name: Name,
        /// The name of the device in the profile.
        profile: String,
    },
    /// A device came back under another name.
    #[error("the device that came back calls itself {name}: it is another device")]
    Changed {
        /// The name of the device's model.
        name: Name,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceModel;
    use firmware_proto::report::axes;
    use rt_core::Freedom;

    fn falcon() -> Capabilities {
        DeviceModel::named("falcon")
            .expect("built in")
            .capabilities()
    }

    fn stated() -> Stated {
        Stated::new("falcon", &falcon())
    }

    fn agree(stated: Stated, least: f64) -> String {
        match stated.agree(&falcon(), least) {
            Ok(found) => format!("{} N, {} m", found.max_force, found.workspace_radius),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn the_lower_limit_holds() {
        let with = |max_force| Stated {
            max_force,
            ..stated()
        };
        let radius = falcon().workspace_radius;
        for (device, least, holds) in [
            (8.0, 1.0, 8.0),
            // A unit of a report less is rounding.
            (7.999_999_5, 1.0, 8.0),
            (9.0, 1.0, 8.0),
            (9.0, LEAST, 8.0),
            (5.0, LEAST, 5.0),
            (4.0, LEAST, 4.0),
        ] {
            let text = format!("{holds} N, {radius} m");
            assert_eq!(agree(with(device), least), text, "{device} {least}");
        }
        for (device, least) in [
            (7.999_99, 1.0),
            (3.9, LEAST),
            (0.1, LEAST),
            (f64::NAN, LEAST),
        ] {
            let text = format!(
                "the largest force of the device \"falcon\" is {device} N, and that of its profile 8 N: this is another \
                 device's profile; name the profile of the device"
            );
            assert_eq!(agree(with(device), least), text);
        }
        // The same of moments.
        let six = DeviceModel::named("virtuose6d")
            .expect("built in")
            .capabilities();
        let half = 0.5 * six.max_moment;
        let with = |max_moment| Stated {
            max_moment,
            ..Stated::new("virtuose6d", &six)
        };
        assert!(with(half).agree(&six, 1.0).is_err());
        assert_eq!(
            with(half).agree(&six, LEAST).map(|found| found.max_moment),
            Ok(half)
        );
    }

    #[test]
    fn other_axes_are_refused() {
        let six = Stated {
            sensed: axes::ALL,
            ..stated()
        };
        let text = "the device \"falcon\" senses the axes x y z rx ry rz, and its profile x y z: this is another \
                    device's profile; name the profile of the device";
        assert_eq!(agree(six, LEAST), text);
        let passive = Stated {
            actuated: 0,
            ..stated()
        };
        assert!(agree(passive, LEAST).contains("actuates the axes none, and its profile x y z"));
        let planar = Capabilities {
            actuated: rt_core::Axes::new([true, true, false]).map_or(Freedom::Six, Freedom::Along),
            ..falcon()
        };
        assert!(agree(Stated::new("falcon", &planar), LEAST).contains("the axes x y, and"));
    }

    #[test]
    fn a_workspace_that_the_profile_cannot_mean_is_refused() {
        let radius = falcon().workspace_radius;
        let with = |workspace_radius| Stated {
            workspace_radius,
            ..stated()
        };
        let holds = format!("8 N, {radius} m");
        // A device of the firmware protocol may state none.
        for device in [0.0, radius, 9.0 * radius, radius / 9.0] {
            assert_eq!(agree(with(device), 1.0), holds, "{device}");
        }
        for device in [1e300, 11.0 * radius, radius / 11.0, f64::NAN, f64::INFINITY] {
            let refused = agree(with(device), 1.0);
            assert!(refused.contains("another device's profile"), "{refused}");
        }
        assert!(agree(with(1e300), 1.0).contains("1e300 m"));
    }

    #[test]
    fn the_name_of_another_built_in_device_is_refused_and_an_unknown_one_is_told() {
        let name = |key: &str| DeviceFile::named(key).expect("built in").name;
        let said = |stated: &str, profile: &str| match Name::new(stated).agrees(profile) {
            Ok(note) => note.unwrap_or_default(),
            Err(error) => format!("refused: {error}"),
        };
        for key in ["falcon", "omega3", "virtuose6d", "phantom_premium"] {
            assert_eq!(said(key, &name(key)), "");
            assert_eq!(said(&name(key), &name(key)), "");
        }
        let refused = said("omega3", &name("falcon"));
        assert!(
            refused.starts_with("refused: the device calls itself \"omega3\"")
                && refused.contains("another device's profile"),
            "{refused}"
        );
        // A user's own device, its cut name, and a user's own profile.
        assert_eq!(said("lab arm", "Lab arm"), "");
        assert_eq!(
            said("Laboratory arm 2", "Laboratory arm 2 of the third floor"),
            ""
        );
        assert_eq!(said("arm", ""), "");
        // A name that is not cut is whole, and a cut one begins the other.
        assert!(said("Lab", "Laboratory arm").contains("calls itself"));
        assert!(said("Laboratory arm 2", "Laboratory arm 3").contains("calls itself"));
        for (stated, profile) in [("arm", name("falcon")), ("omega3", "My device".to_owned())] {
            let told = said(stated, &profile);
            assert!(
                told.contains(stated) && told.contains(&profile) && !told.contains("refused"),
                "{told}"
            );
        }
    }

    #[test]
    fn what_a_device_states_in_units_of_a_report_is_in_si_units_here() {
        let stated = Stated::of(&Model {
            max_force: 8_000_000,
            max_moment: 500_000,
            workspace_radius: 500_000,
            ..Model::default()
        });
        let numbers = (stated.max_force, stated.max_moment, stated.workspace_radius);
        assert_eq!(numbers, (8.0, 0.5, 0.05));
    }
}
