//! A check: the entry of a table, and what the machine says of the entry.

use crate::step::Step;
use serde::Serialize;

/// The judgement of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The machine has what is wanted.
    Met,
    /// The machine lacks what is wanted.
    Lacking,
    /// The system does not tell.
    Unknown,
    /// The machine has no part to which the check applies.
    NotApplicable,
}

/// A check with its result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Check {
    /// Identifier, such as `preempt-rt`.
    pub id: &'static str,
    /// Name for people.
    pub name: &'static str,
    /// Connection of the device that the check is about; `None` for a check of the machine.
    pub device: Option<String>,
    /// The judgement.
    pub verdict: Verdict,
    /// What the machine has.
    pub found: String,
    /// What a steady tick wants.
    pub wanted: String,
    /// The cost to the tick if the machine lacks it.
    pub cost: &'static str,
    /// The steps that mend it, in order; none unless the machine lacks it.
    pub steps: Vec<Step>,
}

/// The part of a check that does not depend on the machine.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) id: &'static str,
    pub(crate) name: &'static str,
    pub(crate) cost: &'static str,
}

/// What the machine says of an entry.
pub(crate) enum Finding {
    Met(String),
    Lacking(String, Vec<Step>),
    Unknown(String),
    NotApplicable(String),
}

impl Entry {
    /// The check of this entry, in which `wanted` is asked for.
    pub(crate) fn check(self, wanted: impl Into<String>, finding: Finding) -> Check {
        let (verdict, found, steps) = match finding {
            Finding::Met(found) => (Verdict::Met, found, Vec::new()),
            Finding::Lacking(found, steps) => (Verdict::Lacking, found, steps),
            Finding::Unknown(found) => (Verdict::Unknown, found, Vec::new()),
            Finding::NotApplicable(found) => (Verdict::NotApplicable, found, Vec::new()),
        };
        Check {
            id: self.id,
            name: self.name,
            device: None,
            verdict,
            found,
            wanted: wanted.into(),
            cost: self.cost,
            steps,
        }
    }
}
