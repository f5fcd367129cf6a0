//! A scene under hands, rates and faults: how each scheme performs.
//!
//! A cell is one trial, drawn from its number (`draw`): the grips and the task of the hands, the rate and the latency
//! of the host, and the trouble. The body, its devices and the directions of the hands are those of a scene file, or
//! they are drawn, too ([`super::specimen`]). Each scheme runs in that trial, beside one reference with the same physics
//! steps inside the tick (`reference`). The study measures (`measure`) whether the hands come to rest in the final hold, the
//! net energy, and the error of the forces.
//!
//! **Error.** The reference has hands of its own, with the same targets. Its force is the force that a body without
//! delays would have exerted on that person at that moment. A reference that moved along the run's own path would
//! excuse a scheme that shakes the hand, because a body that is shaken resists. Only the stiffness error is taken at
//! the same place: over the hold, against the force that the physics exerts where the hands are.
//!
//! **Energy.** Net energy is the largest work done on the hands of all devices together, over time, less the energy
//! that the bodies stored at the start: elastic, kinetic, and the potential of gravity. `sim` integrates the work
//! between ticks, where the hand holds the device. The account of the controller is not used.

pub mod again;
pub mod draw;
pub mod force_errors;
mod hands;
pub mod measure;
pub mod picture;
pub(crate) mod reference;
pub(super) mod rendered;
pub(super) mod run;
pub mod summary;
mod table;
mod touching;
pub(crate) mod trial;
pub mod trials;
pub(super) mod troubled;
pub mod verdict;
pub mod written;

use super::specimen::Draw as Specimen;
use crate::StudyError;
use crate::chance::Chance;
use again::Again;
use draw::{Choice, Draw};
use host::scene::LoadedScene;
use host::scene::spec::SchemeName;
use host::world::grasps;
use measure::{Outcome, Stillness, Trace};
use nalgebra::Matrix3;
use physics::Vec3;
use physics::linear::dense::Square;
use rendered::Rendered;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use trial::Trial;
use written::Written;

pub use trials::Trials;

/// The schemes, in the order of the tables.
pub const SCHEMES: [(SchemeName, &str); 6] = [
    (SchemeName::Hold, "hold"),
    (SchemeName::Thesis, "thesis"),
    (SchemeName::Linear, "linear"),
    (SchemeName::Classic, "classic"),
    (SchemeName::Proxy, "proxy"),
    (SchemeName::Capped, "capped"),
];

/// Physics steps a second (Hz), at every publication rate.
pub const STEP_RATE: f64 = 1000.0;
/// The publication period at which the stiffness between the devices is computed (s).
const SLOW: f64 = 1.0 / 20.0;

/// The study of a scene, or of drawn bodies.
pub struct Study {
    /// The scene; without one, every cell has a scene of its own.
    scene: Option<Prepared>,
    seed: u64,
    choice: Choice,
}

/// A scene that is prepared for its cells.
struct Prepared {
    loaded: LoadedScene,
    reaches: Vec<Vec3>,
    friction: Vec<f64>,
    stiffness: Square,
}

/// The result of one cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellResult {
    /// The draw.
    pub draw: Draw,
    /// The drawn body with its devices, of a study without a scene file.
    pub specimen: Option<Specimen>,
    /// Stillness of the reference's hold.
    pub reference: Stillness,
    /// Net energy of the reference (J).
    pub reference_net_energy: f64,
    /// The measurements under each scheme, by the name of the scheme.
    pub schemes: BTreeMap<String, Outcome>,
    /// Why the cell could not be run, if it could not.
    pub failed: Option<String>,
}

impl Study {
    /// Prepares `loaded` for the study of `seed`.
    ///
    /// # Errors
    /// [`StudyError`] if the scene cannot be built, or has no devices.
    pub fn new(loaded: LoadedScene, seed: u64) -> Result<Self, StudyError> {
        Self::among(loaded, seed, Choice::default())
    }

    /// As [`Study::new`], with the rates and the troubles of `choice` alone.
    ///
    /// # Errors
    /// As [`Study::new`].
    pub fn among(loaded: LoadedScene, seed: u64, choice: Choice) -> Result<Self, StudyError> {
        Ok(Self {
            scene: Some(Prepared::new(loaded, seed)?),
            seed,
            choice,
        })
    }

    /// The study of `seed` on drawn bodies, with the rates and the troubles of `choice`.
    pub fn drawn(seed: u64, choice: Choice) -> Self {
        Self {
            scene: None,
            seed,
            choice,
        }
    }

    fn specimen(&self, cell: u64) -> Option<Specimen> {
        let drawn = self.scene.is_none();
        drawn.then(|| Specimen::new(self.seed, cell))
    }

