//! What a cell's number decides: how a run's host is, what goes wrong, who holds the devices and what they do.
//!
//! Rates and kinds of trouble follow the cell's number in turn, so that any stretch of cells has the same share of
//! each; the rest is drawn.

use crate::stress::chance::Chance;
use serde::{Deserialize, Serialize};

/// Publication rates (Hz).
pub const RATES: [f64; 7] = [20.0, 30.0, 60.0, 125.0, 250.0, 500.0, 1000.0];

/// Length of a run (s).
pub const DURATION: f64 = 4.5;
/// When hands begin to move (s): local models have come and been taken into use by then.
pub const BEGIN: f64 = 0.4;
/// When they have come to where they stay (s).
pub const ARRIVED: f64 = 2.6;
/// Whatever goes wrong for a while is over by then (s).
const OVER: f64 = 2.5;

/// What goes wrong in a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Trouble {
    /// Nothing but the rate and the latency.
    Nothing,
    /// The host stalls.
    Stalls,
    /// Models are late by chance, and models and records are lost.
    Losses,
    /// The body softens abruptly.
    Softening,
    /// A device vanishes and comes back.
    Vanishing,
    /// All of it.
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

    /// What tables call it.
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

/// What the hands do before they hold still.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Task {
    /// Go to a place, half back, and there again.
    Press,
    /// Go there and back several times.
    Tap,
    /// Go there, then to and fro across.
    Rub,
    /// Go there, then to and fro along the way, fast.
    Shake,
    /// Go there, then all hands the same way across.
    Carry,
}

const TASKS: [Task; 5] = [Task::Press, Task::Tap, Task::Rub, Task::Shake, Task::Carry];

/// Something that lasts a while.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Span {
    /// From when (s).
    pub at: f64,
    /// For how long (s).
    pub duration: f64,
}

impl Span {
    /// Whether `time` (s) lies in it.
    pub fn holds(&self, time: f64) -> bool {
        (self.at..self.at + self.duration).contains(&time)
    }
}

/// The body is made of something softer from then on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Softening {
    /// From when (s).
    pub at: f64,
    /// Share of its stiffness that is left.
    pub left: f64,
}

/// A device that gives no states and renders no forces for a while.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Vanishing {
    /// Which device.
    pub device: usize,
    /// When.
    pub span: Span,
}

/// One person's hand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grip {
    /// Moving mass (kg).
    pub mass: f64,
    /// Damping towards where the hand wants to be (N s/m).
    pub damping: f64,
    /// Stiffness towards it (N/m).
    pub stiffness: f64,
}

/// All that is drawn for one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Draw {
    /// Local models a second (Hz).
    pub rate: f64,
    /// From the state that a model tells of to its arrival (s).
    pub latency: f64,
    /// How much later it may come by chance, as a share of latency and period together.
    pub jitter: f64,
    /// Share of models that are lost.
    pub models_lost: f64,
    /// Share of records of the hands that are lost.
    pub records_lost: f64,
    /// What goes wrong, in a word.
    pub trouble: Trouble,
    /// When the host does nothing.
    pub stalls: Vec<Span>,
    /// The body that softens.
    pub softening: Option<Softening>,
    /// The device that vanishes.
    pub vanishing: Option<Vanishing>,
    /// How each device is held.
    pub grips: Vec<Grip>,
    /// What the hands do.
    pub task: Task,
    /// How far they go, as a share of how far they go in the scene.
    pub depth: f64,
    /// How fast they are, from 0 to 1.
    pub haste: f64,
}

impl Draw {
    /// Draws cell number `cell` of the study of `seed`, for so many devices.
    pub fn new(seed: u64, cell: u64, devices: usize) -> Self {
        let chance = Chance::new(seed, cell);
        let kinds = Trouble::ALL.len() as u64;
        let rate = RATES[(cell % RATES.len() as u64) as usize];
        let trouble = Trouble::ALL[(cell / RATES.len() as u64 % kinds) as usize];
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

    /// A host of so many models a second (Hz) that are `latency` late (s), and nothing goes wrong. Who holds the devices
    /// and what they do stands in the scene.
    pub(in crate::stress) fn untroubled(rate: f64, latency: f64) -> Self {
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

    /// Whether the device of this number is gone at `time` (s), or not all back.
    pub(super) fn is_gone(&self, device: usize, time: f64) -> bool {
        let mut gone = self.vanishing.iter().filter(|gone| gone.device == device);
        gone.any(|gone| lasting(&gone.span).holds(time))
    }

    /// Whether something that lasts a while goes on at `time` (s), or what it left behind.
    pub fn is_troubled(&self, time: f64) -> bool {
        let softens = self.softening.map(|softening| Span {
            at: softening.at,
            duration: 0.0,
        });
        let vanishes = self.vanishing.map(|vanishing| vanishing.span);
        let mut spans = self.stalls.iter().copied().chain(softens).chain(vanishes);
        spans.any(|span| lasting(&span).holds(time))
    }
}

/// `span` with what it leaves behind: the force comes back in a fifth of a second, and the hand has gone elsewhere
/// meanwhile.
fn lasting(span: &Span) -> Span {
    Span {
        at: span.at,
        duration: span.duration + 0.5,
    }
}

/// A span from `low` to `high` long, on a logarithmic scale, that is over in time.
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

/// From relaxed to rigid: 0.1 to 2 kg, 2 to 60 N s/m, 30 to 2,000 N/m, all on logarithmic scales. Firm hands are
/// heavy as a rule: each number strays from a common firmness.
fn grip(chance: Chance, device: u64) -> Grip {
    let firmness = chance.unit(4 * device);
    let stray = |n| (firmness + chance.between(4 * device + n, -0.25, 0.25)).clamp(0.0, 1.0);
    let scale = |low: f64, high: f64, n| low * libm::pow(high / low, stray(n));
    Grip {
        mass: scale(0.1, 2.0, 1),
        damping: scale(2.0, 60.0, 2),
        stiffness: scale(30.0, 2000.0, 3),
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
            for share in [draw.jitter, draw.models_lost, draw.records_lost] {
                assert!((0.0..=0.5).contains(&share));
            }
            for stall in &draw.stalls {
                assert!((0.05..=2.0).contains(&stall.duration));
                assert!(stall.at >= BEGIN && stall.at + stall.duration <= OVER + 1e-12);
            }
            for grip in &draw.grips {
                // What lies between two grips is a power of their ratio, which rounds.
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
