//! The interface of a haptic device to the loop: the loop reads a state, writes a wrench, and asks for the
//! capabilities.
//!
//! A simulation, a recording and a wrapper (a fault injector, a tracer) all implement the same [`Device`]. The loop
//! treats them alike.

use crate::geometry::{Pose, Twist, Vec3, Wrench};

/// The result of one read of a device, in the device's own axes, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceState {
    /// Pose of the end effector (m). A device that senses no rotation reports the identity, and a device of one or two
    /// degrees of freedom reports zero along its other axes.
    pub pose: Pose,
    /// Twist of the end effector (m/s, rad/s), as the driver estimates it.
    pub twist: Twist,
    /// One bit per button, lowest first.
    pub buttons: u32,
    /// Time of the device's own clock (ns). The driver extends the device's wrapping counter.
    pub device_time_ns: u64,
    /// The device's report on the commanded wrenches.
    pub rendering: Rendering,
}

/// A device's report on the commanded wrenches. The tick commands no force to a device that renders none, so the force
/// returns along a ramp ([`crate::safety`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rendering {
    /// The device renders the wrenches, or its protocol does not tell.
    #[default]
    Commanded,
    /// The device renders no wrench at present, but may render the next one: its watchdog let go, it refused the
    /// wrenches, or its amplifiers are off.
    LetGo,
    /// The device renders no wrench because of a fault. Holds the number of the fault in the device's protocol.
    Fault(u8),
}

impl DeviceState {
    /// A state at the origin, at rest, with no button pressed.
    pub fn resting() -> Self {
        Self {
            pose: Pose::identity(),
            twist: Twist::zero(),
            buttons: 0,
            device_time_ns: 0,
            rendering: Rendering::Commanded,
        }
    }

    /// Whether every number in the state is finite.
    pub fn is_finite(&self) -> bool {
        self.pose.is_finite() && self.twist.is_finite()
    }
}

/// One or two of a device's own axes: those along which a device of one or two degrees of freedom moves, such as a
/// paddle or a pantograph. Its mechanism holds the handle along the others.
///
/// ```
/// use rt_core::{Axes, Vec3};
///
/// let plane = Axes::new([true, false, true]).unwrap();
/// assert_eq!(plane.part(&Vec3::new(1.0, 2.0, 3.0)), Vec3::new(1.0, 0.0, 3.0));
/// // A device that moves along all axes, or along none, is no such device.
/// assert!(Axes::new([true; 3]).is_none() && Axes::new([false; 3]).is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axes([bool; 3]);

impl Axes {
    /// The axes x, y, z whose entry is true; `None` unless one or two are.
    pub fn new(free: [bool; 3]) -> Option<Self> {
        let any = free.contains(&true);
        (any && free.contains(&false)).then_some(Self(free))
    }

    /// Which of the axes x, y, z the device moves along.
    pub fn free(&self) -> [bool; 3] {
        self.0
    }

    /// The part of a vector (device axes) along the axes. The other components are exactly zero.
    pub fn part(&self, vector: &Vec3) -> Vec3 {
        let [x, y, z] = self.0;
        let along = |free: bool, component: f64| if free { component } else { 0.0 };
        Vec3::new(along(x, vector.x), along(y, vector.y), along(z, vector.z))
    }
}

/// The degrees of freedom that a device senses or actuates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Translation along one or two axes only.
    Along(Axes),
    /// Translation only.
    Three,
    /// Translation and rotation.
    Six,
}

impl Freedom {
    /// Whether rotation is among the degrees of freedom.
    pub fn turns(&self) -> bool {
        *self == Self::Six
    }

    /// The part of a force or a translation (device axes) along the degrees of freedom. The other components are
    /// exactly zero.
    #[inline]
    pub fn part(&self, vector: &Vec3) -> Vec3 {
        match self {
            Self::Along(axes) => axes.part(vector),
            Self::Three | Self::Six => *vector,
        }
    }
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
    /// Largest moment (N m); zero if the device actuates no rotation.
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

/// The reason why a report cannot be used, in any protocol.
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

/// The reason why a device gave no state or took no wrench.
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
    /// [`DeviceError`] if no report is new or none can be trusted. The loop then keeps the last state and counts the
    /// error.
    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError>;

    /// Commands a wrench on the hand (N, N m, device axes). The device holds the wrench until the next command.
    ///
    /// # Errors
    /// [`DeviceError`] if the device cannot take the command.
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError>;

    /// The quantities that only a simulation knows; `None` for a real or recorded device. A wrapper returns the probe
    /// of the device inside.
    fn probe(&self) -> Option<Probe> {
        None
    }

    /// The time from the reading of the encoders to the force that answers this reading, in the device's own clock
    /// (ns). `None` if the last read showed no such time, or if the device does not report one.
    fn motion_to_force_ns(&self) -> Option<u64> {
        None
    }

    /// Number of commanded wrenches that the device itself refused so far. `None` if the device does not report it.
    fn refused_wrenches(&self) -> Option<u64> {
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
    fn motion_to_force_ns(&self) -> Option<u64> {
        (**self).motion_to_force_ns()
    }
    fn refused_wrenches(&self) -> Option<u64> {
        (**self).refused_wrenches()
    }
}

/// A device's reading in one tick: its state, or the reason why there is none.
pub type Reading = Result<DeviceState, DeviceError>;
