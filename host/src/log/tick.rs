//! One tick as a ROS 2 message: the definition of the message, and the conversion from and to [`Telemetry`].

use rt_core::coupling::HostState;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::safety::SafetyState;
use rt_core::{EnergyAccount, Telemetry, Withheld};

use super::cdr::{CdrReader, CdrWriter};
use super::geometry::geometry_messages;
use crate::record::{LoggedReading, TickRow, energy_sums};

/// Name of the message type.
pub(super) const SCHEMA_NAME: &str = "palpate_msgs/msg/Tick";

/// The message definition, with the definitions that it uses. Poses, twists and wrenches are the standard ROS
/// types, which tools can display. A `torque` is the moment about the handle. A log whose fields differ
/// from those of this text is refused, so any edit of a field makes older logs unreadable.
pub(super) const SCHEMA: &str = concat!(
    "\
# One pass of the haptic loop. SI units; world axes.
uint64 tick         # number of the tick, from zero
uint64 time_ns      # its nominal time
uint64 lateness_ns  # how late it woke
uint64 took_ns      # from there until just before its commands left
palpate_msgs/Device[] devices
palpate_msgs/Body[] bodies
palpate_msgs/Reading[] readings  # by device
================================================================================
MSG: palpate_msgs/Device
uint8 NORMAL=0
uint8 LIMITED=1
uint8 RECOVERING=2
uint8 DEVICE_STALE=3
uint8 NOT_A_NUMBER=4
uint8 SLEWED=5
uint8 TOO_FAST=6
uint8 OUT_OF_REACH=7
uint8 HOT=8
uint8 ENGAGING=9
uint8 HANDS_OFF=10
uint8 DISARMED=11
uint8 STOPPED=12
uint8 LET_GO=13
uint8 DEVICE_FAULT=14
geometry_msgs/Pose pose      # of the proxy
geometry_msgs/Twist twist    # of the proxy
geometry_msgs/Wrench wrench  # on the hand, as it left for the device
geometry_msgs/Vector3 slip   # of the proxy against its hand; part of the pose
float64 slip_angle           # of that slip (rad)
uint64 device_time_ns        # the device's own clock
uint32 buttons               # one bit each; the two highest are the operator's orders
bool fresh                   # whether the device gave a good state this tick
uint8 safety                 # what the last stage did to the wrench
================================================================================
MSG: palpate_msgs/Body
uint8 WAITING=0
uint8 LIVE=1
uint8 FADING=2
uint8 HELD=3
uint64 sequence  # of the model in use; zero before the first
uint64 age_ns    # of that model
float64 trust    # in it, from zero (safe hold) to one
uint32 epoch     # of its topology
uint8 state      # what the coupling was doing
float64 withheld # force that the cap withholds (N)
float64 of       # force of the model's springs there (N)
# Energy (J) between the hands and the body, sums since the start: a lost message loses nothing.
float64 supplied   # net work of the hands
float64 raised     # part of it that lifted weight
float64 least      # least that supplied - raised + credited ever was
float64 initial    # stored when the first model came
float64 stored     # that could be got back now
float64 credited   # dissipated by devices and relied on
float64 available  # what the cap has to spend
uint64 capped      # ticks in which it took something off
================================================================================
MSG: palpate_msgs/Reading
# What the device gave, as it gave it: its own axes. All zero where it gave nothing.
uint8 OK=0
uint8 NO_REPORT=1
uint8 DISCONNECTED=2
uint8 BUSY=3
uint8 BAD_LENGTH=4
uint8 BAD_CHECK_SUM=5
uint8 BAD_VERSION=6
uint8 BAD_KIND=7
uint8 OUT_OF_RANGE=8
geometry_msgs/Pose pose
geometry_msgs/Twist twist
uint64 device_time_ns
uint32 buttons
int32 system_error  # where it is disconnected
uint8 status
uint8 COMMANDED=0
uint8 LET_GO=1
uint8 FAULT=2
uint8 rendering     # what the device says of the wrenches that it is commanded
uint8 fault         # number of the fault, where it has one
",
    geometry_messages!()
);

