//! `[[device]]`: haptic devices and the hands that hold them.

use super::one;
use crate::scene::check;
use serde::Deserialize;

/// `[[device]]`: a haptic device and its hand.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// Name, unique among devices.
    pub name: String,
    /// Which simulated device: the name of one that is carried along, or a file (`.toml`) of one's own with
    /// the same fields.
    #[serde(deserialize_with = "check::model_name")]
    pub model: ModelName,
    /// Whether its states and wrenches pass through the firmware protocol's 64-byte reports.
    #[serde(default = "yes")]
    pub wire: bool,
    /// Largest force to ask of it (N), if lower than its own.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_force: Option<f64>,
    /// Speed of the handle beyond which its force fades (m/s, at the device); no limit if not given.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_speed: Option<f64>,
    /// Distance from the device's origin beyond which its force fades (m, at the device); no limit if not given.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_reach: Option<f64>,
    /// Fastest change of its force (N/s), for a device that needs such a limit.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_slew: Option<f64>,
    /// Scene metres per device metre.
    #[serde(default = "one", deserialize_with = "check::positive")]
    pub motion_scale: f64,
    /// The hand that holds it.
    #[serde(deserialize_with = "check::table")]
    pub hand: Hand,
}

fn yes() -> bool {
    true
}

/// What names a device's model: a device that is carried along, or a file of one's own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelName {
    /// One of `sim::models::FILES`, by its name there.
    BuiltIn(&'static str),
    /// A device's file, its path relative to the scene file; it ends in `.toml`.
    File(String),
}

/// `[device.hand]`: an arm that follows a trajectory.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hand {
    /// Moving mass (kg).
    #[serde(default = "hand_mass", deserialize_with = "check::positive")]
    pub mass: f64,
    /// Stiffness towards the trajectory (N/m).
    #[serde(default = "hand_stiffness", deserialize_with = "check::not_negative")]
    pub stiffness: f64,
    /// Damping (N s/m).
    #[serde(default = "hand_damping", deserialize_with = "check::not_negative")]
    pub damping: f64,
    /// Root mean square of the tremor (m).
    #[serde(default, deserialize_with = "check::not_negative")]
    pub tremor: f64,
    /// Rows `[time, x, y, z]` joined by minimum-jerk segments (s, m from the start).
    #[serde(default, deserialize_with = "check::rows4")]
    pub waypoints: Vec<[f64; 4]>,
    /// Sinusoids added to it.
    #[serde(default, deserialize_with = "check::tables")]
    pub sines: Vec<Sine>,
    /// A recorded trajectory, its path relative to the scene file (CSV: time, x, y, z).
    #[serde(default)]
    pub recording: Option<String>,
}

fn hand_mass() -> f64 {
    0.554
}
fn hand_stiffness() -> f64 {
    135.0
}
fn hand_damping() -> f64 {
    6.45
}

/// One sinusoid of a hand's trajectory.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sine {
    /// Amplitude (m).
    #[serde(deserialize_with = "check::finite3")]
    pub amplitude: [f64; 3],
    /// Frequency (Hz), at most 5.
    #[serde(deserialize_with = "check::hand_frequency")]
    pub frequency: f64,
    /// Phase (rad).
    #[serde(default, deserialize_with = "check::finite")]
    pub phase: f64,
}
