//! An aim of the design with what was measured.

use serde::Serialize;

/// On which side of what is asked for a measure should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// At most what is asked for.
    AtMost,
    /// At least what is asked for.
    AtLeast,
}

/// A line of the table of aims.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Aim {
    /// What is measured.
    pub name: String,
    /// The unit of both numbers; empty for pure numbers and counts.
    pub unit: &'static str,
    /// On which side of `ask` the measure should be.
    pub side: Side,
    /// What is asked for, in `unit`.
    pub ask: f64,
    /// The value measured, in `unit`.
    pub ours: f64,
    /// Whether the aim is reached.
    pub is_reached: bool,
}

impl Aim {
    /// A measure that should be at most `ask`.
    pub(super) fn at_most(
        name: impl Into<String>,
        unit: &'static str,
        ours: f64,
        ask: f64,
    ) -> Self {
        Self {
            name: name.into(),
            unit,
            side: Side::AtMost,
            ask,
            ours,
            is_reached: ours <= ask,
        }
    }

    /// A measure that should be at least `ask`.
    pub(super) fn at_least(
        name: impl Into<String>,
        unit: &'static str,
        ours: f64,
        ask: f64,
    ) -> Self {
        Self {
            side: Side::AtLeast,
            is_reached: ours >= ask,
            ..Self::at_most(name, unit, ours, ask)
        }
    }
}