/// Writes `telemetry` into `bytes`, in place of the former content.
pub(crate) fn encode(telemetry: &Telemetry, bytes: &mut Vec<u8>) {
    let mut out = CdrWriter::begin(bytes);
    out.u64(telemetry.tick);
    out.u64(telemetry.time_ns);
    out.u64(telemetry.lateness_ns);
    out.u64(telemetry.took_ns);
    out.u32(telemetry.devices().count() as u32);
    for device in telemetry.devices() {
        encode_device(device, &mut out);
    }
    out.u32(telemetry.bodies().count() as u32);
    for body in telemetry.bodies() {
        out.u64(body.sequence);
        out.u64(body.age_ns);
        out.f64(body.trust);
        out.u32(body.epoch);
        out.u8(body.state.code());
        out.f64(body.withheld.force);
        out.f64(body.withheld.of);
        for (_, sum) in energy_sums(&body.energy) {
            out.f64(sum);
        }
        out.u64(body.energy.capped);
    }
    out.u32(telemetry.readings().count() as u32);
    for reading in telemetry.readings() {
        LoggedReading::from(reading).encode(&mut out);
    }
}

fn encode_device(device: &DeviceTelemetry, out: &mut CdrWriter) {
    out.pose(&device.pose);
    out.twist(&device.twist);
    out.wrench(&device.wrench);
    out.vector(&device.slip);
    out.f64(device.slip_angle);
    out.u64(device.device_time_ns);
    out.u32(device.buttons);
    out.u8(u8::from(device.fresh));
    out.u8(device.safety.code());
}

/// Reads a tick back; `None` if the message is too short or holds an unknown code.
pub(super) fn decode(message: &[u8]) -> Option<TickRow> {
    let mut from = CdrReader::begin(message)?;
    let (tick, time_ns) = (from.u64()?, from.u64()?);
    let (lateness_ns, took_ns) = (from.u64()?, from.u64()?);
    // No memory is reserved for the counts: a false count only runs into the end of the message.
    let device_count = from.u32()?;
    let devices = (0..device_count)
        .map(|_| decode_device(&mut from))
        .collect::<Option<_>>()?;
    let body_count = from.u32()?;
    let bodies = (0..body_count)
        .map(|_| decode_body(&mut from))
        .collect::<Option<_>>()?;
    let reading_count = from.u32()?;
    let readings = (0..reading_count)
        .map(|_| LoggedReading::decode(&mut from))
        .collect::<Option<_>>()?;
    Some(TickRow {
        tick,
        time_ns,
        lateness_ns,
        took_ns,
        devices,
        bodies,
        readings,
    })
}

fn decode_device(from: &mut CdrReader) -> Option<DeviceTelemetry> {
    Some(DeviceTelemetry {
        pose: from.pose()?,
        twist: from.twist()?,
        wrench: from.wrench()?,
        slip: from.vector()?,
        slip_angle: from.f64()?,
        device_time_ns: from.u64()?,
        buttons: from.u32()?,
        fresh: from.u8()? != 0,
        safety: *SafetyState::ALL.get(usize::from(from.u8()?))?,
    })
}

fn decode_body(from: &mut CdrReader) -> Option<BodyTelemetry> {
    Some(BodyTelemetry {
        sequence: from.u64()?,
        age_ns: from.u64()?,
        trust: from.f64()?,
        epoch: from.u32()?,
        state: *HostState::ALL.get(usize::from(from.u8()?))?,
        withheld: Withheld {
            force: from.f64()?,
            of: from.f64()?,
        },
        energy: EnergyAccount {
            supplied: from.f64()?,
            raised: from.f64()?,
            least: from.f64()?,
            initial: from.f64()?,
            stored: from.f64()?,
            credited: from.f64()?,
            available: from.f64()?,
            capped: from.u64()?,
        },
    })
}
