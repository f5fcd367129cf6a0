//! The interface of a haptic device to the loop: the loop reads a state, writes a wrench, and asks for the
//! capabilities.
//!
//! A simulation, a recording and a wrapper (a fault injector, a tracer) all implement the same [`Device`]. The loop
//! treats them alike.

use crate::geometry::{Pose, Twist, Wrench};

/// The result of one read of a device, in the device's own axes, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceState {
    /// Pose of the end effector (m). A device that senses no rotation reports the identity.
    pub pose: Pose,
    /// Twist of the end effector (m/s, rad/s), as the driver estimates it.
    pub twist: Twist,
    /// One bit per button, lowest first.
    pub buttons: u32,
    /// Time of the device's own clock (ns). The driver extends the device's wrapping counter.
    pub device_time_ns: u64,
}

impl DeviceState {
    /// A state at the origin, at rest, with no button pressed.
    pub fn resting() -> Self {
        Self {
            pose: Pose::identity(),
            twist: Twist::zero(),
            buttons: 0,
            device_time_ns: 0,
        }
    }

    /// Whether every number in the state is finite.
    pub fn is_finite(&self) -> bool {
        self.pose.is_finite() && self.twist.is_finite()
    }
}

/// The degrees of freedom that a device senses or actuates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Translation only.
    Three,
    /// Translation and rotation.
    Six,
}

/// The capabilities of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    /// Degrees of freedom that the device senses.
    pub sensed: Freedom,
    /// Degrees of freedom that the device actuates.
    pub actuated: Freedom,
    /// Largest force (N).
    pub max_force: f64,
    /// Largest moment (N m); zero where the device actuates no rotation.
    pub max_moment: f64,
    /// Radius of the largest ball about the device's origin that lies inside the workspace (m).
    pub workspace_radius: f64,
    /// Displacement of one encoder count (m).
    pub position_step: f64,
}

/// The quantities of a device that only a simulation knows. They serve summaries and certificates; the control law
/// never reads them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// True pose of the end effector (m, device axes), before the encoders.
    pub pose: Pose,
    /// True twist of the end effector (m/s, rad/s).
    pub twist: Twist,
    /// The wrench that the motors hold (N, N m, device axes): the last command, shortened to the largest wrench of the
    /// device.
    pub held: Wrench,
    /// Work of the motors since the start (J), integrated between ticks.
    pub motor_work: f64,
    /// Work of the device on the hand since the start (J), at the port, integrated between ticks.
    pub on_hand: f64,
}

/// Why a report cannot be used, in any protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Corruption {
    /// The report is too short or too long.
    #[error("its length is wrong")]
    Length,
    /// The bytes of the report were changed in transit.
    #[error("its check sum is wrong")]
    CheckSum,
    /// The report is of another version of the protocol.
    #[error("it is of another version of the protocol")]
    Version,
    /// The report is of another kind than expected.
    #[error("it is of another kind")]
    Kind,
    /// A field of the report has a value that no sender should send.
    #[error("one of its fields is out of range")]
    Range,
}

/// Why a device gave no state or took no wrench.
///
/// The type is `Copy` and holds no text, so the tick may construct it. `Display` is for use outside the tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// No report has arrived since the last read.
    #[error("the device sent no report since the last tick")]
    NoReport,
    /// The device is no longer connected; the field is the error number of the system.
    #[error("the device is no longer connected (system error {0})")]
    Disconnected(i32),
    /// A report arrived that cannot be trusted.
    #[error("the device sent a report that cannot be used: {0}")]
    Corrupt(Corruption),
    /// The wrench was not sent, because earlier commands still wait.
    #[error("the device did not take the last wrench yet")]
    Busy,
}

/// A haptic device as the loop sees it.
///
/// Inside the tick, neither `read` nor `write` may allocate, lock, format or wait.
pub trait Device {
    /// The capabilities of the device. They are constant while the device is connected.
    fn capabilities(&self) -> Capabilities;

    /// Reads the newest state of the device. `now_ns` is the nominal time of the tick.
    ///
    /// # Errors
    /// [`DeviceError`] where no report is new or none can be trusted. The loop then keeps the last state and counts the
    /// error.
    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError>;

    /// Commands a wrench on the hand (N, N m, device axes). The device holds the wrench until the next command.
    ///
    /// # Errors
    /// [`DeviceError`] where the device cannot take the command.
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError>;

    /// The quantities that only a simulation knows; `None` for a real or recorded device. A wrapper returns the probe
    /// of the device inside.
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
