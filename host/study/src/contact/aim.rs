//! An aim of the design with what was measured.

use serde::Serialize;
use std::borrow::Cow;

/// A line of the table of aims.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Aim {
    /// What is measured.
    pub name: Cow<'static, str>,
    /// The unit of both numbers; empty for pure numbers and counts.
    pub unit: &'static str,
    /// The most that is asked for, in the unit.
    pub ask: f64,
    /// What was measured, in the unit.
    pub ours: f64,
    /// Whether the aim is reached.
    pub is_reached: bool,
}

impl Aim {
    /// A measure that should be at most `ask`.
    pub(super) fn at_most(
        name: impl Into<Cow<'static, str>>,
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
