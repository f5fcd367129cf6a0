//! One tick: the telemetry of devices and bodies, and the readings of the devices, from which a run is replayed.
//!
//! The fields of a tick, of its devices, bodies and readings are listed here once, in the order of the message, and so are
//! the columns of the table of a run. The message of a log, its definition, the comparison of a replay, the table and the
//! sums of energy of a viewer follow from these lists. A list that lacks a field does not compile.

use super::field::{Cells, Each, Leaf, Record, Visitor, fields, name, record};
use super::kind::{Stamp, kind};
use nalgebra::{Quaternion, UnitQuaternion};
use rt_core::coupling::HostState;
use rt_core::record::{BodyTelemetry, DeviceTelemetry, Stamps, ToolTelemetry};
use rt_core::safety::SafetyState;
use rt_core::{
    Corruption, DeviceError, DeviceState, EnergyAccount, MAX_DEVICES, Pose, Reading, Rendering,
    Telemetry, Vec3, Withheld,
};
use std::{fmt, iter};

/// One tick, read back from a log.
#[derive(Clone, Debug, PartialEq)]
pub struct TickRow {
    /// Number of the tick, from zero.
    pub tick: u64,
    /// Nominal time of the tick (ns).
    pub time_ns: u64,
    /// Lateness of the tick (ns).
    pub lateness_ns: u64,
    /// Time from the wake-up to the moment just before the commands left (ns).
    pub took_ns: u64,
    /// The devices.
    pub devices: Vec<DeviceTelemetry>,
    /// The bodies.
    pub bodies: Vec<BodyTelemetry>,
    /// The reading of each device (device axes).
    pub readings: Vec<LoggedReading>,
    /// The number of the patch that each tool uses, in the order of the devices.
    pub patches: Vec<u64>,
    /// For each tool the index of its device, the number of its contacts, its place on the surface (m) and the force of the surface
    /// on it (N): [`TOUCH`] numbers.
    pub touch: Vec<f64>,
    /// For each tool its rotation as a quaternion (w, x, y, z) and the moment of the surface on it about its place (N m).
    pub turn: Vec<f64>,
    /// For each tool how far it has gone from where the host made its patch, and how far beyond the tool the patch has the surface (m).
    pub way: Vec<f64>,
    /// The stamps of the tick (ns, `rt_core::record::Stamps`): when it began, then by device when the device had been read, when
    /// it had been given its wrench, and its motion to force. Empty if no clock ran.
    pub stamps: Vec<u64>,
}

/// See [`TickRow::touch`].
pub const TOUCH: usize = 8;
/// The numbers of a tool in [`TickRow::turn`].
const TURN: usize = 7;

impl From<&Telemetry> for TickRow {
    fn from(telemetry: &Telemetry) -> Self {
        Self {
            tick: telemetry.tick,
            time_ns: telemetry.time_ns,
            lateness_ns: telemetry.lateness_ns,
            took_ns: telemetry.took_ns,
            devices: telemetry.devices().copied().collect(),
            bodies: telemetry.bodies().map(logged).collect(),
            readings: telemetry.readings().map(LoggedReading::from).collect(),
            patches: telemetry.tools().map(|tool| tool.sequence).collect(),
            touch: telemetry.tools().flat_map(touch).collect(),
            turn: telemetry.tools().flat_map(turn).collect(),
            way: (telemetry.tools())
                .flat_map(|tool| [tool.way, tool.reach])
                .collect(),
            stamps: stamps(telemetry),
        }
    }
}

/// A tool at a tick: what a run and its log both know of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Number of the patch in use; zero before the first.
    pub patch: u64,
    /// Number of contacts within reach.
    pub contacts: u8,
    /// The pose of the tool on the surface (scene).
    pub pose: Pose,
    /// The force of the surface on the tool (N).
    pub force: Vec3,
    /// How far the tool has gone from where the host made the patch (m).
    pub way: f64,
    /// The distance up to which the patch has the surface beyond the tool (m).
    pub reach: f64,
}

impl Touch {
    /// Whether the tool is beyond the surface that its patch has.
    pub fn is_beyond(&self) -> bool {
        self.way > self.reach
    }

    /// What to tell people of a tool that is beyond the surface that its patch has; `None` of another one.
    pub fn beyond(&self) -> Option<String> {
        self.is_beyond().then(|| {
            format!(
                "beyond the surface that the host told: {:.1} mm from where its patch was made, which reaches {:.1} mm; it may meet \
                 nothing until the next patch",
                1e3 * self.way,
                1e3 * self.reach
            )
        })
    }
}

