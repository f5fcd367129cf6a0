//! What the run does without, and what that costs.
//!
//! A realtime loop on an ordinary account still runs, only less surely. Each thing it asked for and did
//! not get is named once, before the first tick, with its price and its remedy.

use std::fmt;

/// Something that was asked for and not obtained.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Degradation {
    /// What is missing.
    pub what: String,
    /// Why.
    pub why: String,
    /// What the tick pays for it.
    pub cost: &'static str,
    /// What the person can do.
    pub remedy: String,
}

impl fmt::Display for Degradation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({}): {}; {}",
            self.what, self.why, self.cost, self.remedy
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_reads_as_one_line() {
        let degradation = Degradation {
            what: "not pinned".into(),
            why: "core 9 does not exist".into(),
            cost: "the tick may move between cores",
            remedy: "choose another core".into(),
        };
        assert_eq!(
            degradation.to_string(),
            "not pinned (core 9 does not exist): the tick may move between cores; choose another core"
        );
    }
}
