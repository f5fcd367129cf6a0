//! The mechanics of a device, identified from a limited motion that the motors guide.
//!
//! [`Guide`] moves the free handle along one axis after another and records positions and forces. [`Guide::result`] fits
//! the mass, damping and friction of [`DeviceModel`](crate::DeviceModel) to the record, with 95 % intervals.
//! [`Identified::profile`] writes them into a device's file. The module only computes over readings: the caller owns
//! the device and the tick.
//!
//! The handle must be free: with a hand on it, the numbers would be those of the device and the arm together. A hand
//! with stiffness is noticed in the record ([`IdentifyError::Held`]). A mass that is fixed to the handle cannot be
//! noticed.

mod fit;
mod guide;
mod profile;

pub use guide::Guide;

/// A number that was identified, with its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The most likely value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

impl Estimate {
    /// Whether the interval contains a value.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// The estimate with each end at least zero, for a number that cannot be negative.
    fn not_negative(self) -> Self {
        Self {
            value: self.value.max(0.0),
            low: self.low.max(0.0),
            high: self.high.max(0.0),
        }
    }
}

/// The mechanics of a device along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisIdentified {
    /// The axis: 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Mass that moves with the handle (kg).
    pub mass: Estimate,
    /// Viscous damping (N s/m).
    pub damping: Estimate,
    /// Coulomb friction (N).
    pub friction: Estimate,
    /// Constant force on the handle that the motors do not make (N), such as weight that is not compensated.
    pub bias: f64,
    /// Number of swings in the fit.
    pub swings: usize,
    /// Root mean square of the fit's residual (m).
    pub residual: f64,
}

/// The mechanics of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// Mass that moves with the handle (kg): the mean over the axes.
    pub mass: Estimate,
    /// Viscous damping (N s/m): the mean over the axes.
    pub damping: Estimate,
    /// Coulomb friction (N): the mean over the axes.
    pub friction: Estimate,
    /// Smallest change of a position coordinate (m): one encoder count, if the device moves in counts along the axes.
    pub position_step: f64,
    /// Periods from the write of a force to its start on the handle, with any delay of the readings: 0 for a device
    /// without delay, which the reading after the write already shows. `None` if the record does not tell; delays
    /// above 5 are not tried.
    pub delay_periods: Option<f64>,
    /// Period of the ticks (s).
    pub period: f64,
    /// The numbers along each axis.
    pub axes: Vec<AxisIdentified>,
}

/// The reason why a device was not identified. After each of these errors, the force is zero.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IdentifyError {
    /// The device has no number that the motion needs.
    #[error("the device's {field} must be finite and above zero, not {found}: correct its file")]
    Senseless {
        /// Name of the number.
        field: &'static str,
        /// The value that was given.
        found: f64,
    },
    /// The handle left the allowed distance from its start.
    #[error(
        "the handle moved {:.1} mm from its start, allowed are {:.1} mm: put the handle down freely near the middle of \
         its workspace, let nobody hold it, and start again",
        found * 1e3, most * 1e3
    )]
    TooFar {
        /// Distance from the start (m).
        found: f64,
        /// Largest distance (m).
        most: f64,
    },
    /// The handle exceeded the allowed speed.
    #[error(
        "the handle moved at {found:.2} m/s, allowed are {most:.2} m/s: put the handle down freely, let nobody push it, \
         and start again"
    )]
    TooFast {
        /// Speed (m/s).
        found: f64,
        /// Largest speed (m/s).
        most: f64,
    },
    /// The device sent no usable reading for several ticks.
    #[error(
        "the device sent no usable reading for {ticks} ticks, allowed are fewer than {most}: check its connection"
    )]
    Silent {
        /// Ticks in a row without a reading.
        ticks: u32,
        /// Number of such ticks that ends the motion.
        most: u32,
    },
    /// The handle hardly moved under the largest force that is allowed.
    #[error(
        "along {} the handle moved {:.2} mm under {force:.2} N, needed are {:.2} mm: let nobody hold the handle, put it \
         down freely, and check that the motors are on",
        axis_name(*axis), moved * 1e3, needed * 1e3
    )]
    TooLittleMotion {
        /// The axis: 0, 1, 2 for x, y, z.
        axis: usize,
        /// Span of the positions (m).
        moved: f64,
        /// Span that the fit needs (m).
        needed: f64,
        /// Largest force (N).
        force: f64,
    },
    /// The motion has too few swings to separate mass, damping and friction.
    #[error(
        "along {} the motion has {found} usable swings, needed are {needed}: let nobody hold the handle and put it down \
         freely",
        axis_name(*axis)
    )]
    TooFewSwings {
        /// The axis: 0, 1, 2 for x, y, z.
        axis: usize,
        /// Number of swings.
        found: usize,
        /// Number of swings that the fit needs.
        needed: usize,
    },
    /// The handle moved as if a spring held it.
    #[error(
        "along {} the handle moves as if a spring of {stiffness:.0} N/m held it: let nobody hold the handle, put it down \
         freely, away from its stops",
        axis_name(*axis)
    )]
    Held {
        /// The axis: 0, 1, 2 for x, y, z.
        axis: usize,
        /// Stiffness that the record shows (N/m).
        stiffness: f64,
    },
    /// The motion is not that of a mass with damping and friction.
    #[error(
        "along {} the motion differs by {:.3} mm from that of a mass with damping and friction: let nobody touch the \
         handle, and keep it away from its stops",
        axis_name(*axis), residual * 1e3
    )]
    Disturbed {
        /// The axis: 0, 1, 2 for x, y, z.
        axis: usize,
        /// Root mean square of the fit's residual (m).
        residual: f64,
    },
}

