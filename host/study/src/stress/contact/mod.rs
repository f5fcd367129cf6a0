//! Random worlds in contact: sheets, solids and threads that touch each other, themselves and obstacles, in two hands, while
//! devices are lost, the host is late and messages are dropped.
//!
//! The world of a cell is drawn from the cell's number (`draw`, `shapes`). It runs in virtual time with simulated devices, twice.
//! [`CellResult::failures`] names what a run must not do (`judge`):
//!
//! - The states of bodies and devices are finite, and the host has no fault.
//! - Nothing crosses: an exact test of all edges and triangles after each step, and of vertices in shapes. What had
//!   no room between hands and obstacles ("squeezed") may cross, until nothing crosses any more; such runs are counted. The two
//!   faces of a tear may cross each other while it is closed.
//! - The hands get no more net energy than [`NET_ENERGY`] beyond what weight and obstacles put in.
//! - Contacts give no more energy to what they touch than rounding does, as a fraction of the energy that moves.
//! - Bodies gain no more energy than hands and obstacles put in, beside the same fraction. The work of a hand is seen in steps
//!   that a tick sees: what a late host makes up for in one tick is left out.
//! - Both runs are equal to the byte.
//!
//! In worlds of tools (`tools`) hands press, tap, rub and shake tools, or run round loops in phase with the host (`strokes`). Beside
//! the rules above, which hold for them, the study measures what the hands felt (`felt`), and fails if a tool passed through a surface,
//! if its law gave a force that no spring of its device could give, or if the tick refused a patch. A share of these worlds runs twice.
//!
//! Instead of random worlds, the study may run two worlds for 100,000 steps (`long`).

mod draw;
mod felt;
mod judge;
mod long;
mod shapes;
mod strokes;
mod tools;
mod trouble;

pub use judge::NET_ENERGY;

use super::scene::draw::Draw as Host;
use super::scene::troubled::{Lossy, stalls};
use super::{Done, Verdict};
use crate::StudyError;
use crate::chance::Chance;
use draw::{DURATIONS, Draw, Form};
use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::scene::Scene;
use host::world::World;
use judge::Judge;
use runner::AnyDevice;
use serde::{Deserialize, Serialize};
use sim::Faulty;
use std::collections::BTreeMap;
use trouble::Troubles;

/// The result of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellResult {
    /// The kinds of the bodies.
    pub bodies: Vec<String>,
    /// The kinds and motions of the obstacles.
    pub obstacles: Vec<String>,
    /// The tools, their devices and motions.
    pub tools: Vec<String>,
    /// The trouble of host and devices.
    pub trouble: String,
    /// Number of host steps.
    pub steps: u64,
    /// Number of steps in which something touched.
    pub touched: u64,
    /// Number of steps in which displacements were shortened so that nothing crosses.
    pub truncated: u64,
    /// Number of steps after which an exact test found no crossing.
    pub judged: u64,
    /// Number of pairs of elements to which a hand or an obstacle left no room.
    pub squeezed: u64,
    /// Number of contacts without a row.
    pub dropped: u64,
    /// Most rows of a step.
    pub most_rows: usize,
    /// Number of steps that stopped at the iteration limit.
    pub unconverged: u64,
    /// Number of edges that tore.
    pub opened: u64,
    /// The largest force that a device held (N).
    pub peak: f64,
    /// The largest depth of a contact (m).
    pub depth: f64,
    /// Net energy that the hands got at most, beyond what weight and obstacles put in (J).
    pub net_energy: f64,
    /// The fraction of the force of tools that the cap withheld, over the whole run.
    pub withheld: f64,
    /// The largest changes of the force of a tool in a tick, beyond the way of the hand times the stiffest spring of its device (N): in
    /// the tick of a patch or the next one, and between patches.
    pub jumps: [f64; 2],
    /// How far tools were inside bodies and obstacles at most, as a fraction of their radius (1).
    pub sunk: f64,
    /// Number of patches that the tick refused because of their contents.
    pub refused: u64,
    /// Energy that contacts gave at most (J).
    pub given: f64,
    /// The energy that moved (J).
    pub moved: f64,
    /// The rules that the runs broke.
    pub failures: Vec<String>,
}

