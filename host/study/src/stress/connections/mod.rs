//! Faults of the connection between the program and a device, at random times. [`run`] makes one run, and [`expected`]
//! says what the run must show.
//!
//! A cell is one protocol with one kind of fault. An emulated hand pushes the device into a wall. The driver and
//! the controller are those of a run. The cells go through all protocols and kinds in turn, each with another random time.

pub mod expected;
mod host;
pub mod run;

use crate::stress::{self, Done, Verdict};
use expected::Case;
use serde::{Deserialize, Serialize};
use sim::emulated::fault::Kind;
use sim::protocol::Protocol;
use std::collections::BTreeMap;

/// Cells of a study with one run of each fault on each protocol.
pub const ROUND: u64 = (Protocol::ALL.len() * Kind::ALL.len()) as u64;

/// Runs of each fault on each protocol, in a whole study and in a quick one.
pub const RUNS: [u64; 2] = [100, 1];

/// The study.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    /// The seed of every random choice.
    pub seed: u64,
    /// Number of runs of each fault on each protocol.
    pub runs: u64,
}

impl stress::Study for Study {
    type Outcome = Outcome;
    const NAME: &'static str = "connections";
    const SCHEMA: u32 = 1;

    fn seed(&self) -> u64 {
        self.seed
    }

    fn cells(&self) -> u64 {
        self.runs.saturating_mul(ROUND)
    }

    fn cell(&self, cell: u64, _: &Done<'_>) -> Outcome {
        self::cell(self.seed, cell)
    }

    fn summary(&self, cells: &BTreeMap<u64, Outcome>) -> String {
        summary(cells)
    }

    fn verdict(&self, cells: &BTreeMap<u64, Outcome>) -> Verdict {
        Verdict::of_failures(
            cells,
            |cell| &cell.failures,
            |number, cell, failure| {
                let Outcome {
                    protocol, fault, ..
                } = cell;
                format!("cell {number}: {protocol}, {fault}: {failure}")
            },
        )
    }
}

/// The result of a cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The device and its protocol.
    pub protocol: String,
    /// The fault.
    pub fault: String,
    /// Whether a receiver can tell the packets of the fault from sound ones. Nothing is demanded of a fault that no
    /// receiver can detect.
    pub detectable: bool,
    /// Time from the fault until the device made no force (s). None if commands still reached it, or the fault ended
    /// first.
    pub device_force: Option<f64>,
    /// Time from the fault until the program commanded no force (s). None if states still reached it.
    pub commanded_force: Option<f64>,
    /// Largest growth of the commanded force from one tick to the next, after the fault began, beyond the growth that the
    /// hand's motion explains (N).
    pub commanded_jump: f64,
    /// Largest growth of the force at the device from one millisecond to the next, after the fault began, beyond the growth
    /// that the hand's motion explains (N).
    pub device_jump: f64,
    /// Net energy at the hand (J).
    pub energy: f64,
    /// Ticks without a state of the device, after the first state.
    pub missed: u64,
    /// The demands that the run did not meet.
    pub failures: Vec<String>,
}

/// Runs a cell of the study with `seed`.
pub fn cell(seed: u64, cell: u64) -> Outcome {
    let kinds = Kind::ALL.len() as u64;
    let kind = Kind::ALL[(cell % kinds) as usize];
    let protocol = Protocol::ALL[(cell / kinds) as usize % Protocol::ALL.len()];
    let number = cell / ROUND;
    // A study of more runs contains those of fewer, and two studies share no run until seeds differ by more than their
    // runs.
    let found = run::run(protocol, kind, seed.wrapping_add(number));
    Outcome {
        protocol: protocol.to_string(),
        fault: kind.to_string(),
        detectable: Case { protocol, kind }.is_detectable(),
        device_force: found.device,
        commanded_force: found.host,
        commanded_jump: found.host_jump,
        device_jump: found.device_jump,
        energy: found.energy,
        missed: found.missed,
        failures: found.failures,
    }
}

/// The worst of some cells of one protocol and fault.
#[derive(Clone, Debug, PartialEq)]
pub struct Worst {
    /// Each number is the largest of the cells.
    pub most: Outcome,
    /// Number of cells.
    pub runs: usize,
    /// Number of cells with a failure.
    pub failed: usize,
}

