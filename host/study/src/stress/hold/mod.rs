//! Presses, holds, slow rubs and tremors without faults, on bodies of every kind: whether the rendered force is the
//! force of the body.
//!
//! The first cells are the scenes of files ([`CASES`]). The other cells are drawn from their numbers (`draw`) and
//! written as scene files (`specimen`). Each cell runs under `capped`, under `linear`, and as the reference of
//! `palpate stress scene`, with the physics inside the tick. Along each run, the body is moved once more by the same
//! hand, with one step a tick. The force that the body then exerts is the force that the scheme should have rendered:
//! see [`super::scene::force_errors`]. No fault occurs, so no scheme has a reason to withhold force.
//! [`verdict`] states the limits.

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

/// The publication period at which the static stiffness is computed (s). It is so long that inertia is negligible, and
/// still holds a membrane.
const SLOW: f64 = 1.0;

/// The result of one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellResult {
    /// The name of the case, for a scene of a file.
    pub case: Option<String>,
    /// The draw, for a drawn cell.
    pub draw: Option<Draw>,
    /// Local models a second (Hz).
    pub rate: f64,
    /// Change of the force by one count of the encoder (N), at rest or at the end of the runs: by the stiffness of the
    /// body, and by its damping, where the velocity is that count divided by the time over which drivers estimate a
    /// velocity.
    pub count: f64,
    /// Stillness of the reference's hold.
    pub reference: Stillness,
    /// Net energy of the reference (J).
    pub reference_net_energy: f64,
    /// The result under each scheme, by the name of the scheme.
    pub schemes: BTreeMap<String, Outcome>,
    /// Why the cell could not be run, if it could not.
    pub failed: Option<String>,
}

/// The complete runs of a cell.
pub struct Traces {
    /// The reference's.
    pub reference: Trace,
    /// The runs under the given schemes.
    pub runs: Vec<Trace>,
    /// Change of the force by one count of the encoder (N), as in [`CellResult::count`].
    pub count: f64,
    host: HostDraw,
}

impl Traces {
    /// The results of the runs, in the order of the runs.
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

    /// The draw of a cell; none for a case.
    pub fn draw(&self, cell: u64) -> Option<Draw> {
        let number = cell.checked_sub(CASES.len() as u64)?;
        Some(Draw::new(self.seed, number))
    }

    /// The scene of a cell.
    ///
    /// # Errors
    /// [`StudyError`] if the scene cannot be built.
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
        let devices: BTreeMap<_, _> = DeviceModel::spatial().collect();
        let model = &devices[draw.device.as_str()];
        let name = format!("hold {cell} of seed {}", self.seed);
        let scene = |scale| load(&specimen::scene(&name, &draw, scale, model));
        let [along, most] = stiffness(&scene(Scale::TRIAL)?, draw.kind)?;
        // A hand that trembles meets the other stiffnesses of the specimen, too.
        let bound = STIFFNESS[1].min(stiffest(model));
        let factor = (draw.stiffness / along).min(bound / most);
        scene(Scale {
            young: Scale::TRIAL.young * factor,
            stiffness: along * factor,
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

/// The reference of a scene, and its run under each of `schemes`, at the rates and the latency of the scene, without
/// faults.
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

/// Change of the force by one count of an encoder (N) in the present state of `bodies`, for models with the horizon
/// `horizon` (s). A damper counts only as far as the device can render it.
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

/// Static stiffness of a scene's specimen at its handle (N/m): along the direction of the hand's motion, and the
/// largest over all directions.
fn stiffness(loaded: &LoadedScene, kind: Kind) -> Result<[f64; 2], StudyError> {
    let condenser = bodies::condense::<StudyError>(loaded, 0, SLOW)?;
    let stiffness = &condenser.condensed().stiffness;
    let direction = specimen::direction(kind);
    let each = (0..9).map(|k| (k / 3, k % 3));
    let along = each.map(|(r, c)| direction[r] * stiffness[(r, c)] * direction[c]);
    Ok([along.sum(), reference::largest(stiffness, 0)])
}
