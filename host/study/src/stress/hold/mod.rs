//! Fault-free presses, holds, slow rubs and tremors on bodies of every kind: whether what is felt is the body.
//!
//! The first cells are scenes that stand in files ([`CASES`]); the others are drawn from their numbers (`draw`) and put
//! in a scene file's words (`specimen`). Each runs under `capped`, under `linear`, and as the reference of the study of
//! scenes, with the physics inside the tick. Along each run the body is led once more, in steps of a tick, and what it
//! exerts is what should have been felt: see [`super::scene::felt`]. Nothing goes wrong here, so a scheme that takes
//! anything off has no reason to.
//!
//! **What passes** stands in [`verdict`].

pub mod draw;
mod specimen;
pub mod summary;
pub mod verdict;

use super::chance::Chance;
use super::scene::draw::Draw as HostDraw;
use super::scene::measure::{Outcome, Stillness, Trace};
use super::scene::world::World;
use super::scene::{reference, run};
use crate::StudyError;
use draw::{Draw, Kind, STIFFNESS, stiffest};
use host::bodies;
use host::scene::spec::SchemeName;
use host::scene::{LoadedScene, Scene};
use rt_core::velocity::{VelocityEstimator, most_damping};
use serde::{Deserialize, Serialize};
use sim::DeviceModel;
use specimen::Scale;
use std::collections::BTreeMap;

/// The schemes that are compared.
pub const SCHEMES: [(SchemeName, &str); 2] = [
    (SchemeName::Linear, "linear"),
    (SchemeName::Capped, "capped"),
];

/// Scenes in files, the first cells: name, text, and host's steps and models a second (Hz).
pub const CASES: [(&str, &str, f64); 6] = [
    (
        "tissue, 250 Hz",
        include_str!("../../../../scenes/stress/tissue.toml"),
        250.0,
    ),
    (
        "tissue, 125 Hz",
        include_str!("../../../../scenes/stress/tissue.toml"),
        125.0,
    ),
    (
        "stiff block, 100 Hz",
        include_str!("../../../../scenes/stress/stiff_block.toml"),
        100.0,
    ),
    (
        "stiff block, 200 Hz",
        include_str!("../../../../scenes/stress/stiff_block.toml"),
        200.0,
    ),
    (
        "St. Venant-Kirchhoff block, 100 Hz",
        include_str!("../../../../scenes/stress/stvk_block.toml"),
        100.0,
    ),
    (
        "buckling strip, 100 Hz",
        include_str!("../../../../scenes/stress/buckling.toml"),
        100.0,
    ),
];

/// The period at which it is found (s): so slow that inertia is nothing, and a membrane is held all the same.
const SLOW: f64 = 1.0;

/// What came of one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellResult {
    /// The case's name, if it is one.
    pub case: Option<String>,
    /// What was drawn, if it is none.
    pub draw: Option<Draw>,
    /// Local models a second (Hz).
    pub rate: f64,
    /// What a change by one count of the encoder makes of the force (N), at rest or where the runs end: by the body's
    /// stiffness, and by its damping where a velocity is that count over the time in which drivers estimate one.
    pub count: f64,
    /// How still the reference's hold is.
    pub reference: Stillness,
    /// Net energy of the reference (J).
    pub reference_net_energy: f64,
    /// What each scheme made of it, by its name.
    pub schemes: BTreeMap<String, Outcome>,
    /// Why it could not be run, if it could not.
    pub failed: Option<String>,
}

/// A cell's runs, whole.
pub struct Traces {
    /// The reference's.
    pub reference: Trace,
    /// Under each scheme that was asked for.
    pub runs: Vec<Trace>,
    /// What a change by one count of the encoder makes of the force (N), at rest or where the runs end: by the body's
    /// stiffness, and by its damping where a velocity is that count over the time in which drivers estimate one.
    pub count: f64,
    host: HostDraw,
}

impl Traces {
    /// What came of the runs, in their order.
    pub fn outcomes(&self) -> impl Iterator<Item = Outcome> {
        let runs = self.runs.iter();
        runs.map(|run| Outcome::of(run, &self.reference, &self.host))
    }
}

/// The study of a seed.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    seed: u64,
}

impl Study {
    /// The study of `seed`.
    pub fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// What was drawn for a cell; none for a case.
    pub fn draw(&self, cell: u64) -> Option<Draw> {
        let number = cell.checked_sub(CASES.len() as u64)?;
        Some(Draw::new(self.seed, number))
    }

    /// The scene of a cell.
    ///
    /// # Errors
    /// [`StudyError`] where it cannot be built.
    pub fn scene(&self, cell: u64) -> Result<LoadedScene, StudyError> {
        let load = |text: &str| -> Result<_, StudyError> {
            Ok(Scene::load_texts("cell.toml", text, &BTreeMap::new())?)
        };
        let Some(draw) = self.draw(cell) else {
            let (_, text, rate) = CASES[cell as usize];
            let mut loaded = load(text)?;
            loaded.scene.host.step_rate = rate;
            loaded.scene.host.publish_rate = rate;
            return Ok(loaded);
        };
        let devices: BTreeMap<_, _> = DeviceModel::all().collect();
        let model = &devices[draw.device.as_str()];
        let name = format!("hold {cell} of seed {}", self.seed);
        let scene = |scale| load(&specimen::scene(&name, &draw, scale, model));
        let [along, most] = stiffness(&scene(Scale::TRIAL)?, draw.kind)?;
        // A hand that trembles meets the specimen's other stiffnesses, too.
        let bound = STIFFNESS[1].min(stiffest(model));
        let share = (draw.stiffness / along).min(bound / most);
        scene(Scale {
            young: Scale::TRIAL.young * share,
            stiffness: along * share,
        })
    }

