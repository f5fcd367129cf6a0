//! Presses, holds, slow rubs and tremors on bodies of every kind. The study checks that the rendered force is the force of
//! the body.
//!
//! The first cells are the scenes of files ([`CASES`]). The other cells are drawn from their numbers and written as scene
//! files ([`super::specimen`]). Each cell runs under `capped`, under `linear`, and as the reference of
//! `palpate stress scene`, with the physics inside the tick. Along each run, the body is moved once more by the same
//! hands, with one step a tick. The force that the body then exerts is the force that the scheme should have rendered:
//! see [`super::scene::force_errors`]. If a body is stiffer than its devices along some directions, the reference and the
//! moved body have springs in series with these directions, as the host has: see the module `scene::rendered`. In most cells
//! no scheme has a reason to withhold force. In the others, a stall, a limit on the slew of the force or a fast press takes
//! a part of it away for a while, and the hold that begins a second later is judged alone. [`verdict`] states the limits.

pub mod holds;
pub mod summary;
mod table;
pub mod verdict;

use super::scene::again::{self, Again};
use super::scene::draw::{Draw as HostDraw, Span};
use super::scene::measure::{HOLD, Outcome, Stillness, Trace};
use super::scene::trial::Trial;
use super::scene::written::Written;
use super::scene::{reference, run};
use super::specimen::{Cause, Draw};
use crate::StudyError;
use crate::chance::Chance;
use host::run::simulated_hand;
use host::scene::spec::SchemeName;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::velocity::{VelocityEstimator, most_damping};
use serde::{Deserialize, Serialize};
use sim::Hand;
use std::collections::BTreeMap;

pub use holds::Holds;

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

/// The result of one cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CellResult {
    /// The name of the case, for a scene of a file.
    pub case: Option<String>,
    /// The draw, for a drawn cell.
    pub draw: Option<Draw>,
    /// Local models a second (Hz).
    pub rate: f64,
    /// Change of the force by one count of the encoder (N), at rest or at the end of the runs: by the stiffness that the
    /// device renders, and by the damping, at the velocity of that count divided by the time over which drivers
    /// estimate a velocity.
    pub count: f64,
    /// Stillness of the reference's hold.
    pub reference: Stillness,
    /// Net energy of the reference (J).
    pub reference_net_energy: f64,
    /// Whether a hand moves in the last second. The hold is then not judged.
    #[serde(default)]
    pub moves: bool,
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
    /// Whether a hand moves in the last second, as in [`CellResult::moves`].
    pub moves: bool,
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
        draw.scene(&format!("hold {cell} of seed {}", self.seed))
    }

    /// The scene of a cell under `scheme` as a scene file, and what the file cannot say.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn written(&self, cell: u64, scheme: SchemeName) -> Result<Written, StudyError> {
        Written::of(&self.trial(cell)?, scheme)
    }

    fn trial(self, cell: u64) -> Result<Trial, StudyError> {
        let draw = self.draw(cell);
        let stalls = draw.map_or_else(Vec::new, |draw| draw.stalls());
        Ok(trial(self.scene(cell)?, stalls))
    }

    /// The reference of a cell, and its run under each of `schemes`.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn traces(&self, cell: u64, schemes: &[SchemeName]) -> Result<Traces, StudyError> {
        traces(self.trial(cell)?, schemes, Chance::new(self.seed, cell))
    }

    /// Runs a cell under each of `schemes`.
    pub fn cell(&self, cell: u64, schemes: &[(SchemeName, &str)]) -> CellResult {
        let names: Vec<_> = schemes.iter().map(|(scheme, _)| *scheme).collect();
        match self.traces(cell, &names) {
            Ok(traces) => self.result(cell, &traces, schemes),
            Err(error) => CellResult {
                failed: Some(error.to_string()),
                ..self.empty(cell)
            },
        }
    }

    /// Runs a cell again under `scheme`, for a person.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn again(&self, cell: u64, scheme: SchemeName) -> Result<Again, StudyError> {
        // The verdict compares with `linear`.
        let mut schemes: Vec<_> = SCHEMES.into_iter().collect();
        schemes.retain(|(name, _)| *name == scheme || *name == SchemeName::Linear);
        schemes.sort_by_key(|(name, _)| *name != scheme);
        let names: Vec<_> = schemes.iter().map(|(name, _)| *name).collect();
        let mut traces = self.traces(cell, &names)?;
        let result = self.result(cell, &traces, &schemes);
        let (title, mut text) = if let Some(draw) = &result.draw {
            let (kind, device) = (draw.kind.name(), &draw.hands[0].device);
            let drawn = again::drawn_specimen(cell, self.seed, draw);
            (format!("Cell {cell}: {kind}, {device}"), drawn)
        } else {
            let case = result.case.as_deref().unwrap_or_default();
            let title = format!("Cell {cell}: {case}");
            let text = format!("{title}\n");
            (title, text)
        };
        let (_, scheme) = schemes[0];
        let outcome = &result.schemes[scheme];
        let failed = verdict::failures(&result, scheme).into_iter();
        let failed: Vec<_> = failed.map(verdict::Failure::name).collect();
        let verdict = if failed.is_empty() {
            "within all limits".to_owned()
        } else {
            format!("beyond the limits of {}", failed.join(", "))
        };
        let head = format!("{scheme}: {verdict}");
        text += &again::measured(&head, outcome, &traces.reference);
        put!(
            text,
            "  one count  changes the force by {:.3} N",
            traces.count
        );
        let errors = &outcome.force_errors;
        let subtitle = format!(
            "\"{scheme}\": hold error {:.1} %, run error {:.1} % of the peak, ripple {:.3} N, capped {:.1} %",
            100.0 * errors.hold_error,
            100.0 * errors.run_error,
            errors.worst_ripple,
            100.0 * outcome.capped
        );
        Ok(Again {
            text,
            title,
            subtitle,
            run: traces.runs.swap_remove(0),
            reference: traces.reference,
        })
    }

    /// The result of a cell, whose runs under `schemes` are `traces`.
    pub fn result(&self, cell: u64, traces: &Traces, schemes: &[(SchemeName, &str)]) -> CellResult {
        self.empty(cell).with(traces, schemes)
    }

    /// A cell that was not run.
    fn empty(self, cell: u64) -> CellResult {
        let draw = self.draw(cell);
        let case = CASES.get(cell as usize);
        let rate = case.map(|(_, _, rate)| *rate);
        CellResult {
            case: case.map(|(name, _, _)| (*name).to_owned()),
            rate: rate.or(draw.as_ref().map(|draw| draw.rate)).unwrap_or(0.0),
            draw,
            ..CellResult::default()
        }
    }
}

