//! The checks of a machine together: their counts, and a line for the start of a run.

use crate::check::{Check, Verdict};
use std::fmt::Write as _;

/// All checks of a machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// The core of the tick for which the machine was judged.
    pub core: usize,
    /// The priority of the tick for which the machine was judged.
    pub priority: u8,
    /// The checks, by group.
    pub checks: Vec<Check>,
}

/// The most names in the line.
const MOST_NAMES: usize = 6;

impl Report {
    /// The checks with this verdict.
    pub fn with(&self, verdict: Verdict) -> impl Iterator<Item = &Check> {
        self.checks
            .iter()
            .filter(move |check| check.verdict == verdict)
    }

    /// The number of checks with this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.with(verdict).count()
    }

    /// The report in a line: `doctor: 11 of 18 as wanted; lacking: PREEMPT_RT, governor (...)`. Checks that do not apply
    /// are not counted.
    pub fn line(&self) -> String {
        let counted = self.checks.len() - self.count(Verdict::NotApplicable);
        let mut line = format!(
            "doctor: {} of {counted} as wanted",
            self.count(Verdict::Met)
        );
        let mut lacking: Vec<_> = self
            .with(Verdict::Lacking)
            .map(|check| check.name)
            .collect();
        // Several devices may lack the same.
        lacking.dedup();
        if !lacking.is_empty() {
            let more = lacking.len().saturating_sub(MOST_NAMES);
            lacking.truncate(MOST_NAMES);
            // Writing to a string does not fail.
            let _ = write!(line, "; lacking: {}", lacking.join(", "));
            if more > 0 {
                let _ = write!(line, " and {more} more");
            }
        }
        let unknown = self.count(Verdict::Unknown);
        if unknown > 0 {
            let _ = write!(line, "; unknown: {unknown}");
        }
        line + " (`palpate doctor` tells the rest)"
    }
}