    /// The reference of a cell, and its run under each of `schemes`.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn traces(&self, cell: u64, schemes: &[SchemeName]) -> Result<Traces, StudyError> {
        let loaded = self.scene(cell)?;
        traces(loaded, schemes, Chance::new(self.seed, cell))
    }

    /// Runs a cell under each of `schemes`.
    pub fn cell(&self, cell: u64, schemes: &[(SchemeName, &str)]) -> CellResult {
        let names: Vec<_> = schemes.iter().map(|(scheme, _)| *scheme).collect();
        let draw = self.draw(cell);
        let case = CASES.get(cell as usize);
        let rate = case.map(|(_, _, rate)| *rate);
        CellResult {
            case: case.map(|(name, _, _)| (*name).to_owned()),
            rate: rate.or(draw.as_ref().map(|draw| draw.rate)).unwrap_or(0.0),
            draw,
            ..CellResult::of(self.traces(cell, &names), schemes)
        }
    }
}

impl CellResult {
    fn of(traces: Result<Traces, StudyError>, schemes: &[(SchemeName, &str)]) -> Self {
        let mut result = Self {
            case: None,
            rate: 0.0,
            draw: None,
            count: 0.0,
            reference: Stillness::default(),
            reference_net_energy: 0.0,
            schemes: BTreeMap::new(),
            failed: None,
        };
        match traces {
            Ok(traces) => {
                result.count = traces.count;
                result.reference = traces.reference.stillness();
                result.reference_net_energy = traces.reference.net_energy();
                let named = schemes.iter().map(|(_, name)| (*name).to_owned());
                result.schemes = named.zip(traces.outcomes()).collect();
            }
            Err(error) => result.failed = Some(error.to_string()),
        }
        result
    }
}

/// Runs a scene with its own hands under each of [`SCHEMES`].
///
/// # Errors
/// [`StudyError`].
pub fn judge(loaded: LoadedScene) -> Result<CellResult, StudyError> {
    let (case, rate) = (
        Some(loaded.scene.name.clone()),
        loaded.scene.host.publish_rate,
    );
    let found = traces(
        loaded,
        &SCHEMES.map(|(scheme, _)| scheme),
        Chance::new(0, 0),
    )?;
    Ok(CellResult {
        case,
        rate,
        ..CellResult::of(Ok(found), &SCHEMES)
    })
}

/// The reference of a scene, and its run under each of `schemes`: at the rates and the latency of the scene, nothing
/// goes wrong.
fn traces(
    loaded: LoadedScene,
    schemes: &[SchemeName],
    chance: Chance,
) -> Result<Traces, StudyError> {
    let host = &loaded.scene.host;
    let host = HostDraw::untroubled(host.publish_rate, host.latency);
    let world = World {
        loaded,
        soft: None,
        draw: host.clone(),
    };
    let reference = reference::run(&world)?;
    let horizon = 1.0 / host.rate + host.latency;
    let mut rest = reference::Bodies::new(&world.loaded)?;
    let mut count = one_count(&world, &mut rest, horizon)?;
    let mut runs = Vec::new();
    for scheme in schemes {
        let mut run = run::run(&world, *scheme, chance)?;
        let mut bodies = reference::follow(&world, &mut run)?;
        count = count.max(one_count(&world, &mut bodies, horizon)?);
        runs.push(run);
    }
    Ok(Traces {
        reference,
        runs,
        count,
        host,
    })
}

/// What a change by one count of an encoder makes of the force (N) where `bodies` are now, for models that are good for
/// `horizon` (s). A damper counts by as much of it as the device can render.
fn one_count(
    world: &World,
    bodies: &mut reference::Bodies,
    horizon: f64,
) -> Result<f64, StudyError> {
    let period = world.period();
    let each = world.loaded.models.iter();
    let each = each.zip(bodies.stiffest(world, horizon)?);
    let forces = each.map(|(model, [spring, damper])| {
        let count = model.position_step;
        let delay = VelocityEstimator::for_encoder(period, count).delay();
        let damper = damper.min(most_damping(model.mass, period, delay));
        count * (spring + damper / VelocityEstimator::SPAN)
    });
    Ok(forces.fold(0.0, f64::max))
}

/// Static stiffness of a scene's specimen at its handle (N/m): the way that the hand goes, and the most of any way.
fn stiffness(loaded: &LoadedScene, kind: Kind) -> Result<[f64; 2], StudyError> {
    let condenser = bodies::condense::<StudyError>(loaded, 0, SLOW)?;
    let stiffness = &condenser.condensed().stiffness;
    let way = specimen::way(kind);
    let each = (0..9).map(|k| (k / 3, k % 3));
    let along = each.map(|(r, c)| way[r] * stiffness[(r, c)] * way[c]);
    Ok([along.sum(), reference::largest(stiffness, 0)])
}
