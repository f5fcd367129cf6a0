//! Two records of one tick, compared field by field and bit by bit.

use crate::log::{TickRow, energy_sums};
use rt_core::coupling::HostState;
use rt_core::safety::SafetyState;
use rt_core::{Pose, Vec3};
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

/// Gives every field of a tick to `see`, always in the same order.
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
    put(Part::Tick, "tick", "", Value::Count(row.tick));
    put(Part::Tick, "time_ns", "", Value::Count(row.time_ns));
    for (name, count) in [("devices", row.devices.len()), ("bodies", row.bodies.len())] {
        put(Part::Tick, name, "", Value::Count(count as u64));
    }
    for (index, device) in row.devices.iter().enumerate() {
        let part = Part::Device(index);
        let Pose { position, rotation } = &device.pose;
        vector(part, "position", position, &mut put);
        for (component, x) in ["x", "y", "z", "w"].iter().zip(rotation.coords.iter()) {
            put(part, "orientation", component, Value::Number(*x));
        }
        vector(part, "linear", &device.twist.linear, &mut put);
        vector(part, "angular", &device.twist.angular, &mut put);
        vector(part, "force", &device.wrench.force, &mut put);
        vector(part, "torque", &device.wrench.moment, &mut put);
        let time = Value::Count(device.device_time_ns);
        put(part, "device_time_ns", "", time);
        let buttons = Value::Count(u64::from(device.buttons));
        put(part, "buttons", "", buttons);
        put(part, "fresh", "", Value::Flag(device.fresh));
        put(part, "safety", "", Value::Safety(device.safety));
    }
    for (index, body) in row.bodies.iter().enumerate() {
        let part = Part::Body(index);
        put(part, "sequence", "", Value::Count(body.sequence));
        put(part, "epoch", "", Value::Count(u64::from(body.epoch)));
        put(part, "age_ns", "", Value::Count(body.age_ns));
        put(part, "trust", "", Value::Number(body.trust));
        put(part, "state", "", Value::Host(body.state));
        for (name, sum) in energy_sums(&body.energy) {
            put(part, name, "", Value::Number(sum));
        }
        put(part, "capped", "", Value::Count(body.energy.capped));
    }
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
