//! The draw of a cell by its number: the host, the trouble, the grips and the task.
//!
//! Rates and kinds of trouble follow the number of the cell in turn, so that every range of cells contains the same
//! fraction of each. The rest is drawn.

use crate::chance::Chance;
use serde::{Deserialize, Serialize};
use sim::Arm;

/// Publication rates (Hz).
pub const RATES: [f64; 7] = [20.0, 30.0, 60.0, 125.0, 250.0, 500.0, 1000.0];

/// Length of a run (s).
pub const DURATION: f64 = 4.5;
/// Time at which the hands begin to move (s). The controller uses local models by then.
pub const BEGIN: f64 = 0.4;
/// Time at which the hands have reached their final place (s).
pub(crate) const ARRIVED: f64 = 2.6;
/// Time at which every temporary trouble has ended (s).
const OVER: f64 = 2.5;

/// The kind of fault in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Trouble {
    /// No fault: only the rate and the latency.
    Nothing,
    /// The host stalls.
    Stalls,
    /// Models are late at random, and models and records are lost.
    Losses,
    /// The body softens abruptly.
    Softening,
    /// A device vanishes and returns.
    Vanishing,
    /// All of these.
    All,
}

impl Trouble {
    /// All kinds.
    pub const ALL: [Self; 6] = [
        Self::Nothing,
        Self::Stalls,
        Self::Losses,
        Self::Softening,
        Self::Vanishing,
        Self::All,
    ];

    fn includes(self, other: Self) -> bool {
        self == other || self == Self::All
    }

    /// The name of the trouble in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Stalls => "stalls",
            Self::Losses => "losses",
            Self::Softening => "softening",
            Self::Vanishing => "vanishing",
            Self::All => "all",
        }
    }
}

/// The rates and the kinds of trouble that the cells take in turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Publication rates (Hz), at least one.
    pub rates: Vec<f64>,
    /// Kinds of trouble, at least one.
    pub troubles: Vec<Trouble>,
}

impl Default for Choice {
    /// All of them.
    fn default() -> Self {
        Self {
            rates: RATES.to_vec(),
            troubles: Trouble::ALL.to_vec(),
        }
    }
}

/// The motion of the hands before they hold still.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// Move to a place, half back, and to the place again.
    Press,
    /// Move to a place and back several times.
    Tap,
    /// Move to a place, then to and fro across.
    Rub,
    /// Move to a place, then to and fro along the direction of the motion, fast.
    Shake,
    /// Move to a place, then all hands in the same direction across.
    Carry,
}

const TASKS: [Task; 5] = [Task::Press, Task::Tap, Task::Rub, Task::Shake, Task::Carry];

/// An interval of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Span {
    /// Its start (s).
    pub at: f64,
    /// Its length (s).
    pub duration: f64,
}

impl Span {
    /// Whether `time` (s) lies in the interval.
    pub fn holds(&self, time: f64) -> bool {
        (self.at..self.at + self.duration).contains(&time)
    }
}

/// The body becomes softer at some time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Softening {
    /// The time (s).
    pub at: f64,
    /// The remaining fraction of the stiffness.
    pub left: f64,
}

/// A device that gives no states and renders no forces for some time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Vanishing {
    /// The device.
    pub device: usize,
    /// The interval.
    pub span: Span,
}

/// One person's hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grip {
    /// Moving mass (kg).
    pub mass: f64,
    /// Damping towards the hand's target (N s/m).
    pub damping: f64,
    /// Stiffness towards the hand's target (N/m).
    pub stiffness: f64,
}

