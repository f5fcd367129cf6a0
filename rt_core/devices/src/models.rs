//! Haptic devices as data: one file per device, with the source of every number.
//!
//! The files of the built-in devices are in `rt_core/devices/models`. A user's file has the same fields, and
//! [`DeviceFile::parse`] reads it, too. Force, workspace, rate and the limits of the drivers are the makers' figures or
//! values that drivers report, unless marked. **Moving mass, friction and damping at the handle are published for few
//! devices.** The field `estimated` names the numbers that are our own estimates or second-hand figures. They are
//! correct only in their order of magnitude. A conclusion that depends on such a number needs a measurement of the
//! device.

mod file;

pub use file::{DeviceFile, ModelError, ModelProblem};

use rt_core::{Axes, Capabilities, Freedom};

/// The mechanics, encoder and motors of a device, the same in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceModel {
    /// Mass that moves with the handle (kg), above zero.
    pub mass: f64,
    /// Viscous damping of the mechanism (N s/m).
    pub damping: f64,
    /// Coulomb friction of the mechanism (N), equal at rest and in motion.
    pub friction: f64,
    /// Displacement of one encoder count (m), above zero.
    pub position_step: f64,
    /// Length of the largest force vector (N).
    pub max_force: f64,
    /// Radius of the largest ball inside the workspace (m). The model has no end stops, so the radius is only reported.
    pub workspace_radius: f64,
    /// Largest stiffness that the drivers recommend (N/m), together with `driver_damping`.
    pub driver_stiffness: f64,
    /// Largest damping that the drivers recommend (N s/m).
    pub driver_damping: f64,
    /// Usual rate of the device (Hz).
    pub rate_hz: u32,
    /// Time from the command of a wrench to its rendering by the device (s), as measured; zero if it is unknown.
    pub output_delay: f64,
    /// The axes along which the handle moves, on a device of one or two degrees of freedom; `None` if the handle moves
    /// along all three.
    pub axes: Option<Axes>,
    /// The rotation of the handle, if the device senses and actuates it.
    pub rotation: Option<RotationModel>,
}

/// The mechanics, encoder and motors of a handle's rotation, the same about all axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationModel {
    /// Moment of inertia that turns with the handle (kg m^2), above zero.
    pub inertia: f64,
    /// Viscous damping (N m s/rad).
    pub damping: f64,
    /// Coulomb friction (N m).
    pub friction: f64,
    /// Angle of one encoder count (rad), above zero.
    pub step: f64,
    /// Length of the largest moment vector (N m).
    pub max_moment: f64,
    /// Largest rotational stiffness that the drivers recommend (N m/rad).
    pub driver_stiffness: f64,
    /// Largest rotational damping that the drivers recommend (N m s/rad).
    pub driver_damping: f64,
}

/// The devices from which studies draw at random. An additional device in this list changes the draws of every seed,
/// and thus every figure of these studies.
pub const STUDIED: [&str; 6] = [
    "falcon",
    "touch",
    "phantom_premium",
    "omega3",
    "delta3",
    "virtuose6d",
];

/// The files of the built-in devices, with the names that scenes use.
pub const FILES: [(&str, &str); 9] = [
    ("falcon", include_str!("../models/falcon.toml")),
    ("touch", include_str!("../models/touch.toml")),
    (
        "phantom_premium",
        include_str!("../models/phantom_premium.toml"),
    ),
    ("omega3", include_str!("../models/omega3.toml")),
    ("delta3", include_str!("../models/delta3.toml")),
    ("virtuose6d", include_str!("../models/virtuose6d.toml")),
    ("hapkit", include_str!("../models/hapkit.toml")),
    ("pantograph", include_str!("../models/pantograph.toml")),
    (
        "woodenhaptics",
        include_str!("../models/woodenhaptics.toml"),
    ),
];

impl DeviceModel {
    /// The model of that name among [`FILES`].
    ///
    /// ```
    /// use devices::DeviceModel;
    ///
    /// let falcon = DeviceModel::named("falcon").expect("a built-in device");
    /// assert_eq!(falcon.max_force, 8.0);
    /// assert!(DeviceModel::named("falkon").is_none());
    /// ```
    pub fn named(name: &str) -> Option<Self> {
        DeviceFile::named(name).map(|file| file.model)
    }

    /// The degrees of freedom that a device of this model senses and actuates.
    pub fn freedom(&self) -> Freedom {
        match (self.axes, self.rotation) {
            (Some(axes), _) => Freedom::Along(axes),
            (None, Some(_)) => Freedom::Six,
            (None, None) => Freedom::Three,
        }
    }

