//! Known haptic devices, as plain numbers.
//!
//! Force, position step, workspace and rate are the makers' figures or what their drivers report, unless
//! marked. **Moving mass, friction and damping at the handle are published for few devices**; where a
//! figure is an estimate of ours its field says so. Estimates are of the right order, no more: a conclusion
//! that depends on one needs a measurement of the device at hand.

/// The mechanics, encoder and motors of a three-degree-of-freedom device, the same in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceModel {
    /// Mass that moves with the handle (kg), above zero.
    pub mass: f64,
    /// Viscous damping of the mechanism (N s/m).
    pub damping: f64,
    /// Coulomb friction of the mechanism (N), at rest as in motion.
    pub friction: f64,
    /// Position change of one encoder count (m), above zero.
    pub position_step: f64,
    /// Length of the largest force vector (N).
    pub max_force: f64,
    /// Radius of the largest ball inside the workspace (m). There are no end stops: it is only reported.
    pub workspace_radius: f64,
    /// Rate at which the device is usually driven (Hz).
    pub rate_hz: u32,
}

/// Novint Falcon. Mass, damping and friction are not published: estimates.
pub const FALCON: DeviceModel = DeviceModel {
    mass: 0.15,    // estimate
    damping: 0.5,  // estimate
    friction: 0.3, // estimate
    position_step: 0.038e-3,
    max_force: 8.0,
    workspace_radius: 0.04,
    rate_hz: 1000,
};

/// 3D Systems Touch (formerly Phantom Omni). Position step, friction and damping are estimates.
pub const TOUCH: DeviceModel = DeviceModel {
    mass: 0.045,
    damping: 0.05,           // estimate
    friction: 0.26,          // estimate
    position_step: 0.055e-3, // estimate
    max_force: 3.3,
    workspace_radius: 0.075,
    rate_hz: 1000,
};

/// Phantom Premium 1.5, forces only. Position step and damping are estimates.
pub const PHANTOM_PREMIUM: DeviceModel = DeviceModel {
    mass: 0.075,
    damping: 0.005, // estimate
    friction: 0.04,
    position_step: 0.03e-3, // estimate
    max_force: 8.5,
    workspace_radius: 0.12,
    rate_hz: 1000,
};

/// Force Dimension omega.3. Position step, mass, damping and friction are estimates.
pub const OMEGA3: DeviceModel = DeviceModel {
    mass: 0.2,              // estimate
    damping: 0.1,           // estimate
    friction: 0.1,          // estimate
    position_step: 0.01e-3, // estimate
    max_force: 12.0,
    workspace_radius: 0.075,
    rate_hz: 4000,
};

/// All of them, under the names by which scenes call them.
pub const ALL: [(&str, DeviceModel); 4] = [
    ("falcon", FALCON),
    ("touch", TOUCH),
    ("phantom_premium", PHANTOM_PREMIUM),
    ("omega3", OMEGA3),
];

impl DeviceModel {
    /// The device of that name in [`ALL`].
    pub fn named(name: &str) -> Option<Self> {
        ALL.iter()
            .find(|(known, _)| *known == name)
            .map(|(_, model)| *model)
    }
}