/// Number of cells of a study of such worlds.
pub fn cells(worlds: Worlds, length: Length) -> u64 {
    match (worlds, length) {
        (_, Length::Long) => 2,
        (Worlds::Bodies, Length::Quick) => 6,
        (Worlds::Bodies, Length::Whole) => 300,
        (Worlds::Tools, Length::Quick) => 12,
        (Worlds::Tools, Length::Whole) => 1000,
    }
}

/// The study.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    /// The seed of every random choice.
    pub seed: u64,
    /// Number of cells.
    pub cells: u64,
    /// Which worlds the runs have.
    pub worlds: Worlds,
    /// How long the runs are.
    pub length: Length,
}

/// Which worlds the runs of the study have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Worlds {
    /// Bodies that touch each other and obstacles, in two hands.
    Bodies,
    /// Tools that touch bodies and obstacles.
    Tools,
}

/// How long the runs of the study are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Length {
    /// Random worlds for half a second.
    Quick,
    /// Random worlds for a second.
    Whole,
    /// Two worlds of their own for 100,000 steps.
    Long,
}

/// A world with its trouble.
struct Case {
    bodies: Vec<String>,
    obstacles: Vec<String>,
    tools: Vec<String>,
    /// The scene, and the files that it names.
    text: String,
    files: BTreeMap<String, Vec<u8>>,
    host: Host,
    troubles: Troubles,
    /// Steps between two tests of all edges and triangles.
    every: u64,
    /// Number of runs, which must be equal.
    runs: u64,
}

impl Case {
    /// A world without trouble.
    fn new(text: String, files: BTreeMap<String, Vec<u8>>) -> Self {
        Self {
            bodies: Vec::new(),
            obstacles: Vec::new(),
            tools: Vec::new(),
            text,
            files,
            host: Host::untroubled(1e3, 0.0),
            troubles: Troubles::NONE,
            every: 1,
            runs: 2,
        }
    }

    /// The world of a cell.
    fn of(study: &Study, cell: u64) -> Self {
        let seed = study.seed;
        let duration = match study.length {
            Length::Quick => DURATIONS[1],
            Length::Whole => DURATIONS[0],
            Length::Long => {
                let [first, second] = long::cases();
                return if cell == 0 { first } else { second };
            }
        };
        if study.worlds == Worlds::Tools {
            return tools::case(seed, cell, tools::PART * duration);
        }
        let draw = Draw::new(seed, cell, duration);
        let bodies = draw.bodies.iter();
        Self {
            bodies: bodies
                .map(|body| words(body.form, body.tear.is_some()))
                .collect(),
            obstacles: draw.obstacles.iter().map(shapes::Obstacle::words).collect(),
            host: draw.host(),
            troubles: draw.troubles.clone(),
            ..Self::new(draw.scene(), draw.files())
        }
    }
}

impl super::Study for Study {
    type Outcome = CellResult;
    const NAME: &'static str = "contact";
    const SCHEMA: u32 = 2;

    fn seed(&self) -> u64 {
        self.seed
    }

    fn cells(&self) -> u64 {
        self.cells
    }

    fn settings(&self) -> serde_json::Value {
        serde_json::json!({ "worlds": self.worlds, "length": self.length })
    }

    fn cell(&self, cell: u64, _: &Done<'_>) -> CellResult {
        self::cell(self, cell)
    }