    /// The model without credit for estimates: the damping and the friction that `estimated` names are zero. The account
    /// of energy of a real device may rely on no other dissipation. An estimated mass stays: the account does not rely
    /// on it, and the damping that it bounds is a fifth of the damping that is unstable.
    ///
    /// ```
    /// use devices::DeviceModel;
    ///
    /// let falcon = DeviceModel::named("falcon").expect("a built-in device");
    /// let safe = falcon.without_estimates(&["friction".to_owned()]);
    /// assert_eq!((safe.friction, safe.damping), (0.0, falcon.damping));
    /// ```
    pub fn without_estimates(&self, estimated: &[String]) -> Self {
        let credited = |name: &str, value: f64| {
            let counts = estimated.iter().all(|field| field != name);
            if counts { value } else { 0.0 }
        };
        Self {
            damping: credited("damping", self.damping),
            friction: credited("friction", self.friction),
            rotation: self.rotation.map(|rotation| RotationModel {
                damping: credited("rotation.damping", rotation.damping),
                friction: credited("rotation.friction", rotation.friction),
                ..rotation
            }),
            ..*self
        }
    }

    /// The capabilities of a device of this model.
    pub fn capabilities(&self) -> Capabilities {
        let rotation = self.rotation.as_ref();
        let freedom = self.freedom();
        Capabilities {
            sensed: freedom,
            actuated: freedom,
            max_force: self.max_force,
            max_moment: rotation.map_or(0.0, |rotation| rotation.max_moment),
            workspace_radius: self.workspace_radius,
            position_step: self.position_step,
        }
    }

    /// All models among [`FILES`], with their names.
    pub fn all() -> impl Iterator<Item = (&'static str, Self)> {
        FILES
            .iter()
            .filter_map(|(name, _)| Some((*name, Self::named(name)?)))
    }

    /// The models from which studies draw ([`STUDIED`]), with their names. Their handles move along all three axes.
    pub fn spatial() -> impl Iterator<Item = (&'static str, Self)> {
        Self::all().filter(|(name, _)| STUDIED.contains(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_file_is_a_device_with_a_source_for_each_number() {
        for (name, text) in FILES {
            let file = DeviceFile::parse(text).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(Some(file.model), DeviceModel::named(name));
            // The delay is measured on the device itself; the built-in files have the default.
            let unsourced: Vec<_> = DeviceFile::numbers(file.model.rotation.is_some())
                .filter(|number| number != "output_delay" && !file.sources.contains_key(number))
                .collect();
            assert!(unsourced.is_empty(), "{name}: no source for {unsourced:?}");
        }
        assert_eq!(DeviceModel::all().count(), FILES.len());
        assert_eq!(DeviceModel::named("tuch"), None);
    }

    /// The account of energy takes no credit for a dissipation that was never measured.
    #[test]
    fn a_dissipation_that_is_estimated_counts_as_none() {
        let model = DeviceModel::named("virtuose6d").unwrap();
        let rotation = model.rotation.unwrap();
        let all = [
            "damping",
            "friction",
            "rotation.damping",
            "rotation.friction",
        ];
        for (k, name) in all.iter().enumerate() {
            let safe = model.without_estimates(&[(*name).to_owned(), "mass".to_owned()]);
            let turning = safe.rotation.unwrap();
            let found = [
                safe.damping,
                safe.friction,
                turning.damping,
                turning.friction,
            ];
            let mut expected = [
                model.damping,
                model.friction,
                rotation.damping,
                rotation.friction,
            ];
            assert!(expected.iter().all(|value| *value > 0.0));
            expected[k] = 0.0;
            assert_eq!(found, expected, "{name}");
            assert_eq!((safe.mass, turning.inertia), (model.mass, rotation.inertia));
        }
    }

    #[test]
    fn files_have_the_numbers_of_the_makers() {
        // Spot checks against the sources that the files name.
        let model = |name| DeviceModel::named(name).unwrap();
        assert_eq!(model("falcon").max_force, 8.0);
        assert_eq!(model("touch").mass, 0.045);
        assert_eq!(model("phantom_premium").driver_stiffness, 800.0);
        assert_eq!(model("omega3").rate_hz, 4000);
        assert_eq!(model("delta3").max_force, 20.0);
        let six = DeviceModel::all().filter(|(_, model)| model.rotation.is_some());
        assert_eq!(
            six.map(|(name, _)| name).collect::<Vec<_>>(),
            ["virtuose6d"]
        );
        let few = DeviceModel::all().filter_map(|(name, model)| Some((name, model.axes?.free())));
        assert_eq!(
            few.collect::<Vec<_>>(),
            [
                ("hapkit", [true, false, false]),
                ("pantograph", [true, true, false])
            ]
        );
        assert!(DeviceModel::spatial().all(|(_, model)| model.axes.is_none()));
        assert_eq!(DeviceModel::spatial().count(), STUDIED.len());
    }
}