    fn draw(&self, cell: u64) -> Draw {
        let specimen = self.specimen(cell);
        let hands = specimen.map_or(0, |specimen| specimen.hands.len());
        let devices = self
            .scene
            .as_ref()
            .map_or(hands, |scene| scene.reaches.len());
        let mut draw = Draw::among(&self.choice, self.seed, cell, devices);
        if self.tears() {
            draw.softening = None;
        }
        draw
    }

    /// Whether a body of the scene tears. Such a body keeps its mesh and its material, so no body of the study softens.
    pub fn tears(&self) -> bool {
        let bodies = |scene: &Prepared| scene.loaded.scene.bodies.iter().any(|b| b.tear.is_some());
        self.scene.as_ref().is_some_and(bodies)
    }

    fn trial(&self, cell: u64) -> Result<Trial, StudyError> {
        let draw = self.draw(cell);
        let own;
        let prepared = if let Some(prepared) = &self.scene {
            prepared
        } else {
            let name = format!("scene {cell} of seed {}", self.seed);
            let specimen = Specimen::new(self.seed, cell);
            own = Prepared::new(specimen.scene(&name)?, self.seed)?;
            &own
        };
        let mut loaded = prepared.loaded.clone();
        // As in scene files, a publication comes after a whole number of steps.
        let step_rate = loaded.scene.host.step_rate;
        loaded.scene.host.publish_rate = step_rate / (step_rate / draw.rate).round();
        loaded.scene.host.latency = draw.latency;
        hands::give(
            &mut loaded,
            &draw,
            Chance::new(self.seed, cell).of("task"),
            &prepared.reaches,
            &prepared.stiffness,
            &prepared.friction,
        );
        let soft = draw.softening.map(|softening| {
            let mut soft = loaded.clone();
            for body in &mut soft.scene.bodies {
                body.material.young *= softening.left;
                if let Some(weave) = &mut body.material.weave {
                    weave.young_weft *= softening.left;
                    weave.shear *= softening.left;
                }
                for young in body.regions.iter_mut().filter_map(|r| r.young.as_mut()) {
                    *young *= softening.left;
                }
            }
            soft
        });
        Ok(Trial { loaded, soft, draw })
    }

    /// The scene of a cell under `scheme` as a scene file, and what the file cannot say.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn written(&self, cell: u64, scheme: SchemeName) -> Result<Written, StudyError> {
        Written::of(&self.trial(cell)?, scheme)
    }

    /// The reference of a cell, and its run under each of `schemes`.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn traces(
        &self,
        cell: u64,
        schemes: &[SchemeName],
    ) -> Result<(Draw, Trace, Vec<Trace>), StudyError> {
        self.traces_told(cell, schemes, &|_| ())
    }

    /// As [`Study::traces`]. After each part of the work, `done` is given its fraction of the whole.
    fn traces_told(
        &self,
        cell: u64,
        schemes: &[SchemeName],
        done: &dyn Fn(f64),
    ) -> Result<(Draw, Trace, Vec<Trace>), StudyError> {
        let part = 1.0 / (1 + 2 * schemes.len()) as f64;
        let trial = self.trial(cell)?;
        let reference = reference::run(&trial)?;
        done(part);
        let chance = Chance::new(self.seed, cell);
        let runs = schemes.iter().map(|scheme| {
            let mut run = run::run(&trial, *scheme, chance)?;
            done(part);
            reference::follow(&trial, &mut run)?;
            done(part);
            Ok::<_, StudyError>(run)
        });
        let runs = runs.collect::<Result<_, _>>()?;
        Ok((trial.draw, reference, runs))
    }

    /// Runs a cell again under `scheme`, for a person.
    ///
    /// # Errors
    /// [`StudyError`].
    pub fn again(&self, cell: u64, scheme: SchemeName) -> Result<Again, StudyError> {
        let (draw, reference, mut runs) = self.traces(cell, &[scheme])?;
        let run = runs.swap_remove(0);
        let known = SCHEMES.iter().find(|(name, _)| *name == scheme);
        let scheme = known.map_or("", |(_, name)| name);
        let outcome = Outcome::of(&run, &reference, &draw);
        let head = format!("{scheme}: {}", verdict::of_outcome(&outcome));
        Ok(Again {
            text: again::drawn(cell, self.seed, &draw)
                + &again::measured(&head, &outcome, &reference),
            title: format!("Cell {cell} under \"{scheme}\""),
            subtitle: format!(
                "{:.0} Hz, latency {:.0} ms, {:.0} % of models lost; trouble: {}",
                draw.rate,
                1e3 * draw.latency,
                100.0 * draw.models_lost,
                draw.trouble.name()
            ),
            run,
            reference,
        })
    }

    /// Runs a cell under each of `schemes`.
    pub fn cell(&self, cell: u64, schemes: &[(SchemeName, &str)]) -> CellResult {
        self.cell_told(cell, schemes, &|_| ())
    }

    /// As [`Study::cell`]. After each part of the work, `done` is given its fraction of the whole.
    pub fn cell_told(
        &self,
        cell: u64,
        schemes: &[(SchemeName, &str)],
        done: &dyn Fn(f64),
    ) -> CellResult {
        let names: Vec<_> = schemes.iter().map(|(scheme, _)| *scheme).collect();
        match self.traces_told(cell, &names, done) {
            Ok((draw, reference, runs)) => CellResult {
                reference: reference.stillness(),
                reference_net_energy: reference.net_energy(),
                schemes: schemes
                    .iter()
                    .zip(&runs)
                    .map(|((_, name), run)| {
                        let outcome = Outcome::of(run, &reference, &draw);
                        ((*name).to_owned(), outcome)
                    })
                    .collect(),
                draw,
                specimen: self.specimen(cell),
                failed: None,
            },
            Err(error) => CellResult {
                draw: self.draw(cell),
                specimen: self.specimen(cell),
                reference: Stillness::default(),
                reference_net_energy: 0.0,
                schemes: BTreeMap::new(),
                failed: Some(error.to_string()),
            },
        }
    }
}