/// The worst of the cells of each protocol and fault, in the order of their first cells.
pub fn worst<'a>(cells: impl Iterator<Item = &'a Outcome>) -> Vec<Worst> {
    let mut all: Vec<Worst> = Vec::new();
    for cell in cells {
        let of = all.iter().position(|worst| {
            (&worst.most.protocol, &worst.most.fault) == (&cell.protocol, &cell.fault)
        });
        match of {
            None => all.push(Worst {
                most: cell.clone(),
                runs: 1,
                failed: usize::from(!cell.failures.is_empty()),
            }),
            Some(of) => {
                let worst = &mut all[of];
                let most = &mut worst.most;
                let later =
                    |a: Option<f64>, b: Option<f64>| a.into_iter().chain(b).reduce(f64::max);
                most.device_force = later(most.device_force, cell.device_force);
                most.commanded_force = later(most.commanded_force, cell.commanded_force);
                most.commanded_jump = most.commanded_jump.max(cell.commanded_jump);
                most.device_jump = most.device_jump.max(cell.device_jump);
                most.energy = most.energy.max(cell.energy);
                most.missed = most.missed.max(cell.missed);
                worst.runs += 1;
                worst.failed += usize::from(!cell.failures.is_empty());
            }
        }
    }
    all
}

/// The largest number of each fault on each protocol.
fn summary(cells: &BTreeMap<u64, Outcome>) -> String {
    let mut text = String::new();
    put!(
        text,
        "| device | fault | runs | force at the device (ms) | force commanded (ms) | jump commanded (N) | \
         jump at the device (N) | net energy (mJ) | ticks without a state | failed |"
    );
    put!(text, "|---|---|---|---|---|---|---|---|---|---|");
    for worst in worst(cells.values()) {
        let most = &worst.most;
        let [device, commanded] =
            [most.device_force, most.commanded_force].map(|time| match time {
                Some(time) => format!("{:.2}", 1e3 * time),
                None => "-".to_owned(),
            });
        let failed = if most.detectable {
            worst.failed.to_string()
        } else {
            "not detectable".to_owned()
        };
        put!(
            text,
            "| {} | {} | {} | {device} | {commanded} | {:.3} | {:.3} | {:.3} | {} | {failed} |",
            most.protocol,
            most.fault,
            worst.runs,
            most.commanded_jump,
            most.device_jump,
            // Without the sign of a zero.
            1e3 * most.energy + 0.0,
            most.missed,
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn a_round_has_each_fault_on_each_protocol_once() {
        let kinds = Kind::ALL.len() as u64;
        // Without the runs themselves, which take a minute.
        let names: BTreeSet<_> = (0..ROUND)
            .map(|cell| (cell % kinds, cell / kinds))
            .collect();
        assert_eq!(names.len() as u64, ROUND);
        let study = Study { seed: 1, runs: 100 };
        assert_eq!(stress::Study::cells(&study), 100 * ROUND);
    }

    #[test]
    fn the_worst_is_the_largest_of_each_number() {
        let outcome = |energy: f64, force: Option<f64>, failures: &[&str]| Outcome {
            fault: "silent".to_owned(),
            energy,
            device_force: force,
            failures: failures.iter().map(|text| (*text).to_owned()).collect(),
            ..Outcome::default()
        };
        let cells = [
            outcome(-1.0, None, &[]),
            outcome(-2.0, Some(0.01), &["late"]),
            outcome(-3.0, None, &[]),
        ];
        let [worst] = &worst(cells.iter())[..] else {
            panic!("one protocol, one fault");
        };
        assert_eq!((worst.runs, worst.failed), (3, 1));
        assert_eq!(
            (worst.most.energy, worst.most.device_force),
            (-1.0, Some(0.01))
        );
    }

    #[test]
    fn a_cell_is_the_same_again() {
        let silent = 6;
        let first = cell(5, silent);
        assert_eq!(
            (first.protocol.as_str(), first.fault.as_str()),
            ("firmware, HID", "silent")
        );
        assert_eq!(first, cell(5, silent));
        assert_ne!(first, cell(5, silent + ROUND));
        assert_eq!(cell(5, silent + ROUND), cell(6, silent));
    }
}
