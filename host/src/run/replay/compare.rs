//! Two records of one tick, compared field by field and bit by bit.

use crate::log::{TickRow, energy_sums};
use rt_core::coupling::HostState;
use rt_core::record::{BodyTelemetry, DeviceTelemetry};
use rt_core::safety::SafetyState;
use rt_core::{Pose, Twist, Vec3, Withheld, Wrench};
use serde::{Serialize, Serializer};
use std::fmt;

/// Which part of a tick's record a field is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The tick's own.
    Tick,
    /// A device's, by index.
    Device(usize),
    /// A body's, by index.
    Body(usize),
}

/// What a field holds.
#[derive(Clone, Copy, Debug)]
pub enum Value {
    /// A number, compared bit by bit.
    Number(f64),
    /// A count or a time.
    Count(u64),
    /// Yes or no.
    Flag(bool),
    /// What the last stage did.
    Safety(SafetyState),
    /// What the coupling was doing.
    Host(HostState),
}

/// A field's name: its part, and its path there as in the message definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Which part.
    pub part: Part,
    /// The vector or the field.
    pub name: &'static str,
    /// The component, empty where there is none.
    pub component: &'static str,
}

/// A field that came out otherwise than it was logged.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Difference {
    /// Number of the tick.
    pub tick: u64,
    /// Its nominal time (ns).
    pub time_ns: u64,
    /// The field.
    pub field: Field,
    /// What the log says.
    pub log: Value,
    /// What came out now.
    pub now: Value,
}

/// The first field of `now` that is not, bit by bit, as `log` has it. Input (readings, lateness) is not
/// compared: it comes from the log.
pub(super) fn first_difference(log: &TickRow, now: &TickRow) -> Option<Difference> {
    let mut found = None;
    let mut logged = Vec::with_capacity(64);
    visit(log, &mut |field, value| logged.push((field, value)));
    let mut logged = logged.into_iter();
    visit(now, &mut |field, value| {
        // Counts of devices and bodies come first: where the lists are of unequal length, those differ.
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

/// Gives every field of a tick to `see`, always in the same order. The records are taken apart without `..`, so that a
/// field added to one of them cannot be forgotten here.
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
            // Which of the many.
            Self::Number(x) if x.is_nan() => write!(f, "not a number (0x{:016x})", x.to_bits()),
            // As many digits as tell it from its neighbours.
            Self::Number(x) => write!(f, "{x:?}"),
            Self::Count(n) => write!(f, "{n}"),
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Safety(state) => write!(f, "{state:?}"),
            Self::Host(state) => write!(f, "{state:?}"),
        }
    }
}

/// As it is printed: JSON has no numbers for what is none, nor room for 64 bits.
impl Serialize for Value {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

/// As it is printed.
impl Serialize for Field {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}
