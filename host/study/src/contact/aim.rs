//! An aim of the design with what was measured.

use serde::Serialize;

/// A line of the table of aims.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Aim {
    /// What is measured.
    pub name: String,
    /// The unit of both numbers; empty for pure numbers and counts.
    pub unit: &'static str,
    /// The most that is asked for, in `unit`.
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
            ask,
            ours,
            is_reached: ours <= ask,
        }
    }
}
