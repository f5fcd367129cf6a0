//! Compares two records of one tick, field by field and bit by bit.

use crate::record::TickRow;
use crate::record::field::{Leaf, Record, Visitor, name};
use rt_core::coupling::HostState;
use rt_core::safety::SafetyState;
use serde::{Serialize, Serializer};
use std::fmt;

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

/// A field's name: its part of the tick, and its path within the part as in the message definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// The device or the body, by index; `None` for the tick itself.
    pub part: Option<(&'static str, usize)>,
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
    let [logged, replayed] = [log, now].map(|row| {
        let mut values = Values::default();
        // A list takes every field.
        let _ = row.outputs().fields(&mut values);
        values.found
    });
    // The length of a list precedes its records: if two lists differ in length, the lengths differ.
    let mut pairs = logged.into_iter().zip(replayed);
    let ((_, before), (field, value)) =
        pairs.find(|((_, before), (_, value))| !same(*before, *value))?;
    Some(Difference {
        tick: log.tick,
        time_ns: log.time_ns,
        field: Field {
            name: name(field.name),
            ..field
        },
        log: before,
        now: value,
    })
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

/// The values of a record in their order.
#[derive(Default)]
struct Values {
    found: Vec<(Field, Value)>,
    part: Option<(&'static str, usize)>,
}

impl Visitor for Values {
    fn leaf(&mut self, name: &'static str, component: &'static str, leaf: Leaf<'_>) -> Option<()> {
        let value = match leaf {
            Leaf::Number(x) => Value::Number(*x),
            Leaf::Count(n) => Value::Count(*n),
            Leaf::Small(n) => Value::Count(u64::from(*n)),
            Leaf::Byte(n) => Value::Count(u64::from(*n)),
            Leaf::Flag(flag) => Value::Flag(*flag),
            Leaf::Safety(state) => Value::Safety(*state),
            Leaf::Host(state) => Value::Host(*state),
        };
        let part = self.part;
        let field = Field {
            part,
            name,
            component,
        };
        self.found.push((field, value));
        Some(())
    }

    fn length(&mut self, name: &'static str, length: usize) -> Option<usize> {
        self.part = None;
        self.leaf(name, "", Leaf::Count(&mut (length as u64)))?;
        Some(length)
    }

    fn enter(&mut self, part: &'static str, index: usize) {
        self.part = Some((part, index));
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
        if let Some((part, index)) = self.part {
            write!(f, "{part} {index} ")?;
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
