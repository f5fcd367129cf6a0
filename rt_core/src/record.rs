//! The records of a tick: a short one for the host, a full one for the log.

use crate::coupling::HostState;
use crate::device::DeviceError;
use crate::device::Reading;
use crate::geometry::{Pose, Twist, Vec3, Wrench};
use crate::passivity::{EnergyAccount, Withheld};
use crate::safety::SafetyState;
use crate::{MAX_BODIES, MAX_DEVICES};

/// The record of a tick for the host: the poses of the proxies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TickRecord {
    /// Number of the tick, from zero.
    pub tick: u64,
    /// Nominal time of the tick (ns).
    pub time_ns: u64,
    /// The number of entries of `proxies` in use.
    pub device_count: u8,
    /// Poses and twists of the proxies (scene, world axes), by device.
    pub proxies: [(Pose, Twist); MAX_DEVICES],
    /// Buttons, by device, one bit each.
    pub buttons: [u32; MAX_DEVICES],
    /// The pose of the tool on the surface (scene), by device; `None` for a device without a tool.
    pub tools: [Option<Pose>; MAX_DEVICES],
}

impl TickRecord {
    /// A record without devices.
    pub fn empty() -> Self {
        Self {
            tick: 0,
            time_ns: 0,
            device_count: 0,
            proxies: [(Pose::identity(), Twist::zero()); MAX_DEVICES],
            buttons: [0; MAX_DEVICES],
            tools: [None; MAX_DEVICES],
        }
    }
}

/// One device in a [`Telemetry`] record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceTelemetry {
    /// Pose of the proxy (scene).
    pub pose: Pose,
    /// Twist of the proxy (scene).
    pub twist: Twist,
    /// Displacement by which the proxy has slipped against its hand (m, scene); part of its pose.
    pub slip: Vec3,
    /// Angle by which the proxy has slipped (rad).
    pub slip_angle: f64,
    /// Wrench on the hand that the device was commanded, rotated into scene axes.
    pub wrench: Wrench,
    /// Buttons, one bit each.
    pub buttons: u32,
    /// The device's own clock (ns).
    pub device_time_ns: u64,
    /// Whether the device gave a good state this tick.
    pub fresh: bool,
    /// The effect of the last stage on the wrench.
    pub safety: SafetyState,
}

impl DeviceTelemetry {
    /// A device at rest at the origin, without a reading.
    pub fn empty() -> Self {
        Self {
            pose: Pose::at(Vec3::zeros()),
            twist: Twist::zero(),
            slip: Vec3::zeros(),
            slip_angle: 0.0,
            wrench: Wrench::zero(),
            buttons: 0,
            device_time_ns: 0,
            fresh: false,
            safety: SafetyState::Normal,
        }
    }
}

/// One body in a [`Telemetry`] record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyTelemetry {
    /// Sequence number of the model in use; zero before the first.
    pub sequence: u64,
    /// Topology epoch of the model in use.
    pub epoch: u32,
    /// Age of the model in use (ns).
    pub age_ns: u64,
    /// Trust in the model in use, from zero (safe hold) to one.
    pub trust: f64,
    /// State of the coupling.
    pub state: HostState,
    /// The part of the body's force that the cap withholds.
    pub withheld: Withheld,
    /// Energy account of the body's hands since the start.
    pub energy: EnergyAccount,
}

impl BodyTelemetry {
    /// A body before its first model.
    pub fn empty() -> Self {
        Self {
            sequence: 0,
            epoch: 0,
            age_ns: 0,
            trust: 0.0,
            state: HostState::Waiting,
            withheld: Withheld::default(),
            energy: EnergyAccount::default(),
        }
    }
}

/// One tool in a [`Telemetry`] record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolTelemetry {
    /// The index of its device.
    pub device: u8,
    /// State of its coupling.
    pub state: HostState,
    /// Number of contacts within reach.
    pub contacts: u8,
    /// Sequence number of the patch in use; zero before the first.
    pub sequence: u64,
    /// Age of the newest patch (ns).
    pub age_ns: u64,
    /// Trust in the patch, from zero (safe hold) to one.
    pub trust: f64,
    /// How far the tool has gone from where the host made the patch in use (m), as [`Tool::way`](crate::tool::Tool::way).
    pub way: f64,
    /// The distance up to which that patch has the surface beyond the tool (m); infinite before the first.
    pub reach: f64,
    /// The pose of the tool on the surface (scene).
    pub proxy: Pose,
    /// The wrench of the surface on the tool, before the cap and the trust, the moment about the place of the tool.
    pub wrench: Wrench,
    /// The part of the force that the cap withholds.
    pub withheld: Withheld,
    /// Energy account of the hand since the start.
    pub energy: EnergyAccount,
}

