//! The verdict on the trials of a study under one scheme, in a line: whether they are passive, bounded and true to the body.

use super::CellResult;
use super::measure::Outcome;
use super::summary::JUST_NOTICEABLE;
use crate::stress::hold::verdict::NET_ENERGY;
use std::fmt;

/// Trials that do not meet one demand.
#[derive(Clone, Debug, Default, PartialEq)]
struct Missed {
    /// Number of these trials.
    count: usize,
    /// The trial that is farthest from the demand, and its value.
    worst: Option<(u64, f64)>,
}

impl Missed {
    fn add(&mut self, cell: u64, value: f64) {
        self.count += 1;
        if self.worst.is_none_or(|(_, most)| value > most) {
            self.worst = Some((cell, value));
        }
    }
}

/// How the trials of a study went under a scheme.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    scheme: String,
    /// Number of trials, and of those that could not be run.
    trials: usize,
    not_run: usize,
    /// Trials that miss any of the demands.
    missed: usize,
    active: Missed,
    unbounded: Missed,
    untrue: Missed,
}

/// Whether a run is passive: its net energy is no more than a millijoule, as in `palpate stress hold`.
fn is_passive(outcome: &Outcome) -> bool {
    outcome.net_energy <= NET_ENERGY
}

/// Whether the force of the hold is that of the body, as far as a hand notices.
fn is_true(outcome: &Outcome) -> bool {
    outcome.stiffness_error <= JUST_NOTICEABLE
}

impl Verdict {
    /// The verdict on `cells` under `scheme`; `None` if no trial was run under it.
    pub fn of<'a>(
        cells: impl Iterator<Item = (&'a u64, &'a CellResult)>,
        scheme: &str,
    ) -> Option<Self> {
        let mut found = Self {
            scheme: scheme.to_owned(),
            trials: 0,
            not_run: 0,
            missed: 0,
            active: Missed::default(),
            unbounded: Missed::default(),
            untrue: Missed::default(),
        };
        for (&number, cell) in cells {
            let outcome = cell.schemes.get(scheme);
            if cell.failed.is_some() {
                found.trials += 1;
                found.not_run += 1;
            } else if let Some(outcome) = outcome {
                found.trials += 1;
                found.add(number, outcome);
            }
        }
        (found.trials > found.not_run).then_some(found)
    }

    fn add(&mut self, number: u64, outcome: &Outcome) {
        if !is_passive(outcome) {
            self.active.add(number, outcome.net_energy);
        }
        if !outcome.bounded {
            self.unbounded.add(number, outcome.stillness.ripple);
        }
        if !is_true(outcome) {
            self.untrue.add(number, outcome.stiffness_error);
        }
        let good = is_passive(outcome) && outcome.bounded && is_true(outcome);
        self.missed += usize::from(!good);
    }

    /// Whether every trial was run and meets all demands.
    pub fn is_passed(&self) -> bool {
        self.missed == 0 && self.not_run == 0
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (trials, scheme) = (self.trials, &self.scheme);
        if self.is_passed() {
            return write!(
                f,
                "passive, bounded and true to the body under {scheme}: {}",
                match trials {
                    1 => "the only trial".to_owned(),
                    _ => format!("all {trials} trials"),
                }
            );
        }
        let mut parts = Vec::new();
        let mut tell = |missed: &Missed, words: &str, value: &dyn Fn(f64) -> String| {
            if let Some((cell, worst)) = missed.worst {
                let count = missed.count;
                parts.push(format!(
                    "{count} not {words} (trial {cell}: {})",
                    value(worst)
                ));
            }
        };
        tell(&self.active, "passive", &|joules| {
            format!("{:.2} mJ", 1e3 * joules)
        });
        tell(&self.unbounded, "bounded", &|ripple| {
            format!("ripple {ripple:.2} N")
        });
        tell(&self.untrue, "true", &|error| {
            format!("force of the hold off by {:.0} %", 100.0 * error)
        });
        if self.not_run > 0 {
            parts.push(format!("{} not run", self.not_run));
        }
        write!(
            f,
            "FAILED under {scheme}: {} of {trials} trials: {}",
            self.missed + self.not_run,
            parts.join(", ")
        )
    }
}

/// The verdict on one run, in words.
pub fn of_outcome(outcome: &Outcome) -> String {
    let not = |holds: bool| if holds { "" } else { "not " };
    format!(
        "{}passive, {}bounded, {}true to the body",
        not(is_passive(outcome)),
        not(outcome.bounded),
        not(is_true(outcome))
    )
}

#[cfg(test)]
mod tests {
    use super::super::draw::Draw;
    use super::super::force_errors::ForceErrors;
    use super::super::measure::Stillness;
    use super::*;
    use std::collections::BTreeMap;

    fn cell(net_energy: f64, ripple: f64, stiffness_error: f64) -> CellResult {
        let outcome = Outcome {
            bounded: ripple < 0.3,
            stillness: Stillness {
                ripple,
                ..Stillness::default()
            },
            net_energy,
            error: 0.0,
            error_aware: None,
            error_untroubled: None,
            stiffness_error,
            capped: 0.0,
            force_errors: ForceErrors::default(),
        };
        CellResult {
            draw: Draw::new(1, 0, 1),
            specimen: None,
            reference: Stillness::default(),
            reference_net_energy: 0.0,
            schemes: BTreeMap::from([("capped".to_owned(), outcome)]),
            failed: None,
        }
    }

    fn said(cells: &[CellResult]) -> String {
        let cells: BTreeMap<u64, CellResult> = (0..).zip(cells.iter().cloned()).collect();
        Verdict::of(cells.iter(), "capped")
            .expect("a verdict")
            .to_string()
    }

    #[test]
    fn the_verdict_names_what_failed_with_the_worst_trial() {
        let good = cell(0.5e-3, 0.1, 0.05);
        assert_eq!(
            said(&[good.clone(), good.clone()]),
            "passive, bounded and true to the body under capped: all 2 trials"
        );
        let (active, more) = (cell(2e-3, 0.1, 0.0), cell(3.5e-3, 0.5, 0.28));
        let mut lost = good.clone();
        lost.failed = Some("a device without damping".to_owned());
        assert_eq!(
            said(&[good.clone(), active, more, lost]),
            "FAILED under capped: 3 of 4 trials: 2 not passive (trial 2: 3.50 mJ), 1 not bounded (trial 2: ripple 0.50 N), 1 \
             not true (trial 2: force of the hold off by 28 %), 1 not run"
        );
        let none = BTreeMap::from([(0, good)]);
        assert_eq!(Verdict::of(none.iter(), "linear"), None);
    }
}