/// All that is drawn for one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// Local models a second (Hz).
    pub rate: f64,
    /// Time from the state of a model to the arrival of the model (s).
    pub latency: f64,
    /// Largest random delay beyond the latency, as a fraction of latency and period together.
    pub jitter: f64,
    /// Fraction of models that are lost.
    pub models_lost: f64,
    /// Fraction of records of the hands that are lost.
    pub records_lost: f64,
    /// The kind of fault.
    pub trouble: Trouble,
    /// The intervals in which the host stalls.
    pub stalls: Vec<Span>,
    /// The softening of the body.
    pub softening: Option<Softening>,
    /// The vanishing of a device.
    pub vanishing: Option<Vanishing>,
    /// The grip of each device.
    pub grips: Vec<Grip>,
    /// The motion of the hands.
    pub task: Task,
    /// Displacement of the hands, as a fraction of that in the scene.
    pub depth: f64,
    /// How fast the hands move, from 0 to 1.
    pub haste: f64,
}

impl Draw {
    /// Draws cell number `cell` of the study of `seed`, for `devices` devices.
    pub fn new(seed: u64, cell: u64, devices: usize) -> Self {
        Self::among(&Choice::default(), seed, cell, devices)
    }

    /// Draws a cell with a rate and a trouble of `choice`. The choice changes nothing else in the draw.
    pub fn among(choice: &Choice, seed: u64, cell: u64, devices: usize) -> Self {
        let chance = Chance::new(seed, cell);
        let Choice { rates, troubles } = choice;
        let rate = rates[(cell % rates.len() as u64) as usize];
        let turn = cell / rates.len() as u64;
        let trouble = troubles[(turn % troubles.len() as u64) as usize];
        let lossy = trouble.includes(Trouble::Losses);
        let lost = |n| {
            if lossy {
                chance.of("losses").between(n, 0.0, 0.5)
            } else {
                0.0
            }
        };
        // Half of all hosts are at most 25 ms late, the worst 100 ms.
        let latency = 0.1 * chance.of("latency").unit(0).powi(2);
        Self {
            rate,
            latency,
            jitter: lost(0),
            models_lost: lost(1),
            records_lost: lost(2),
            trouble,
            stalls: if trouble.includes(Trouble::Stalls) {
                stalls(chance.of("stalls"))
            } else {
                Vec::new()
            },
            softening: trouble.includes(Trouble::Softening).then(|| {
                let chance = chance.of("softening");
                Softening {
                    at: chance.between(0, BEGIN + 0.3, OVER),
                    left: chance.between(1, 0.1, 0.7),
                }
            }),
            vanishing: trouble.includes(Trouble::Vanishing).then(|| {
                let chance = chance.of("vanishing");
                Vanishing {
                    device: (chance.unit(0) * devices as f64) as usize,
                    span: span(chance, 1, 0.02, 1.0),
                }
            }),
            grips: (0..devices)
                .map(|device| grip(chance.of("grip"), device as u64))
                .collect(),
            task: TASKS[(chance.of("task").unit(0) * TASKS.len() as f64) as usize],
            depth: chance.of("task").between(1, 0.3, 1.0),
            haste: chance.of("task").unit(2),
        }
    }

    /// A host of `rate` models a second (Hz) with the latency `latency` (s), without faults. The scene states the grips
    /// and the task.
    pub(crate) fn untroubled(rate: f64, latency: f64) -> Self {
        Self {
            rate,
            latency,
            jitter: 0.0,
            models_lost: 0.0,
            records_lost: 0.0,
            trouble: Trouble::Nothing,
            stalls: Vec::new(),
            softening: None,
            vanishing: None,
            grips: Vec::new(),
            task: Task::Press,
            depth: 1.0,
            haste: 0.0,
        }
    }

    /// Whether the device of this number is absent at `time` (s), or has not fully returned.
    pub(super) fn is_gone(&self, device: usize, time: f64) -> bool {
        let mut gone = self.vanishing.iter().filter(|gone| gone.device == device);
        gone.any(|gone| lasting(&gone.span).holds(time))
    }

    /// Whether a fault or its consequences last at `time` (s).
    pub(crate) fn is_troubled(&self, time: f64) -> bool {
        let softens = self.softening.map(|softening| Span {
            at: softening.at,
            duration: 0.0,
        });
        let vanishes = self.vanishing.map(|vanishing| vanishing.span);
        let mut spans = self.stalls.iter().copied().chain(softens).chain(vanishes);
        spans.any(|span| lasting(&span).holds(time))
    }
}

