//! What passes: the limits of the study, and what of a cell is beyond them.

use super::CellResult;
use crate::stress::scene::measure::{MOST_MOTION, Outcome};

/// The mean force of a hold is off the body's own by at most this share.
pub const HOLD: f64 = 0.01;
/// The force of a run is off by at most this share of its peak (root mean square).
pub const RUN: f64 = 0.05;
/// Ripple beyond the reference's is below this (N, root mean square).
pub const RIPPLE: f64 = 0.05;
/// The cap acts in at most this share of the ticks.
pub const CAPPED: f64 = 1e-3;
/// Net energy that comes out at the hands is below this (J).
pub const NET_ENERGY: f64 = 1e-3;
/// Worse than `linear` is what is off by more than that and this share of the limit.
const WORSE: f64 = 0.2;

/// What is beyond its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Failure {
    /// The hold's force.
    Hold,
    /// The force of the whole run.
    Run,
    /// Ripple.
    Ripple,
    /// The share of ticks in which the cap acts.
    Capped,
    /// Net energy.
    Energy,
    /// One of the first three is beyond that of a stable `linear`.
    Worse,
    /// The cell could not be run.
    Broken,
}

impl Failure {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Hold,
        Self::Run,
        Self::Ripple,
        Self::Capped,
        Self::Energy,
        Self::Worse,
        Self::Broken,
    ];

    /// What tables call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Run => "run",
            Self::Ripple => "ripple",
            Self::Capped => "capped",
            Self::Energy => "energy",
            Self::Worse => "worse",
            Self::Broken => "broken",
        }
    }
}

/// The ratios of hold, run and ripple to their limits, where one count of the encoder makes `count` (N) of the force.
///
/// A force that toggles by a count, half of the time each, has a root mean square of half of that: no encoder knows
/// better. A run may be so far off, and ripple twice as much.
pub fn ratios(outcome: &Outcome, count: f64) -> [f64; 3] {
    let felt = &outcome.felt;
    let run = RUN.max(0.5 * count / felt.peak.max(f64::MIN_POSITIVE));
    [
        felt.hold_error / HOLD,
        felt.run_error / run,
        felt.worst_ripple / RIPPLE.max(count),
    ]
}

/// Whether hands hold still, and get nothing that they did not give.
pub fn is_stable(cell: &CellResult, outcome: &Outcome) -> bool {
    let [_, _, ripple] = ratios(outcome, cell.count);
    ripple < 1.0
        && outcome.stillness.motion < cell.reference.motion + MOST_MOTION
        && outcome.net_energy < NET_ENERGY
}

/// What of `scheme` in a cell is beyond its limit.
pub fn failures(cell: &CellResult, scheme: &str) -> Vec<Failure> {
    let Some(outcome) = cell.schemes.get(scheme) else {
        return vec![Failure::Broken];
    };
    let found = ratios(outcome, cell.count);
    let linear = cell.schemes.get("linear");
    let stable = linear.filter(|linear| is_stable(cell, linear));
    let worse = stable.is_some_and(|linear| {
        let linear = ratios(linear, cell.count);
        found.iter().zip(linear).any(|(a, b)| *a > b + WORSE)
    });
    let [hold, run, ripple] = found.map(|ratio| ratio.is_nan() || ratio >= 1.0);
    let all = [
        (Failure::Hold, hold),
        (Failure::Run, run),
        (Failure::Ripple, ripple),
        (Failure::Capped, outcome.capped >= CAPPED),
        (Failure::Energy, outcome.net_energy >= NET_ENERGY),
        (Failure::Worse, worse),
    ];
    let failed = all.into_iter().filter(|(_, fails)| *fails);
    failed.map(|(what, _)| what).collect()
}