impl ToolTelemetry {
    /// A tool before its first patch.
    pub const fn empty() -> Self {
        Self {
            device: 0,
            state: HostState::Waiting,
            contacts: 0,
            sequence: 0,
            age_ns: 0,
            trust: 0.0,
            way: 0.0,
            reach: f64::INFINITY,
            proxy: Pose::identity(),
            wrench: Wrench::zero(),
            withheld: Withheld::NONE,
            energy: EnergyAccount::NONE,
        }
    }
}

/// The times within a tick, each from its wake-up (ns). All are zero under virtual time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamps {
    /// Just before the first device was read: the newest models and patches have been taken.
    pub began_ns: u64,
    /// When each device had been read, by device.
    pub read_ns: [u64; MAX_DEVICES],
    /// When each device had been given its wrench, by device.
    pub written_ns: [u64; MAX_DEVICES],
    /// The newest time from a motion to the force that answered it, by device ([`crate::Device::motion_to_force_ns`]); zero
    /// if no new time came.
    pub motion_to_force_ns: [u64; MAX_DEVICES],
}

/// Copied at once: a tick has a record, also without tools.
const NO_TOOLS: [ToolTelemetry; MAX_DEVICES] = [ToolTelemetry::empty(); MAX_DEVICES];

/// Everything about one tick that the log keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Number of the tick, from zero.
    pub tick: u64,
    /// Nominal time of the tick (ns).
    pub time_ns: u64,
    /// Lateness of the wake-up (ns); zero under virtual time.
    pub lateness_ns: u64,
    /// Time from the wake-up to the moment just before the commands left (ns); zero under virtual time.
    pub took_ns: u64,
    /// The other times within the tick.
    pub stamps: Stamps,
    /// The number of entries of `devices` in use.
    pub device_count: u8,
    /// The devices, the first `device_count` in use.
    pub devices: [DeviceTelemetry; MAX_DEVICES],
    /// Each device's reading, as the device gave it (device axes). The readings, the times and the models
    /// suffice for a replay.
    pub readings: [Reading; MAX_DEVICES],
    /// The number of entries of `bodies` in use.
    pub body_count: u8,
    /// The bodies, the first `body_count` in use.
    pub bodies: [BodyTelemetry; MAX_BODIES],
    /// The number of entries of `tools` in use.
    pub tool_count: u8,
    /// The tools, the first `tool_count` in use.
    pub tools: [ToolTelemetry; MAX_DEVICES],
}

impl Telemetry {
    /// A record without devices, bodies or tools.
    pub fn empty() -> Self {
        let (device, body) = (DeviceTelemetry::empty(), BodyTelemetry::empty());
        Self {
            tick: 0,
            time_ns: 0,
            lateness_ns: 0,
            took_ns: 0,
            stamps: Stamps::default(),
            device_count: 0,
            // Not `[device; MAX_DEVICES]`, for which the compiler writes most of each entry twice.
            devices: core::array::from_fn(|_| device),
            readings: [const { Err(DeviceError::NoReport) }; MAX_DEVICES],
            body_count: 0,
            bodies: [body; MAX_BODIES],
            tool_count: 0,
            tools: NO_TOOLS,
        }
    }

    /// The devices in use.
    pub fn devices(&self) -> impl Iterator<Item = &DeviceTelemetry> {
        self.devices.iter().take(usize::from(self.device_count))
    }

    /// The readings of the devices in use.
    pub fn readings(&self) -> impl Iterator<Item = &Reading> {
        self.readings.iter().take(usize::from(self.device_count))
    }

    /// The bodies in use.
    pub fn bodies(&self) -> impl Iterator<Item = &BodyTelemetry> {
        self.bodies.iter().take(usize::from(self.body_count))
    }

    /// The tools in use.
    pub fn tools(&self) -> impl Iterator<Item = &ToolTelemetry> {
        self.tools.iter().take(usize::from(self.tool_count))
    }

    /// The record for the host.
    pub fn tick_record(&self) -> TickRecord {
        let mut record = TickRecord::empty();
        record.tick = self.tick;
        record.time_ns = self.time_ns;
        record.device_count = self.device_count;
        for ((device, proxy), buttons) in self
            .devices()
            .zip(&mut record.proxies)
            .zip(&mut record.buttons)
        {
            *proxy = (device.pose, device.twist);
            *buttons = device.buttons;
        }
        for tool in self.tools() {
            if let Some(place) = record.tools.get_mut(usize::from(tool.device)) {
                *place = Some(tool.proxy);
            }
        }
        record
    }
}