    fn summary(&self, cells: &BTreeMap<u64, CellResult>) -> String {
        let mut text = String::new();
        let count = |is: &dyn Fn(&CellResult) -> bool| cells.values().filter(|c| is(c)).count();
        let sum = |of: fn(&CellResult) -> u64| cells.values().map(of).sum::<u64>();
        let most = |of: fn(&CellResult) -> f64| cells.values().map(of).fold(0.0, f64::max);
        put!(text, "{} worlds, seed {}", cells.len(), self.seed);
        put!(
            text,
            "{} had contacts, {} a truncated step, {} a tear, {} squeezed a thing without room",
            count(&|cell| cell.touched > 0),
            count(&|cell| cell.truncated > 0),
            count(&|cell| cell.opened > 0),
            count(&|cell| cell.squeezed > 0)
        );
        put!(
            text,
            "steps: {}, without a crossing {}, with contacts {}, truncated {}, at the iteration limit {}; contacts without a row: {}; most rows: {}",
            sum(|cell| cell.steps),
            sum(|cell| cell.judged),
            sum(|cell| cell.touched),
            sum(|cell| cell.truncated),
            sum(|cell| cell.unconverged),
            sum(|cell| cell.dropped),
            cells.values().map(|cell| cell.most_rows).max().unwrap_or(0)
        );
        put!(
            text,
            "net energy of the hands at most {:.3} mJ; given by contacts at most {:.3} mJ, {:.4} % of what moved\n",
            1e3 * most(|cell| cell.net_energy),
            1e3 * most(|cell| cell.given),
            100.0 * most(|cell| cell.given / cell.moved.max(1e-3))
        );
        if self.worlds == Worlds::Tools {
            put_felt(&mut text, cells);
        }
        text
    }

    fn verdict(&self, cells: &BTreeMap<u64, CellResult>) -> Verdict {
        Verdict::of_failures(
            cells,
            |cell| &cell.failures,
            |number, cell, failure| {
                format!(
                    "seed {}, cell {number} ({}; {}; {}): {failure}",
                    self.seed,
                    [&cell.bodies[..], &cell.tools].concat().join(", "),
                    cell.obstacles.join(", "),
                    cell.trouble
                )
            },
        )
    }
}

/// The scene of a cell as `palpate run` reads it, and the files that it names.
pub fn texts(study: &Study, cell: u64) -> (String, BTreeMap<String, Vec<u8>>) {
    let case = Case::of(study, cell);
    (case.text, case.files)
}

/// Runs a cell.
pub fn cell(study: &Study, cell: u64) -> CellResult {
    let case = Case::of(study, cell);
    let mut result = CellResult {
        bodies: case.bodies.clone(),
        obstacles: case.obstacles.clone(),
        tools: case.tools.clone(),
        trouble: case.troubles.kind.name().to_owned(),
        steps: 0,
        touched: 0,
        truncated: 0,
        judged: 0,
        squeezed: 0,
        dropped: 0,
        most_rows: 0,
        unconverged: 0,
        opened: 0,
        peak: 0.0,
        depth: 0.0,
        net_energy: 0.0,
        withheld: 0.0,
        jumps: [0.0; 2],
        sunk: 0.0,
        refused: 0,
        given: 0.0,
        moved: 0.0,
        failures: Vec::new(),
    };
    let chance = Chance::new(study.seed, cell);
    let mut first = None;
    for _ in 0..case.runs {
        let ran = run(&case, chance, |judge| {
            let counts = judge.counts;
            let [given, moved] = judge.given();
            let found = CellResult {
                steps: counts.steps,
                touched: counts.touched,
                truncated: counts.truncated,
                judged: counts.judged,
                squeezed: counts.squeezed,
                dropped: counts.dropped,
                most_rows: counts.most_rows,
                unconverged: counts.unconverged,
                opened: counts.opened,
                peak: finite(judge.peak),
                depth: finite(judge.depth),
                net_energy: finite(judge.net_energy()),
                withheld: finite(judge.felt.withheld()),
                jumps: judge.felt.jumps.map(finite),
                sunk: finite(judge.felt.sunk.0),
                refused: judge.refused,
                given: finite(given),
                moved: finite(moved),
                failures: judge.failures(),
                ..result.clone()
            };
            (found, judge.checksum)
        });
        match (ran, first.take()) {
            (Err(error), _) => {
                result.failures.push(error.to_string());
                return result;
            }
            (Ok(found), None) => first = Some(found),
            (Ok((_, again)), Some((found, checksum))) => {
                result = found;
                if again != checksum {
                    result.failures.push("two runs differ".to_owned());
                }
            }
        }
    }
    if let Some((only, _)) = first {
        result = only;
    }
    result
}