impl From<&ToolTelemetry> for Touch {
    fn from(tool: &ToolTelemetry) -> Self {
        Self {
            patch: tool.sequence,
            contacts: tool.contacts,
            pose: tool.proxy,
            force: tool.wrench.force,
            way: tool.way,
            reach: tool.reach,
        }
    }
}

impl TickRow {
    /// The tools, by device. Logs of earlier versions have no rotations, and do not tell how far patches reach.
    pub fn tools(&self) -> [Option<Touch>; MAX_DEVICES] {
        let mut tools = [None; MAX_DEVICES];
        let mut turns = self.turn.as_chunks::<TURN>().0.iter();
        let mut ways = self.way.as_chunks::<2>().0.iter();
        let mut patches = self.patches.iter();
        for [device, contacts, x, y, z, force @ ..] in self.touch.as_chunks::<TOUCH>().0 {
            let mut pose = Pose::at(Vec3::new(*x, *y, *z));
            if let Some([w, i, j, k, ..]) = turns.next() {
                pose.rotation = UnitQuaternion::new_unchecked(Quaternion::new(*w, *i, *j, *k));
            }
            let [way, reach] = ways.next().copied().unwrap_or([0.0, f64::INFINITY]);
            let patch = patches.next().copied().unwrap_or(0);
            if let Some(tool) = tools.get_mut(*device as usize) {
                *tool = Some(Touch {
                    patch,
                    contacts: *contacts as u8,
                    pose,
                    force: (*force).into(),
                    way,
                    reach,
                });
            }
        }
        tools
    }
}

/// The record of a tool as a log keeps it.
fn touch(tool: &ToolTelemetry) -> [f64; TOUCH] {
    let [x, y, z]: [f64; 3] = tool.proxy.position.into();
    let [fx, fy, fz]: [f64; 3] = tool.wrench.force.into();
    let (device, contacts) = (f64::from(tool.device), f64::from(tool.contacts));
    [device, contacts, x, y, z, fx, fy, fz]
}

/// The rotation of a tool, and the moment on it, as a log keeps them.
fn turn(tool: &ToolTelemetry) -> [f64; TURN] {
    let (rotation, [x, y, z]) = (tool.proxy.rotation, tool.wrench.moment.into());
    [rotation.w, rotation.i, rotation.j, rotation.k, x, y, z]
}

/// The stamps of a tick as a log keeps them.
fn stamps(telemetry: &Telemetry) -> Vec<u64> {
    let stamps = &telemetry.stamps;
    if *stamps == Stamps::default() {
        return Vec::new();
    }
    let devices = usize::from(telemetry.device_count);
    let each = [stamps.read_ns, stamps.written_ns, stamps.motion_to_force_ns];
    let each = each.iter().flat_map(|times| times.iter().take(devices));
    iter::once(&stamps.began_ns).chain(each).copied().collect()
}

/// The record of a body as a log keeps it.
fn logged(body: &BodyTelemetry) -> BodyTelemetry {
    let mut body = *body;
    // Logs of earlier versions lack this sum.
    body.energy.received = 0.0;
    body
}

/// A device's state (device axes), or the reason why there was none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoggedReading(pub Result<DeviceState, ReadFault>);

/// The reason why a device gave no state: [`DeviceError`] without its details.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadFault {
    /// No new report since the last read.
    NoReport,
    /// The device was disconnected. Holds the system's error number.
    Disconnected(i32),
    /// The device was busy.
    Busy,
    /// A report of a wrong length.
    BadLength,
    /// A report with a wrong check sum: its bytes changed in transit.
    BadCheckSum,
    /// A report of another version of the protocol.
    BadVersion,
    /// A report of another kind.
    BadKind,
    /// A report with a field out of its range.
    OutOfRange,
}

impl From<DeviceError> for ReadFault {
    fn from(error: DeviceError) -> Self {
        match error {
            DeviceError::NoReport => Self::NoReport,
            DeviceError::Disconnected(number) => Self::Disconnected(number),
            DeviceError::Busy => Self::Busy,
            DeviceError::Corrupt(report) => match report {
                Corruption::Length => Self::BadLength,
                Corruption::CheckSum => Self::BadCheckSum,
                Corruption::Version => Self::BadVersion,
                Corruption::Kind => Self::BadKind,
                Corruption::Range => Self::OutOfRange,
            },
        }
    }
}

impl From<&Reading> for LoggedReading {
    fn from(reading: &Reading) -> Self {
        Self(reading.map_err(ReadFault::from))
    }
}

