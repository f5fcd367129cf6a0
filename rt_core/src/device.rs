//! What a haptic device is to the loop: a state to read, a wrench to write, and what it can do.
//!
//! Everything that stands in for a device (a simulation, a recording) and everything that wraps one (a
//! fault injector, a tracer) implements the same [`Device`], so no part of the loop special-cases them.

use crate::geometry::{Pose, Twist, Vec3, Wrench};

/// What one read of a device gives, in the device's own axes, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceState {
    /// Where the end effector is. A device that senses no rotation reports the identity.
    pub pose: Pose,
    /// How fast it moves, as the driver estimates it.
    pub twist: Twist,
    /// One bit a button, lowest first.
    pub buttons: u32,
    /// The device's own clock (ns), counted on from its wrapping counter.
    pub device_time_ns: u64,
}

impl DeviceState {
    /// Centred, at rest, no button pressed.
    pub fn resting() -> Self {
        Self {
            pose: Pose::identity(),
            twist: Twist::zero(),
            buttons: 0,
            device_time_ns: 0,
        }
    }

    /// Whether every number in it is finite.
    pub fn is_finite(&self) -> bool {
        self.pose.is_finite() && self.twist.is_finite()
    }
}

/// Which degrees of freedom a device senses or actuates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Translation only.
    Three,
    /// Translation and rotation.
    Six,
}

/// What a device can do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    /// Degrees of freedom that it senses.
    pub sensed: Freedom,
    /// Degrees of freedom that it actuates.
    pub actuated: Freedom,
    /// Largest force (N).
    pub max_force: f64,
    /// Largest moment (N m); zero where it actuates none.
    pub max_moment: f64,
    /// Radius of the largest ball inside its workspace (m), about the device's origin.
    pub workspace_radius: f64,
    /// Position change of one encoder count (m).
    pub position_step: f64,
}

/// What only a simulation knows of its device. For summaries and certificates: the law never asks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Where the end effector truly is (device axes), as no encoder sees it.
    pub pose: Pose,
    /// How fast it truly moves.
    pub twist: Twist,
    /// The wrench that the motors hold (device axes): the last one written, shortened to the device's largest.
    pub held: Wrench,
    /// Work of the motors so far (J), integrated between ticks.
    pub motor_work: f64,
    /// Work that the device did on the hand so far (J), at the port between the two, integrated between ticks.
    pub on_hand: f64,
}

/// Why a report cannot be used, whatever the protocol that it is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Corruption {
    /// It is too short or too long.
    #[error("its length is wrong")]
    Length,
    /// Its bytes were changed on their path.
    #[error("its check sum is wrong")]
    CheckSum,
    /// It is of another version of the protocol.
    #[error("it is of another version of the protocol")]
    Version,
    /// It is of another kind than was due.
    #[error("it is of another kind")]
    Kind,
    /// One of its fields holds what no sender should send.
    #[error("one of its fields is out of range")]
    Range,
}

/// Why a device gave no state or took no wrench.
///
/// `Copy` and without text, so that it may be made inside the tick; its `Display` is for afterwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// Nothing new since the last read.
    #[error("the device sent no report since the last tick")]
    NoReport,
    /// The device is gone.
    #[error("the device is no longer connected (system error {0})")]
    Disconnected(i32),
    /// A report came that cannot be trusted.
    #[error("the device sent a report that cannot be used: {0}")]
    Corrupt(Corruption),
    /// The wrench could not be handed on, because earlier ones still wait.
    #[error("the device did not take the last wrench yet")]
    Busy,
}

/// A haptic device as the loop sees it.
///
/// Inside the tick neither method may allocate, lock, format or wait.
pub trait Device {
    /// What it can do; constant while it is connected.
    fn capabilities(&self) -> Capabilities;

    /// Its newest state. `now_ns` is the tick's nominal time.
    ///
    /// # Errors
    /// [`DeviceError`] where there is nothing new or nothing that can be trusted; the loop then keeps the
    /// last state and counts.
    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError>;

    /// Commands a wrench (on the hand, device axes), held until the next.
    ///
    /// # Errors
    /// [`DeviceError`] where the device cannot take it.
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError>;

    /// What only a simulation knows of it; `None` for a real device and for a recorded one. A wrapper hands on what
    /// the device inside tells.
    fn probe(&self) -> Option<Probe> {
        None
    }
}

impl<D: Device + ?Sized> Device for &mut D {
    fn capabilities(&self) -> Capabilities {
        (**self).capabilities()
    }
    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        (**self).read(now_ns)
    }
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        (**self).write(now_ns, wrench)
    }
    fn probe(&self) -> Option<Probe> {
        (**self).probe()
    }
}

/// The distance by which `position` (m, device axes) lies outside the ball-shaped workspace.
pub fn outside_workspace(capabilities: &Capabilities, position: &Vec3) -> f64 {
    (position.norm() - capabilities.workspace_radius).max(0.0)
}
