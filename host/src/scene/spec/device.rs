//! `[[device]]`: haptic devices.

use super::{Hand, one};
use crate::scene::check;
use serde::Deserialize;

/// `[[device]]`: a haptic device and its hand.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// Name, unique among devices.
    pub name: String,
    /// The simulated device: the name of a built-in one, or a device file (`.toml`) with the same fields.
    #[serde(deserialize_with = "check::model_name")]
    pub model: ModelName,
    /// Whether the states and wrenches of the device pass through the 64-byte reports of the firmware protocol.
    #[serde(default = "yes")]
    pub wire: bool,
    /// Limit on the force (N), if lower than the limit of the device model.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_force: Option<f64>,
    /// Speed of the handle beyond which the force fades (m/s, device metres). Default: no limit.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_speed: Option<f64>,
    /// Reach beyond which the force fades (m, device metres). Default: no limit.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_reach: Option<f64>,
    /// Limit on the slew of the force (N/s), for a device that needs one.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub max_slew: Option<f64>,
    /// Scene metres per device metre.
    #[serde(default = "one", deserialize_with = "check::positive")]
    pub motion_scale: f64,
    /// The hand that holds the device.
    #[serde(deserialize_with = "check::table")]
    pub hand: Hand,
}

fn yes() -> bool {
    true
}

/// The name of a device model: a built-in device, or a device file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelName {
    /// The name of one of `sim::models::FILES`.
    BuiltIn(&'static str),
    /// The path of a device file, relative to the scene file. It ends in `.toml`.
    File(String),
}
