//! The resources that the run does without, and their cost.
//!
//! A realtime loop on an ordinary account runs, but with fewer guarantees. Each resource that the loop asked for and
//! did not get is named once, before the first tick, with its cost and its remedy.

use std::fmt;

/// A resource that was asked for and not obtained.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Degradation {
    /// The missing resource.
    pub missing: String,
    /// The reason.
    pub reason: String,
    /// The cost to the tick.
    pub cost: &'static str,
    /// The remedy for the user.
    pub remedy: String,
}

impl fmt::Display for Degradation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({}): {}; {}",
            self.missing, self.reason, self.cost, self.remedy
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_degradation_is_one_line() {
        let degradation = Degradation {
            missing: "not pinned".into(),
            reason: "core 9 does not exist".into(),
            cost: "the tick may move between cores",
            remedy: "choose another core".into(),
        };
        assert_eq!(
            degradation.to_string(),
            "not pinned (core 9 does not exist): the tick may move between cores; choose another core"
        );
    }
}