/// `span` with its consequences: the force returns in a fifth of a second, and the hand has moved meanwhile.
fn lasting(span: &Span) -> Span {
    Span {
        at: span.at,
        duration: span.duration + 0.5,
    }
}

/// An interval that is from `low` to `high` long, on a logarithmic scale, and ends before [`OVER`].
fn span(chance: Chance, n: u64, low: f64, high: f64) -> Span {
    let duration = low * libm::pow(high / low, chance.unit(2 * n));
    let latest = OVER - duration;
    Span {
        at: chance.between(2 * n + 1, BEGIN.min(latest), latest),
        duration,
    }
}

/// One to three stalls of 50 to 2,000 ms.
fn stalls(chance: Chance) -> Vec<Span> {
    let count = 1 + (3.0 * chance.unit(0)) as u64;
    (1..=count).map(|n| span(chance, n, 0.05, 2.0)).collect()
}

/// A grip between the relaxed and the rigid grip of simulated hands, all on logarithmic scales. Firm hands are usually
/// heavy: each number deviates from a common firmness.
pub(in crate::stress) fn grip(chance: Chance, device: u64) -> Grip {
    let firmness = chance.unit(4 * device);
    let stray = |n| (firmness + chance.between(4 * device + n, -0.25, 0.25)).clamp(0.0, 1.0);
    let scale = |low: f64, high: f64, n| low * libm::pow(high / low, stray(n));
    let (low, high) = (Arm::RELAXED, Arm::RIGID);
    Grip {
        mass: scale(low.mass, high.mass, 1),
        damping: scale(low.damping, high.damping, 2),
        stiffness: scale(low.stiffness, high.stiffness, 3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_repeat_and_stay_in_what_the_study_states() {
        for cell in 0..2000 {
            let draw = Draw::new(3, cell, 2);
            assert_eq!(draw, Draw::new(3, cell, 2));
            assert!(RATES.contains(&draw.rate) && (0.0..=0.1).contains(&draw.latency));
            for fraction in [draw.jitter, draw.models_lost, draw.records_lost] {
                assert!((0.0..=0.5).contains(&fraction));
            }
            for stall in &draw.stalls {
                assert!((0.05..=2.0).contains(&stall.duration));
                assert!(stall.at >= BEGIN && stall.at + stall.duration <= OVER + 1e-12);
            }
            for grip in &draw.grips {
                // A number between two bounds is a power of their ratio, which rounds.
                let within = |x: f64, low: f64, high: f64| {
                    assert!(x >= low * (1.0 - 1e-12) && x <= high * (1.0 + 1e-12), "{x}");
                };
                within(grip.mass, 0.1, 2.0);
                within(grip.damping, 2.0, 60.0);
                within(grip.stiffness, 30.0, 2000.0);
            }
            assert!(draw.vanishing.is_none_or(|v| v.device < 2));
        }
    }

    #[test]
    fn a_choice_decides_rate_and_trouble_alone() {
        let choice = Choice {
            rates: vec![90.0],
            troubles: vec![Trouble::Stalls, Trouble::All],
        };
        for cell in 0..200 {
            let draw = Draw::among(&choice, 1, cell, 2);
            let expected = choice.troubles[cell as usize % 2];
            assert_eq!((draw.rate, draw.trouble), (90.0, expected));
            assert!(!draw.stalls.is_empty());
            let all = Draw::new(1, cell, 2);
            assert_eq!((draw.latency, &draw.grips), (all.latency, &all.grips));
            assert_eq!(
                (draw.task, draw.depth, draw.haste),
                (all.task, all.depth, all.haste)
            );
        }
    }

    #[test]
    fn every_rate_meets_every_trouble() {
        let mut met: Vec<_> = (0..42)
            .map(|cell| Draw::new(1, cell, 1))
            .map(|draw| (draw.rate as u64, draw.trouble))
            .collect();
        met.sort_unstable();
        met.dedup();
        assert_eq!(met.len(), RATES.len() * Trouble::ALL.len());
    }
}