/// The name of an axis.
fn axis_name(axis: usize) -> &'static str {
    match axis {
        0 => "x",
        1 => "y",
        _ => "z",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_contains_its_ends_and_nothing_beyond() {
        let estimate = Estimate {
            value: 1.5,
            low: 1.0,
            high: 2.0,
        };
        for (value, contains) in [(1.0, true), (2.0, true), (0.9, false), (2.1, false)] {
            assert_eq!(estimate.contains(value), contains, "{value}");
        }
        let below = Estimate {
            value: -1.0,
            low: -2.0,
            high: 0.5,
        };
        let found = below.not_negative();
        assert_eq!((found.value, found.low, found.high), (0.0, 0.0, 0.5));
    }

    #[test]
    fn an_error_names_its_axis() {
        for (axis, name) in ["x", "y", "z"].iter().enumerate() {
            let text = IdentifyError::Held {
                axis,
                stiffness: 50.0,
            }
            .to_string();
            assert!(
                text.starts_with(&format!("along {name} the handle")),
                "{text}"
            );
        }
    }

    #[test]
    fn a_number_that_was_identified_is_no_estimate_any_more() {
        let estimate = |value: f64| Estimate {
            value,
            low: 0.5 * value,
            high: 2.0 * value,
        };
        let axis = |axis, mass| AxisIdentified {
            axis,
            mass: estimate(mass),
            damping: estimate(10.0 * mass),
            friction: estimate(0.1 * mass),
            bias: 0.0,
            swings: 40,
            residual: 3e-6,
        };
        let mut base = crate::DeviceFile::named("virtuose6d").expect("a built-in device");
        base.estimated = ["mass", "friction", "rotation.friction"]
            .map(str::to_owned)
            .into();
        let found = Identified {
            mass: estimate(0.321_04),
            damping: estimate(4.5),
            friction: estimate(0.25),
            position_step: 1e-5,
            delay_periods: Some(1.5),
            period: 1e-3,
            axes: vec![axis(0, 0.3), axis(2, 0.4)],
        };
        let file = crate::DeviceFile::parse(&found.profile(&base, "2026-01-14")).expect("a file");
        assert_eq!(file.estimated, ["rotation.friction"]);
        let model = &file.model;
        let numbers = (
            model.mass,
            model.damping,
            model.friction,
            model.output_delay,
        );
        assert_eq!(numbers, (0.321, 4.5, 0.25, 1.5e-3));
        for (name, told) in [
            ("mass", "0.1605 to 0.6421 kg; x 0.3, z 0.4"),
            ("damping", "2.25 to 9.0 N s/m; x 3.0, z 4.0"),
            ("friction", "0.125 to 0.5 N; x 0.03, z 0.04"),
        ] {
            let expected =
                "identified by guided motion on 2026-01-14: 95 % interval ".to_owned() + told;
            assert_eq!(file.sources[name], expected);
        }
    }
}
