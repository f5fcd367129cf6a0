//! Compares two records of one tick, field by field and bit by bit.

use crate::record::{TickRow, energy_sums};
use rt_core::coupling::HostState;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::safety::SafetyState;
use rt_core::{Pose, Twist, Vec3, Withheld, Wrench};
use serde::{Serialize, Serializer};
use std::fmt;

/// The part of a tick's record that contains a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The tick itself.
    Tick,
    /// A device, by index.
    Device(usize),
    /// A body, by index.
    Body(usize),
}

/// The value of a field.
#[derive(Clone, Copy, Debug)]
pub enum Value {
    /// A number, compared bit by bit.
    Number(f64),
    /// A count or a time.
    Count(u64),
    /// A flag.
    Flag(bool),
    /// The state of the last stage.
    Safety(SafetyState),
    /// The state of the coupling.
    Host(HostState),
}

/// A field's name: its part, and its path within the part as in the message definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The part.
    pub part: Part,
    /// The vector or the field.
    pub name: &'static str,
    /// The component; empty if there is none.
    pub component: &'static str,
}

/// A field whose value in the replay differs from the logged value.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Difference {
    /// Number of the tick.
    pub tick: u64,
    /// Its nominal time (ns).
    pub time_ns: u64,
    /// The field.
    pub field: Field,
    /// The logged value.
    pub log: Value,
    /// The value in the replay.
    pub now: Value,
}

/// The first field of `now` that differs from `log` in any bit. Input (readings, lateness) is not compared, because
/// it comes from the log.
pub(super) fn first_difference(log: &TickRow, now: &TickRow) -> Option<Difference> {
    let mut found = None;
    let mut logged = Vec::with_capacity(64);
    visit(log, &mut |field, value| logged.push((field, value)));
    let mut logged = logged.into_iter();
    visit(now, &mut |field, value| {
        // The counts of devices and bodies come first: if two lists differ in length, the counts differ.
        if let Some((_, before)) = logged.next()
            && found.is_none()
            && !same(before, value)
        {
            found = Some(Difference {
                tick: log.tick,
                time_ns: log.time_ns,
                field,
                log: before,
                now: value,
            });
        }
    });
    found
}

fn same(a: Value, b: Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => a.to_bits() == b.to_bits(),
        (Value::Count(a), Value::Count(b)) => a == b,
        (Value::Flag(a), Value::Flag(b)) => a == b,
        (Value::Safety(a), Value::Safety(b)) => a == b,
        (Value::Host(a), Value::Host(b)) => a == b,
        _ => false,
    }
}

/// Gives every field of a tick to `see`, always in the same order. The records are destructured without `..`, so that
/// a new field cannot be forgotten here.
fn visit(row: &TickRow, see: &mut impl FnMut(Field, Value)) {
    let mut put = |part, name, component, value| {
        see(
            Field {
                part,
                name,
                component,
            },
            value,
        );
    };
    let TickRow {
        tick,
        time_ns,
        lateness_ns: _,
        took_ns: _,
        devices,
        bodies,
        readings: _,
    } = row;
    put(Part::Tick, "tick", "", Value::Count(*tick));
    put(Part::Tick, "time_ns", "", Value::Count(*time_ns));
    for (name, count) in [("devices", devices.len()), ("bodies", bodies.len())] {
        put(Part::Tick, name, "", Value::Count(count as u64));
    }
    for (index, device) in devices.iter().enumerate() {
        visit_device(Part::Device(index), device, &mut put);
    }
    for (index, body) in bodies.iter().enumerate() {
        visit_body(Part::Body(index), body, &mut put);
    }
}

fn visit_device(
    part: Part,
    device: &DeviceTelemetry,
    put: &mut impl FnMut(Part, &'static str, &'static str, Value),
) {
    let DeviceTelemetry {
        pose: Pose { position, rotation },
        twist: Twist { linear, angular },
        wrench: Wrench { force, moment },
        slip,
        slip_angle,
        buttons,
        device_time_ns,
        fresh,
        safety,
    } = device;
    vector(part, "position", position, put);
    for (component, x) in ["x", "y", "z", "w"].iter().zip(rotation.coords.iter()) {
        put(part, "orientation", component, Value::Number(*x));
    }
    vector(part, "linear", linear, put);
    vector(part, "angular", angular, put);
    vector(part, "force", force, put);
    vector(part, "torque", moment, put);
    vector(part, "slip", slip, put);
    put(part, "slip_angle", "", Value::Number(*slip_angle));
    put(part, "device_time_ns", "", Value::Count(*device_time_ns));
    put(part, "buttons", "", Value::Count(u64::from(*buttons)));
    put(part, "fresh", "", Value::Flag(*fresh));
    put(part, "safety", "", Value::Safety(*safety));
}

fn visit_body(
    part: Part,
    body: &BodyTelemetry,
    put: &mut impl FnMut(Part, &'static str, &'static str, Value),
) {
    let BodyTelemetry {
        sequence,
        epoch,
        age_ns,
        trust,
        state,
        withheld,
        energy,
    } = body;
    let Withheld { force, of } = withheld;
    put(part, "withheld", "", Value::Number(*force));
    put(part, "of", "", Value::Number(*of));
    put(part, "sequence", "", Value::Count(*sequence));
    put(part, "epoch", "", Value::Count(u64::from(*epoch)));
    put(part, "age_ns", "", Value::Count(*age_ns));
    put(part, "trust", "", Value::Number(*trust));
    put(part, "state", "", Value::Host(*state));
    for (name, sum) in energy_sums(energy) {
        put(part, name, "", Value::Number(sum));
    }
    put(part, "capped", "", Value::Count(energy.capped));
}

fn vector(
    part: Part,
    name: &'static str,
    v: &Vec3,
    put: &mut impl FnMut(Part, &'static str, &'static str, Value),
) {
    for (component, x) in ["x", "y", "z"].iter().zip(v.iter()) {
        put(part, name, component, Value::Number(*x));
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (tick, seconds) = (self.tick, self.time_ns as f64 * 1e-9);
        let Self {
            field, log, now, ..
        } = self;
        write!(
            f,
            "tick {tick} ({seconds:.3} s): {field}: log {log}, now {now}"
        )
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.part {
            Part::Tick => {}
            Part::Device(index) => write!(f, "device {index} ")?,
            Part::Body(index) => write!(f, "body {index} ")?,
        }
        f.write_str(self.name)?;
        if self.component.is_empty() {
            Ok(())
        } else {
            write!(f, ".{}", self.component)
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // The bits tell which of the many values it is.
            Self::Number(x) if x.is_nan() => write!(f, "not a number (0x{:016x})", x.to_bits()),
            // Enough digits to distinguish the number from its neighbours.
            Self::Number(x) => write!(f, "{x:?}"),
            Self::Count(n) => write!(f, "{n}"),
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Safety(state) => write!(f, "{state:?}"),
            Self::Host(state) => write!(f, "{state:?}"),
        }
    }
}

/// Serialized as printed: JSON numbers have no value for NaN and no room for 64 bits.
impl Serialize for Value {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

/// Serialized as printed.
impl Serialize for Field {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}