impl LoggedReading {
    /// The reading as the device gave it. The control law depends on whether there is a state, not on the reason
    /// why there is none. Every report that could not be used is therefore returned as [`DeviceError::NoReport`].
    ///
    /// # Errors
    /// The fault, if the device gave no state.
    pub fn reading(&self) -> Reading {
        self.0.map_err(|fault| match fault {
            ReadFault::Disconnected(number) => DeviceError::Disconnected(number),
            ReadFault::Busy => DeviceError::Busy,
            _ => DeviceError::NoReport,
        })
    }
}

impl fmt::Display for ReadFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoReport => f.write_str("no report"),
            Self::Disconnected(number) => write!(f, "disconnected (system error {number})"),
            Self::Busy => f.write_str("busy"),
            Self::BadLength => f.write_str("a report of a wrong length"),
            Self::BadCheckSum => f.write_str("a report with a wrong check sum"),
            Self::BadVersion => f.write_str("a report of another version"),
            Self::BadKind => f.write_str("a report of another kind"),
            Self::OutOfRange => f.write_str("a report with a field out of range"),
        }
    }
}

/// The faults in the order of the constants in the message definition, from one.
const FAULTS: [ReadFault; 8] = [
    ReadFault::NoReport,
    ReadFault::Disconnected(0),
    ReadFault::Busy,
    ReadFault::BadLength,
    ReadFault::BadCheckSum,
    ReadFault::BadVersion,
    ReadFault::BadKind,
    ReadFault::OutOfRange,
];

impl TickRow {
    /// The stamp of its message. The number wraps after 49 days of ticks.
    pub fn stamp(&self) -> Stamp {
        Stamp {
            body: 0,
            number: Some(self.tick as u32),
            time_ns: self.time_ns,
        }
    }
}

kind! { TickRow: "palpate_msgs/msg/Tick", Run, |_| "/tick".to_owned();
    fn follows(&self, time_ns: u64, before: Option<&Self>) -> bool {
        // A search relies on the order of the ticks.
        self.time_ns == time_ns
            && before.is_none_or(|before| before.tick < self.tick && before.time_ns <= time_ns)
    }

    fn size(&self) -> usize {
        size_of_val(self.devices.as_slice())
            + size_of_val(self.bodies.as_slice())
            + size_of_val(self.readings.as_slice())
            + size_of_val(self.patches.as_slice())
            + size_of_val(self.touch.as_slice())
            + size_of_val(self.turn.as_slice())
            + size_of_val(self.way.as_slice())
            + size_of_val(self.stamps.as_slice())
    }
}

record! { TickRow: (&Telemetry::empty()).into();
    "# One pass of the haptic loop. SI units; world axes.";
    "uint64 tick         # number of the tick, from zero" tick;
    "uint64 time_ns      # its nominal time" time_ns;
    "uint64 lateness_ns  # how late it woke" lateness_ns;
    "uint64 took_ns      # from there until just before its commands left" took_ns;
    "palpate_msgs/Device[] devices" devices: list "device";
    "palpate_msgs/Body[] bodies" bodies: list "body";
    "palpate_msgs/Reading[] readings  # by device" readings: list "reading";
    "uint64[] patches    # optional: number of the patch in use, by tool" patches: late;
    "float64[] touch     # optional: by tool: device, contacts, place (x, y, z), force on the tool (x, y, z)" touch: late;
    "float64[] turn      # optional: by tool: rotation (w, x, y, z), moment on the tool about its place (x, y, z)" turn: late;
    "float64[] way       # optional: by tool: way since its patch was made (m), distance up to which the patch has the surface (m)" way: late;
    "uint64[] stamps     # optional, ns: since it woke: models taken, each device read, each commanded; then motion to force of each" stamps: late;
}

impl TickRow {
    /// The tick without what it was given: readings and measured times. A replay compares the rest.
    pub(crate) fn outputs(&self) -> Self {
        Self {
            lateness_ns: 0,
            took_ns: 0,
            stamps: Vec::new(),
            readings: Vec::new(),
            ..self.clone()
        }
    }
}

// A `torque` is the moment about the handle.
record! { DeviceTelemetry: Self::empty();
    "uint8 NORMAL=0";
    "uint8 LIMITED=1";
    "uint8 RECOVERING=2";
    "uint8 DEVICE_STALE=3";
    "uint8 NOT_A_NUMBER=4";
    "uint8 SLEWED=5";
    "uint8 TOO_FAST=6";
    "uint8 OUT_OF_REACH=7";
    "uint8 HOT=8";
    "uint8 ENGAGING=9";
    "uint8 HANDS_OFF=10";
    "uint8 DISARMED=11";
    "uint8 STOPPED=12";
    "uint8 LET_GO=13";
    "uint8 DEVICE_FAULT=14";
    "geometry_msgs/Pose pose      # of the proxy" pose;
    "geometry_msgs/Twist twist    # of the proxy" twist;
    "geometry_msgs/Wrench wrench  # on the hand, as it left for the device" wrench;
    "geometry_msgs/Vector3 slip   # of the proxy against its hand; part of the pose" slip;
    "float64 slip_angle           # of that slip (rad)" slip_angle;
    "uint64 device_time_ns        # the device's own clock" device_time_ns;
    "uint32 buttons               # one bit each; the two highest are the operator's orders" buttons;
    "bool fresh                   # whether the device gave a good state this tick" fresh;
    "uint8 safety                 # what the last stage did to the wrench" safety;
}