impl Prepared {
    fn new(mut loaded: LoadedScene, seed: u64) -> Result<Self, StudyError> {
        host::engine::build::check(&loaded)?;
        loaded.scene.host.step_rate = STEP_RATE.min(loaded.scene.realtime.rate);
        loaded.scene.duration = draw::DURATION;
        let built = host::world::World::new(&loaded)?;
        let (config, devices) = host::run::prepare::controls(&built, seed)?;
        let friction = loaded.models.iter().map(|model| model.friction).collect();
        let stiffness = stiffness(&loaded)?;
        let mut reaches = hands::reaches(&loaded);
        let limits = config.devices.iter();
        let limits: Vec<_> = limits.map(|device| device.safety.max_force).collect();
        hands::within(&mut reaches, &stiffness, &limits);
        // The spring of `thesis` gets the stiffness of the body, the best value for it.
        let own = (0..3 * devices.len()).map(|k| {
            let scale = config.devices[k / 3].frame.motion_scale;
            stiffness[(k, k)] / (scale * scale)
        });
        loaded.scene.realtime.thesis_stiffness = own.fold(0.0, f64::max);
        Ok(Self {
            loaded,
            reaches,
            friction,
            stiffness,
        })
    }
}

/// Stiffness between all devices of a scene at rest that the devices render, three rows and columns for each device, in the
/// axes, metres and newtons of the devices (N/m). It is zero along the axes along which a device does not move.
fn stiffness(loaded: &LoadedScene) -> Result<Square, StudyError> {
    let scene = &loaded.scene;
    let mut all = Square::zeros(3 * scene.devices.len());
    let frames = trial::frames(loaded)?;
    let world = host::world::World::new(loaded)?;
    for (built, spec) in world.bodies.iter().zip(&scene.bodies) {
        let mut body = built.body.clone();
        let grasps = grasps(scene, spec).into_iter();
        let devices: Vec<_> = grasps.map(|grasp| grasp.device).collect();
        let rendered = Rendered::new(&world, &devices, &mut body, SLOW)?;
        for (i, row) in devices.iter().copied().enumerate() {
            for (j, column) in devices.iter().copied().enumerate() {
                let scale = frames[row].motion_scale * frames[column].motion_scale;
                let turn = |device: usize| frames[device].rotation.to_rotation_matrix();
                let block: Matrix3<f64> = rendered.model().stiffness[i][j]
                    .fixed_view::<3, 3>(0, 0)
                    .into();
                let block = turn(row).matrix().transpose() * block * turn(column).matrix();
                for (r, c) in (0..9).map(|k| (k / 3, k % 3)) {
                    all[(3 * row + r, 3 * column + c)] += scale * block[(r, c)];
                }
            }
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use host::scene::Scene;

    const PADDLE: &str = include_str!("../../../../scenes/paddle.toml");

    #[test]
    fn a_paddle_meets_no_stiffness_across_its_axis() {
        let loaded = Scene::load_texts("paddle.toml", PADDLE, &BTreeMap::new());
        let loaded = loaded.expect("the scene is sound");
        let found = stiffness(&loaded).expect("it condenses");
        // The paddle's x is the scene's -z.
        let built = host::world::World::new(&loaded).expect("it is sound");
        let condenser = host::world::condense(&built.bodies[0], SLOW).expect("it condenses");
        let along = condenser.condensed().stiffness[(2, 2)];
        for (r, c) in (0..9).map(|k| (k / 3, k % 3)) {
            let expected = if (r, c) == (0, 0) { along } else { 0.0 };
            // Rounding of a turn.
            assert!((found[(r, c)] - expected).abs() < 1e-9 * along, "{r} {c}");
        }
        let study = Study::new(loaded, 1).expect("it is sound");
        let spring = study
            .scene
            .expect("it has one")
            .loaded
            .scene
            .realtime
            .thesis_stiffness;
        assert!((spring / along - 1.0).abs() < 1e-9, "{spring} {along}");
    }
}
