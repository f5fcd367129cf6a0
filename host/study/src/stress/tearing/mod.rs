//! Random tears: small sheets of many materials in many hands, at many rates, under a host that stalls.
//!
//! The scene of a cell is drawn from the cell's number (`draw`). It runs under virtual time with simulated devices,
//! twice. [`CellResult::failures`] names what a run must not do:
//!
//! - The states of bodies and devices are finite, and the host has no fault.
//! - The hands get no more net energy than [`NET_ENERGY`]. There is no gravity and the body starts at rest, so all energy
//!   comes from the hands. From the tick in which the sheet parts for the hands, the hands of each piece may get the energy
//!   that the rendered piece stores at this time and the energy of the moving masses of their devices, and no more. The energy of
//!   the rendered sheet counts up to the energy that the hands have supplied.
//! - Both runs are equal to the byte, and make the same edits.
//! - A stress test that was skipped would have found nothing: wherever the largest energy density rules out a start, no
//!   free vertex reaches the strength. So a run without skipping makes the same edits in the same order.

mod draw;
mod judge;

pub use draw::{Draw, Hold};
pub use judge::NET_ENERGY;

use crate::StudyError;
use crate::stress::{self, Done, Verdict};
use host::engine::faults::{FaultKind, HostFault};
use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use judge::Judge;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The result of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellResult {
    /// The draw.
    pub draw: Draw,
    /// Edges that opened.
    pub opened: u64,
    /// Tears that started at the strength.
    pub started: u64,
    /// Number of pieces of the sheet at the end.
    pub pieces: usize,
    /// Whether the room for new vertices was used up.
    pub full: bool,
    /// The largest force that a device held (N).
    pub peak: f64,
    /// Net energy that the hands of the whole sheet, or of one of its pieces, got at most (J).
    pub net_energy: f64,
    /// The rules that the runs broke.
    pub failures: Vec<String>,
}

/// Cells of a whole study, and of a quick one.
pub const CELLS: [u64; 2] = [1000, 20];

/// The study.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    /// The seed of every random choice.
    pub seed: u64,
    /// Number of cells.
    pub cells: u64,
}

impl stress::Study for Study {
    type Outcome = CellResult;
    const NAME: &'static str = "tearing";
    const SCHEMA: u32 = 1;

    fn seed(&self) -> u64 {
        self.seed
    }

    fn cells(&self) -> u64 {
        self.cells
    }

    fn cell(&self, cell: u64, _: &Done<'_>) -> CellResult {
        self::cell(self.seed, cell)
    }

    fn summary(&self, cells: &BTreeMap<u64, CellResult>) -> String {
        let mut text = String::new();
        let count = |is: fn(&CellResult) -> bool| cells.values().filter(|c| is(c)).count();
        put!(text, "{} runs, seed {}", cells.len(), self.seed);
        put!(
            text,
            "{} tore, {} started a tear at the strength, {} parted, {} used up the room for vertices",
            count(|cell| cell.opened > 0),
            count(|cell| cell.started > 0),
            count(|cell| cell.pieces > 1),
            count(|cell| cell.full)
        );
        let opened: u64 = cells.values().map(|cell| cell.opened).sum();
        let energies = cells.values().map(|cell| cell.net_energy);
        let most = energies.fold(0.0, f64::max);
        put!(
            text,
            "{opened} edges opened; net energy of the hands at most {:.3} mJ\n",
            1e3 * most
        );
        text
    }

    fn verdict(&self, cells: &BTreeMap<u64, CellResult>) -> Verdict {
        Verdict::of_failures(
            cells,
            |cell| &cell.failures,
            |number, _, failure| format!("seed {}, cell {number}: {failure}", self.seed),
        )
    }
}

/// The scene of a cell of the study of `seed`.
///
/// # Errors
/// [`StudyError`] if the scene cannot be built.
pub fn scene(seed: u64, cell: u64) -> Result<LoadedScene, StudyError> {
    let text = Draw::new(seed, cell).scene();
    Ok(Scene::load_texts("cell.toml", &text, &BTreeMap::new())?)
}

/// Runs a cell of the study of `seed`.
pub fn cell(seed: u64, cell: u64) -> CellResult {
    let draw = Draw::new(seed, cell);
    let [first, second] = [(); 2].map(|()| run(seed, cell, &draw));
    let mut result = CellResult {
        draw,
        opened: 0,
        started: 0,
        pieces: 0,
        full: false,
        peak: 0.0,
        net_energy: 0.0,
        failures: Vec::new(),
    };
    match first.and_then(|first| Ok((first, second?))) {
        Err(error) => result.failures.push(error.to_string()),
        Ok((first, second)) => {
            if first.bytes() != second.bytes() {
                result.failures.push("two runs differ".to_owned());
            }
            if first.journal != second.journal {
                result
                    .failures
                    .push("two runs make different edits".to_owned());
            }
            (result.opened, result.started) = (first.report.opened, first.report.started);
            (result.pieces, result.full) = (first.pieces, first.report.full);
            result.peak = finite(first.peak);
            result.net_energy = finite(first.net_energy());
            result.failures.extend(first.failures());
        }
    }
    result
}

/// JSON has no number for what is not finite.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::MAX }
}

fn run(seed: u64, cell: u64, draw: &Draw) -> Result<Judge, StudyError> {
    let loaded = scene(seed, cell)?;
    let world = World::new(&loaded)?;
    let stalls = draw.stall.iter().map(|[at, duration]| HostFault {
        kind: FaultKind::Stall,
        at: *at,
        duration: *duration,
    });
    let options = Options {
        faults: stalls.collect(),
        ..Options::of(&world)
    };
    let prepared = Prepared::new(&world, &options)?;
    let masses = loaded.models.iter().map(|model| model.mass).collect();
    let mut judge = Judge::new(&prepared.engine, masses);
    let mut session = Session::of(prepared);
    while let Some(telemetry) = session.tick() {
        judge.see(session.tick_loop(), &telemetry, session.engine());
        session.records(|record| judge.log(record));
    }
    let running = session.end();
    judge.end(&running);
    Ok(judge)
}