record! { BodyTelemetry: Self::empty();
    "uint8 WAITING=0";
    "uint8 LIVE=1";
    "uint8 FADING=2";
    "uint8 HELD=3";
    "uint64 sequence  # of the model in use; zero before the first" sequence;
    "uint64 age_ns    # of that model" age_ns;
    "float64 trust    # in it, from zero (safe hold) to one" trust;
    "uint32 epoch     # of its topology" epoch;
    "uint8 state      # what the coupling was doing" state;
    withheld: flat;
    energy: flat;
}

record! { Withheld: Self::default();
    "float64 withheld # force that the cap withholds (N)" force;
    "float64 of       # force of the model's springs there (N)" of;
}

record! { EnergyAccount: Self::default();
    "# Energy (J) between the hands and the body, sums since the start: a lost message loses nothing.";
    "float64 supplied   # net work of the hands" supplied;
    "float64 raised     # part of it that lifted weight" raised;
    "float64 least      # least that supplied + received - raised + credited ever was" least;
    "float64 initial    # in the first model, which the body had before hands moved it" initial;
    // See `logged`.
    received: skip;
    "float64 stored     # that could be got back now" stored;
    "float64 credited   # dissipated by devices and relied on" credited;
    "float64 available  # what the cap has to spend" available;
    "uint64 capped      # ticks in which it took something off" capped;
}

impl Record for LoggedReading {
    fn empty() -> Self {
        Self(Ok(DeviceState::resting()))
    }

    fn fields(&mut self, to: &mut impl Visitor) -> Option<()> {
        let (mut state, mut status, mut system_error) = match self.0 {
            Ok(state) => (state, 0, 0),
            Err(fault) => {
                let (kind, number) = match fault {
                    ReadFault::Disconnected(number) => (ReadFault::Disconnected(0), number),
                    other => (other, 0),
                };
                let place = FAULTS.iter().position(|f| *f == kind);
                // The state is all zero: a rotation of zero length cannot be mistaken for a rotation that was read.
                let mut nothing = DeviceState::resting();
                nothing.pose.rotation.as_mut_unchecked().coords.fill(0.0);
                (
                    nothing,
                    place.map_or(u8::MAX, |i| i as u8 + 1),
                    number as u32,
                )
            }
        };
        let (mut rendering, mut fault) = match state.rendering {
            Rendering::Commanded => (0_u8, 0),
            Rendering::LetGo => (1, 0),
            Rendering::Fault(fault) => (2, fault),
        };
        let DeviceState {
            pose,
            twist,
            buttons,
            device_time_ns,
            rendering: _,
        } = &mut state;
        let (own_status, own_error) = (&mut status, &mut system_error);
        let (own_rendering, own_fault) = (&mut rendering, &mut fault);
        fields! { to;
            "# What the device gave, as it gave it: its own axes. All zero where it gave nothing.";
            "uint8 OK=0";
            "uint8 NO_REPORT=1";
            "uint8 DISCONNECTED=2";
            "uint8 BUSY=3";
            "uint8 BAD_LENGTH=4";
            "uint8 BAD_CHECK_SUM=5";
            "uint8 BAD_VERSION=6";
            "uint8 BAD_KIND=7";
            "uint8 OUT_OF_RANGE=8";
            "geometry_msgs/Pose pose" pose;
            "geometry_msgs/Twist twist" twist;
            "uint64 device_time_ns" device_time_ns;
            "uint32 buttons" buttons;
            "int32 system_error  # where it is disconnected" own_error;
            "uint8 status" own_status;
            "uint8 COMMANDED=0";
            "uint8 LET_GO=1";
            "uint8 FAULT=2";
            "uint8 rendering     # what the device says of the wrenches that it is commanded" own_rendering;
            "uint8 fault         # number of the fault, where it has one" own_fault;
        }
        state.rendering = match (rendering, fault) {
            (0, 0) => Rendering::Commanded,
            (1, 0) => Rendering::LetGo,
            (2, fault) => Rendering::Fault(fault),
            _ => return None,
        };
        self.0 = match usize::from(status).checked_sub(1) {
            None => Ok(state),
            Some(place) => Err(match *FAULTS.get(place)? {
                ReadFault::Disconnected(_) => ReadFault::Disconnected(system_error as i32),
                other => other,
            }),
        };
        Some(())
    }
}