/// Writes the table of what hands felt with tools. `--cell` runs the worst world of a row again.
fn put_felt(text: &mut String, cells: &BTreeMap<u64, CellResult>) {
    type Row = (&'static str, fn(&CellResult) -> f64);
    let rows: [Row; 6] = [
        ("net energy (mJ)", |cell| 1e3 * cell.net_energy),
        ("largest force (N)", |cell| cell.peak),
        ("force withheld by the cap (%)", |cell| {
            100.0 * cell.withheld
        }),
        ("jump at a patch (N)", |cell| cell.jumps[0]),
        ("jump between patches (N)", |cell| cell.jumps[1]),
        ("depth inside a surface (% of the radius)", |cell| {
            100.0 * cell.sunk
        }),
    ];
    put!(text, "| of a world | median | 95 % | worst | its cell |");
    put!(text, "|---|---|---|---|---|");
    for (name, of) in rows {
        let mut values: Vec<(f64, u64)> = cells
            .iter()
            .map(|(number, cell)| (of(cell), *number))
            .collect();
        values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let at = |part: f64| values.get((part * values.len() as f64) as usize);
        if let (Some(median), Some(many), Some(worst)) = (at(0.5), at(0.95), values.last()) {
            put!(
                text,
                "| {name} | {:.3} | {:.3} | {:.3} | {} |",
                median.0,
                many.0,
                worst.0,
                worst.1
            );
        }
    }
    put!(text);
}

fn words(form: Form, tears: bool) -> String {
    let tears = if tears { " that tears" } else { "" };
    format!("{}{tears}", form.name())
}

/// JSON has no number for what is not finite.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { f64::MAX }
}

/// Runs a world, and gives its judge to `read`.
fn run<R>(
    case: &Case,
    chance: Chance,
    read: impl FnOnce(&Judge<'_>) -> R,
) -> Result<R, StudyError> {
    let loaded = Scene::load_texts("scene.toml", &case.text, &case.files)?;
    let world = World::new(&loaded)?;
    let options = Options {
        faults: stalls(&case.troubles.stalls),
        ..Options::of(&world)
    };
    let mut prepared = Prepared::new(&world, &options)?;
    let devices = prepared.tick.devices.into_iter().enumerate();
    prepared.tick.devices = devices
        .map(|(index, device)| {
            let lost = case.troubles.loss.filter(|(lost, ..)| *lost == index);
            let faults = lost.map(|(_, how, span)| {
                let ns = |time: f64| (time * 1e9).ceil() as u64;
                (ns(span.at)..ns(span.at + span.duration), how)
            });
            Box::new(Faulty::new(device, faults.into_iter().collect())) as AnyDevice
        })
        .collect();
    let mut judge = Judge::new(&world, &prepared.engine, case.every);
    let lossy = |link| Lossy::new(link, &case.host, chance, loaded.scene.bodies.len());
    let mut session = Session::with(prepared, lossy, |host| host);
    loop {
        let ticked = session.try_tick();
        let Ok(ticked) = ticked;
        let Some(telemetry) = ticked else { break };
        let engine = session
            .panicked()
            .is_none()
            .then(|| session.host().engine());
        judge.see(session.tick_loop(), &telemetry, engine);
    }
    let panicked = session.panicked().map(str::to_owned);
    let engine = session.host().engine();
    judge.end(session.tick_loop(), engine, panicked);
    Ok(read(&judge))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_draw_is_a_world() {
        for (worlds, cell) in [Worlds::Bodies, Worlds::Tools]
            .into_iter()
            .flat_map(|worlds| (0..200).map(move |cell| (worlds, cell)))
        {
            let study = Study {
                seed: 1,
                cells: 200,
                worlds,
                length: Length::Whole,
            };
            let case = Case::of(&study, cell);
            let loaded = Scene::load_texts("x.toml", &case.text, &case.files);
            let loaded = loaded.unwrap_or_else(|error| panic!("{cell}: {error}"));
            let world = World::new(&loaded);
            assert!(
                world.is_ok(),
                "{cell}: {}",
                world.err().map_or_else(String::new, |e| e.to_string())
            );
        }
    }
}
