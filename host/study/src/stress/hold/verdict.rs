//! The limits of the study, and the failures of a cell.

use super::CellResult;
use crate::stress::scene::measure::{MOST_MOTION, Outcome};

/// Largest error of the mean force of a hold, as a fraction of the body's force. The same fraction limits the distance of
/// the handles from their devices in soft directions, as a force.
pub(crate) const HOLD: f64 = 0.01;
/// Largest error of the force of a run (RMS), as a fraction of the peak of the body's force.
pub const RUN: f64 = 0.05;
/// Largest ripple beyond that of the reference (N, RMS).
pub(crate) const RIPPLE: f64 = 0.05;
/// Largest ripple in the hold (N, RMS).
pub(crate) const HOLD_RIPPLE: f64 = 0.1;
/// Largest change of the force from one tick to the next beyond that of the reference, as a multiple of the friction of the
/// device.
pub(crate) const JUMP: f64 = 2.5;
/// Largest fraction of ticks in which the cap acts.
pub(crate) const CAPPED: f64 = 1e-3;
/// Largest net energy (J).
pub(crate) const NET_ENERGY: f64 = 1e-3;
/// A scheme is worse than `linear` if its excess over `linear` is more than this fraction of a limit.
const WORSE: f64 = 0.2;

/// A limit that an outcome exceeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Failure {
    /// The force of the hold.
    Hold,
    /// The force of the whole run.
    Run,
    /// Ripple.
    Ripple,
    /// Ripple in the hold.
    Unrest,
    /// A jump of the force from one tick to the next.
    Jump,
    /// The fraction of ticks in which the cap acts.
    Capped,
    /// Net energy.
    Energy,
    /// Hold, run or ripple is beyond that of a stable `linear`.
    Worse,
    /// The cell could not be run.
    Broken,
}

impl Failure {
    /// All failures, in the order of the tables.
    pub const ALL: [Self; 9] = [
        Self::Hold,
        Self::Run,
        Self::Ripple,
        Self::Unrest,
        Self::Jump,
        Self::Capped,
        Self::Energy,
        Self::Worse,
        Self::Broken,
    ];

    /// The name of the failure in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Run => "run",
            Self::Ripple => "ripple",
            Self::Unrest => "unrest",
            Self::Jump => "jump",
            Self::Capped => "capped",
            Self::Energy => "energy",
            Self::Worse => "worse",
            Self::Broken => "broken",
        }
    }
}

/// The ratios of hold, run and ripple to their limits in a cell. That of the hold is zero if a hand moves.
///
/// A force that alternates by a count, half of the time each, has a root mean square of half of that change: no encoder
/// resolves less. The limit of a run is at least this root mean square; the limit of ripple is at least twice as much.
pub fn ratios(cell: &CellResult, outcome: &Outcome) -> [f64; 3] {
    let (errors, count) = (&outcome.force_errors, cell.count);
    let hold = if cell.moves {
        0.0
    } else {
        errors.hold_error.max(errors.leaves)
    };
    let run = RUN.max(0.5 * count / errors.peak.max(f64::MIN_POSITIVE));
    [
        hold / HOLD,
        errors.run_error / run,
        errors.worst_ripple / RIPPLE.max(count),
    ]
}

/// Whether the hands hold still and gain no energy.
pub(crate) fn is_stable(cell: &CellResult, outcome: &Outcome) -> bool {
    let [_, _, ripple] = ratios(cell, outcome);
    ripple < 1.0
        && outcome.stillness.motion < cell.reference.motion + MOST_MOTION
        && outcome.net_energy < NET_ENERGY
}

/// The limits that `scheme` exceeds in a cell.
pub fn failures(cell: &CellResult, scheme: &str) -> Vec<Failure> {
    let Some(outcome) = cell.schemes.get(scheme) else {
        return vec![Failure::Broken];
    };
    let found = ratios(cell, outcome);
    let linear = cell.schemes.get("linear");
    let stable = linear.filter(|linear| is_stable(cell, linear));
    let worse = stable.is_some_and(|linear| {
        let linear = ratios(cell, linear);
        found.iter().zip(linear).any(|(a, b)| *a > b + WORSE)
    });
    let [hold, run, ripple] = found.map(|ratio| ratio.is_nan() || ratio >= 1.0);
    // If something takes a part of the force away on purpose, the hold that follows counts alone.
    let whole = cell.is_undisturbed();
    let all = [
        (Failure::Hold, hold),
        (Failure::Run, run && whole),
        (Failure::Ripple, ripple && whole),
        (Failure::Unrest, outcome.stillness.ripple >= HOLD_RIPPLE),
        (Failure::Jump, outcome.force_errors.jump >= JUMP && whole),
        (Failure::Capped, outcome.capped >= CAPPED && whole),
        (Failure::Energy, outcome.net_energy >= NET_ENERGY),
        (Failure::Worse, worse && whole),
    ];
    let failed = all.into_iter().filter(|(_, fails)| *fails);
    failed.map(|(failure, _)| failure).collect()
}