/// The sums of energy (J), with their names: the fields of the account without the count of ticks.
pub fn energy_sums(energy: &EnergyAccount) -> Vec<(&'static str, f64)> {
    let mut sums = Vec::new();
    let mut each = Each(|line, _, leaf: Leaf<'_>| {
        if let Leaf::Number(sum) = leaf {
            sums.push((name(line), *sum));
        }
    });
    // The visitor takes every field.
    let _ = { *energy }.fields(&mut each);
    sums
}

/// The states of the last stage that have a column, in the order of the columns.
const SAFETY: [SafetyState; 14] = [
    SafetyState::Limited,
    SafetyState::Slewed,
    SafetyState::Recovering,
    SafetyState::TooFast,
    SafetyState::OutOfReach,
    SafetyState::Hot,
    SafetyState::Engaging,
    SafetyState::HandsOff,
    SafetyState::Disarmed,
    SafetyState::Stopped,
    SafetyState::Silent,
    SafetyState::LetGo,
    SafetyState::DeviceFault,
    SafetyState::NotANumber,
];

/// The states of a coupling without a model that it trusts, which have a column each.
const COUPLING: [HostState; 3] = [HostState::Waiting, HostState::Fading, HostState::Held];

/// The columns of a tick before those of its devices.
pub(crate) fn tick_columns(tick: &Telemetry, to: &mut impl Cells) {
    to.whole(format_args!("tick"), tick.tick);
    to.seconds("time_s", tick.time_ns);
    to.seconds("lateness_s", tick.lateness_ns);
}

/// The columns of a device.
pub(crate) fn device_columns(device: &DeviceTelemetry, to: &mut impl Cells) {
    to.vector("position", "m", &device.pose.position);
    orientation(&device.pose.rotation, to);
    to.vector("velocity", "m_per_s", &device.twist.linear);
    to.vector("angular_velocity", "rad_per_s", &device.twist.angular);
    to.vector("force", "N", &device.wrench.force);
    to.vector("moment", "Nm", &device.wrench.moment);
    to.vector("slip", "m", &device.slip);
    to.number(format_args!("slip_rad"), device.slip_angle);
    to.whole(format_args!("buttons"), u64::from(device.buttons));
    to.flag("missed", !device.fresh);
    for state in SAFETY {
        to.flag(state.name(), device.safety == state);
    }
}

fn orientation(rotation: &UnitQuaternion<f64>, to: &mut impl Cells) {
    let components = [rotation.w, rotation.i, rotation.j, rotation.k];
    for (component, x) in ["w", "x", "y", "z"].into_iter().zip(components) {
        to.number(format_args!("orientation_{component}"), x);
    }
}

/// The columns of a tool.
pub(crate) fn tool_columns(tool: &ToolTelemetry, to: &mut impl Cells) {
    to.vector("position", "m", &tool.proxy.position);
    orientation(&tool.proxy.rotation, to);
    to.vector("force", "N", &tool.wrench.force);
    to.vector("moment", "Nm", &tool.wrench.moment);
    to.whole(format_args!("contacts"), u64::from(tool.contacts));
    to.whole(format_args!("patch"), tool.sequence);
    if tool.sequence == 0 {
        to.number(format_args!("patch_age_s"), f64::NAN);
    } else {
        to.seconds("patch_age_s", tool.age_ns);
    }
    to.number(format_args!("trust"), tool.trust);
    to.number(format_args!("withheld_N"), tool.withheld.force);
}

/// The columns of a body. `capped`: the ticks in which the cap reduced a wrench, before this tick.
pub(crate) fn body_columns(body: &BodyTelemetry, capped: u64, to: &mut impl Cells) {
    to.whole(format_args!("model"), body.sequence);
    if body.sequence == 0 {
        to.number(format_args!("model_age_s"), f64::NAN);
    } else {
        to.seconds("model_age_s", body.age_ns);
    }
    to.number(format_args!("trust"), body.trust);
    for state in COUPLING {
        to.flag(state.name(), body.state == state);
    }
    to.flag("capped", body.energy.capped > capped);
    to.number(format_args!("withheld_N"), body.withheld.force);
    to.number(format_args!("springs_N"), body.withheld.of);
    for (name, sum) in energy_sums(&body.energy) {
        to.number(format_args!("{name}_J"), sum);
    }
}