impl CellResult {
    /// Whether nothing takes a part of the force away on purpose.
    pub fn is_undisturbed(&self) -> bool {
        self.draw
            .as_ref()
            .is_none_or(|draw| draw.cause == Cause::Nothing)
    }

    /// The cell with the measurements of `traces`, whose runs are those under `schemes`.
    fn with(self, traces: &Traces, schemes: &[(SchemeName, &str)]) -> Self {
        let named = schemes.iter().map(|(_, name)| (*name).to_owned());
        Self {
            count: traces.count,
            moves: traces.moves,
            reference: traces.reference.stillness(),
            reference_net_energy: traces.reference.net_energy(),
            schemes: named.zip(traces.outcomes()).collect(),
            ..self
        }
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
        trial(loaded, Vec::new()),
        &SCHEMES.map(|(scheme, _)| scheme),
        Chance::new(0, 0),
    )?;
    let cell = CellResult {
        case,
        rate,
        ..CellResult::default()
    };
    Ok(cell.with(&found, &SCHEMES))
}

/// The trial of a scene at the rates and the latency of the scene, without faults but `stalls` of the host.
fn trial(loaded: LoadedScene, stalls: Vec<Span>) -> Trial {
    let host = &loaded.scene.host;
    let draw = HostDraw {
        stalls,
        ..HostDraw::untroubled(host.publish_rate, host.latency)
    };
    Trial {
        loaded,
        soft: None,
        draw,
    }
}

/// The reference of a trial, and its run under each of `schemes`.
fn traces(trial: Trial, schemes: &[SchemeName], chance: Chance) -> Result<Traces, StudyError> {
    let reference = reference::run(&trial)?;
    let mut rest = reference::Bodies::new(&trial.loaded)?;
    let mut count = one_count(&trial, &mut rest)?;
    let mut runs = Vec::new();
    for scheme in schemes {
        let mut run = run::run(&trial, *scheme, chance)?;
        let mut bodies = reference::follow(&trial, &mut run)?;
        count = count.max(one_count(&trial, &mut bodies)?);
        runs.push(run);
    }
    Ok(Traces {
        reference,
        runs,
        count,
        moves: moves(&trial)?,
        host: trial.draw,
    })
}

/// Whether the aim of a hand moves in the last second by more than a count of its device. A tremor is a part of a hold.
fn moves(trial: &Trial) -> Result<bool, StudyError> {
    let loaded = &trial.loaded;
    let built = World::new(loaded)?;
    let end = loaded.scene.duration;
    for (device, model) in loaded.models.iter().enumerate() {
        let (hand, _) = simulated_hand(&built, device, loaded.scene.seed)?;
        let Some(hand) = hand else { continue };
        let hand = Hand {
            tremor: None,
            ..hand
        };
        let (last, _) = hand.aim(end);
        let far = |tick: u32| {
            let time = (end - f64::from(tick) * trial.period()).max(0.0);
            (hand.aim(time).0 - last).norm() > model.position_step
        };
        if (0..(HOLD / trial.period()).round() as u32).any(far) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Change of the force by one count of an encoder (N) in the present state of `bodies`. A damper counts only as far as the
/// device can render it.
fn one_count(trial: &Trial, bodies: &mut reference::Bodies) -> Result<f64, StudyError> {
    let period = trial.period();
    let models = &trial.loaded.models;
    let most = |device: usize| {
        let count = models[device].position_step;
        let delay = VelocityEstimator::for_encoder(period, count).delay();
        most_damping(models[device].mass, period, delay)
    };
    let forces = bodies.counts(trial, 1.0 / VelocityEstimator::SPAN, most)?;
    Ok(forces.into_iter().fold(0.0, f64::max))
}
