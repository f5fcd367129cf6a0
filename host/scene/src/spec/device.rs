//! `[[device]]`: haptic devices.

use super::{Hand, Rotation, one};
use crate::check;
use devices::Connection;
use nalgebra::UnitQuaternion;
use serde::Deserialize;

/// `[[device]]`: a haptic device, and the hand of a simulated one.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// Name, unique among devices.
    pub name: String,
    /// Which device it is: the name of one that is carried along, or a file (`.toml`) of one's own with
    /// the same fields.
    #[serde(deserialize_with = "check::model_name")]
    pub model: ModelName,
    /// How it is reached: `sim`, or a driver and the address of a real one, such as `hid:1209:c0de`. `model` is then its
    /// profile.
    #[serde(default = "simulated", deserialize_with = "check::connection")]
    pub connect: Connection,
    /// The firmware file of a real device that has to be given one, relative to the scene file.
    #[serde(default)]
    pub firmware: Option<String>,
    /// Simulated devices: whether states and wrenches pass through the firmware protocol's 64-byte reports; they do if
    /// not given.
    #[serde(default)]
    pub wire: Option<bool>,
    /// Largest force to ask of it (N), if lower than its own.
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
    /// The force that the motors can hold without an end (N): the limit on the root mean square of the force. Default: no
    /// limit.
    #[serde(default, deserialize_with = "check::optional_positive")]
    pub continuous_force: Option<f64>,
    /// Time constant of the motors' cooling (s).
    #[serde(default = "ten", deserialize_with = "check::positive")]
    pub heat_time: f64,
    /// The weight of the grip that the device bears while it is engaged (N, device axes). Default: the mechanism bears it.
    #[serde(default, deserialize_with = "check::optional_finite3")]
    pub grip_weight: Option<[f64; 3]>,
    /// When the device may render force.
    #[serde(default, deserialize_with = "check::table")]
    pub engage: Engage,
    /// A force that changes its sign in known ticks, for instruments that measure latency. Default: none.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub square_wave: Option<SquareWave>,
    /// Scene metres per device metre.
    #[serde(default = "one", deserialize_with = "check::positive")]
    pub motion_scale: f64,
    /// How the device stands in the scene.
    #[serde(default, deserialize_with = "check::table")]
    pub mounting: Mounting,
    /// Lowest and highest corner of the workspace (m, device axes and device metres). The handle must be in it at rest.
    /// Default: the ball of the model's workspace radius, which is only warned of.
    #[serde(default, deserialize_with = "check::optional_box")]
    pub workspace: Option<[[f64; 3]; 2]>,
    /// Simulated devices: the hand that holds it. A person holds a real one.
    #[serde(default, deserialize_with = "check::optional_table")]
    pub hand: Option<Hand>,
}

/// `[device.engage]`: when a device may render force. Buttons are counted from one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Engage {
    /// The way in which the device is armed. Default: a simulated device without `arm_button` is armed at the start; any other device
    /// waits for an order.
    #[serde(deserialize_with = "check::optional_word")]
    pub arm: Option<ArmName>,
    /// The button that arms the device, in addition to the order.
    #[serde(deserialize_with = "check::optional_button")]
    pub arm_button: Option<usize>,
    /// The button that the hand holds while the device renders force.
    #[serde(deserialize_with = "check::optional_button")]
    pub dead_man_button: Option<usize>,
    /// The button that stops all devices.
    #[serde(deserialize_with = "check::optional_button")]
    pub stop_button: Option<usize>,
    /// Time in which the force comes in (s). Default: 1 s, or 0 for a simulated device that is armed at the start. Zero
    /// gives the whole force at once only in the first tick.
    #[serde(deserialize_with = "check::optional_not_negative")]
    pub ramp: Option<f64>,
}

/// `[device.square_wave]`: a force that changes its sign in known ticks, beside the forces of bodies and tools.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SquareWave {
    /// The force on the hand in the first half of the period (N, scene axes).
    #[serde(deserialize_with = "check::finite3")]
    pub force: [f64; 3],
    /// Time between two changes (s).
    #[serde(default = "quarter", deserialize_with = "check::positive")]
    pub half_period: f64,
}

/// The way in which a device is armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ArmName {
    /// The device is armed from the start of the run.
    Start,
    /// The device waits for an order of the operator, or for its button.
    Command,
}

/// `[device.mounting]`: how a device stands in the scene. Positions pass from the device to the scene, and forces pass
/// back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Mounting {
    /// Where the device's own origin lies in the scene (m). Default: at the rest position of the handle that it holds, so
    /// that the device starts at its origin.
    #[serde(deserialize_with = "check::optional_finite3")]
    pub origin: Option<[f64; 3]>,
    /// The rotation from the device's axes to those of the scene. Default: the axes are parallel.
    #[serde(deserialize_with = "check::optional_table")]
    pub rotation: Option<Rotation>,
}

impl Mounting {
    /// The rotation from the device's axes to those of the scene.
    pub fn turn(&self) -> UnitQuaternion<f64> {
        self.rotation
            .map_or_else(UnitQuaternion::identity, Rotation::quaternion)
    }
}

/// Time in which the force of a device comes in, if the scene gives none (s).
const RAMP: f64 = 1.0;

fn quarter() -> f64 {
    0.25
}

fn ten() -> f64 {
    10.0
}

/// The driver of simulated devices.
pub const SIMULATED: &str = "sim";
/// The driver of devices that are simulated with their protocol.
pub const EMULATED: &str = "emulated";

fn simulated() -> Connection {
    Connection::parse(SIMULATED)
}

impl Device {
    /// Whether the device is armed from the start of a run.
    pub fn is_armed_at_start(&self) -> bool {
        let Engage {
            arm, arm_button, ..
        } = self.engage;
        let start = self.is_simulated() && arm_button.is_none();
        arm.map_or(start, |arm| arm == ArmName::Start)
    }

    /// Time in which the force comes in after the device was engaged (s).
    pub fn ramp(&self) -> f64 {
        let at_once = self.is_simulated() && self.is_armed_at_start();
        let usual = if at_once { 0.0 } else { RAMP };
        self.engage.ramp.unwrap_or(usual)
    }

    /// Whether the device is simulated, with its protocol or without.
    pub fn is_simulated(&self) -> bool {
        self.connect.driver == SIMULATED || self.is_emulated()
    }

    /// Whether the device is simulated with its protocol.
    pub fn is_emulated(&self) -> bool {
        self.connect.driver == EMULATED
    }
}

/// The name of a device model: a built-in device, or a device file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelName {
    /// The name of one of `sim::models::FILES`.
    BuiltIn(&'static str),
    /// The path of a device file, relative to the scene file. It ends in `.toml`.
    File(String),
}
