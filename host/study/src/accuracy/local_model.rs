//! How well the local model of a solid foretells the force between publications.
//!
//! A cube of gelatine is pressed between a fixed plate and a hand. From some moment on the hand moves at a
//! constant velocity, and the change of its force after 1 to 50 ms is foretold by stiffness, damping and drift as
//! condensed for just that period, as the tick does, and simulated with steps far shorter. A model that is
//! held errs by the whole change: 1. Two motions:
//!
//! - **from rest**: the body at rest, the hand's velocity jumps, which no hand can do: the worst case.
//! - **steady**: the hand has come to its velocity over 0.2 s and keeps it.
//!
//! A body in steady motion carries on without the hand's doing, which stiffness and damping cannot know: they
//! take all of the hand's displacement for news. The drift knows. So the errors of a model without drift stand beside
//! those of the published one. The models come from a body that is stepped as the host does: its drift tells what its
//! steps missed.
//!
//! One linearized step of implicit Euler as long as the period is foretold exactly, once the inertia is added
//! that is published but not extrapolated: that is what the condensation is made for, and checks it.

use super::solve::{vertices, weightless};
use crate::{Level, StudyError};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Condensed, Condenser, Equilibrium, EquilibriumOptions, Freedom, HandlePose,
    HandleSpec, Integrator, IntegratorOptions, Scheme, SolidLaw, SolidMaterial, Tangent, Vec3,
};
use serde::Serialize;

const EDGE: f64 = 0.1;
const GELATINE: SolidMaterial = SolidMaterial {
    young: 2e4,
    poisson: 0.3,
    density: 1000.0,
};
/// Velocity of the hand (m/s): down and aside, 1.1 mm in 50 ms.
const VELOCITY: Vec3 = Vec3::new(0.01, 0.0, -0.02);
/// Time in which the steady hand comes to its velocity (s).
const APPROACH: f64 = 0.2;
/// Length of the host's steps (s).
const STEP: f64 = 1e-3;
/// Periods (ms).
const PERIODS: [u32; 6] = [1, 2, 5, 10, 20, 50];

/// One cell of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Prediction {
    /// `from_rest` or `steady`.
    pub motion: &'static str,
    /// Rayleigh damping by stiffness (s).
    pub damping: f64,
    /// Time since the model was published, and the period that it was condensed for (s).
    pub period: f64,
    /// Change of the hand's force over it, as simulated (N).
    pub change: f64,
    /// Error of the change foretold, as a share of it.
    pub error: f64,
    /// The same without the drift.
    pub error_without_drift: f64,
    /// The same with drift, condensed from the exact tangent of a body that no step has moved. Steps need one without
    /// negative parts and condense that; their drift tells what it lacks in pressed cells.
    pub error_exact_tangent: f64,
}

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct LocalModels {
    /// Length of the short steps (s).
    pub step: f64,
    /// Largest error, as a share of the change, where the future is one linearized step and inertia is added.
    pub exactness: f64,
    /// All cells.
    pub predictions: Vec<Prediction>,
}

/// Runs all; `progress` is given the share done.
pub(super) fn run(level: Level, mut progress: impl FnMut(f64)) -> Result<LocalModels, StudyError> {
    let (cells, steps_a_ms, dampings): (_, _, &[f64]) = match level {
        Level::Quick => (3, 2, &[0.0, 1e-2]),
        Level::Full => (5, 4, &[0.0, 1e-3, 1e-2, 0.1]),
    };
    let mut found = LocalModels {
        step: 1e-3 / f64::from(steps_a_ms),
        exactness: 0.0,
        predictions: Vec::new(),
    };
    for (number, &damping) in dampings.iter().enumerate() {
        progress(number as f64 / dampings.len() as f64);
        let scene = Scene::new(cells, damping, steps_a_ms)?;
        found.exactness = found.exactness.max(scene.exactness()?);
        found
            .predictions
            .extend(scene.foretell("from_rest", damping)?);
        let mut scene = Scene::new(cells, damping, steps_a_ms)?;
        scene.approach()?;
        found.predictions.extend(scene.foretell("steady", damping)?);
    }
    progress(1.0);
    Ok(found)
}

/// The cube, pressed, with a fixed plate (handle 0) and the hand (handle 1).
struct Scene {
    body: Body,
    /// The same body, stepped as the host does.
    stepped: Body,
    poses: [HandlePose; 2],
    /// Velocity of the hand before it is foretold (m/s).
    velocity: Vec3,
    integrator: Integrator,
    /// One for each period, kept up by the stepped body.
    condensers: Vec<Condenser>,
    steps_a_ms: u32,
}

impl Scene {
    fn new(cells: u32, damping: f64, steps_a_ms: u32) -> Result<Self, StudyError> {
        let mesh = solid_box([EDGE; 3], [cells; 3])?;
        let handles =
            [(-0.5, Freedom::Fixed), (0.5, Freedom::Translation)].map(|(side, freedom)| {
                let z: f64 = side * EDGE;
                HandleSpec {
                    vertices: vertices(&mesh.positions, |x| (x.z - z).abs() < 1e-9),
                    origin: Vec3::new(0.0, 0.0, z),
                    freedom,
                }
            });
        let config = BodyConfig {
            stiffness_damping: damping,
            ..weightless()
        };
        let law = SolidLaw::Corotational;
        let mut body = Body::solid(&mesh, &[GELATINE], law, config, &handles)?;
        let poses = [-0.5, 0.45].map(|share| HandlePose::at(Vec3::z() * (share * EDGE)));
        Equilibrium::new(&body, EquilibriumOptions::default())?.solve(&mut body, &poses, 1.0)?;
        let options = IntegratorOptions {
            scheme: Scheme::TrBdf2,
            ..IntegratorOptions::default()
        };
        let integrator = Integrator::new(&body, options)?;
        let condensers: Result<_, _> = PERIODS.iter().map(|_| Condenser::new(&body)).collect();
        Ok(Self {
            stepped: body.clone(),
            body,
            poses,
            velocity: Vec3::zeros(),
            integrator,
            condensers: condensers?,
            steps_a_ms,
        })
    }

    /// Force on the hand (N), without the inertia of the vertices that it holds.
    fn force(&self) -> Vec3 {
        let report = self.body.handle_report(1);
        report.map_or(Vec3::zeros(), |report| report.wrench_on_hand.force)
    }

    /// Moves the hand with a growing velocity until it has [`VELOCITY`].
    fn approach(&mut self) -> Result<(), StudyError> {
        let steps = (APPROACH * 1e3) as u32 * self.steps_a_ms;
        let h = APPROACH / f64::from(steps);
        let start = self.poses[1].position;
        for step in 1..=steps {
            let t = f64::from(step) * h;
            // The velocity follows 3 s^2 - 2 s^3.
            let s = t / APPROACH;
            self.poses[1].position = start + VELOCITY * (APPROACH * s * s * s * (1.0 - 0.5 * s));
            self.integrator.step(&mut self.body, h, &self.poses)?;
            if step % self.steps_a_ms == 0 {
                self.stepped.step(STEP, &self.poses)?;
                let ms = step / self.steps_a_ms;
                let due = self.condensers.iter_mut().zip(PERIODS);
                for (condenser, period) in due.filter(|(_, period)| is_told(ms, *period)) {
                    condenser.condense(&self.stepped, f64::from(period) * 1e-3)?;
                }
            }
        }
        self.velocity = VELOCITY;
        Ok(())
    }

    /// Compares the model of each period with what comes.
    fn foretell(
        mut self,
        motion: &'static str,
        damping: f64,
    ) -> Result<Vec<Prediction>, StudyError> {
        let mut exact = Condenser::new(&self.body)?;
        let (start, before) = (self.force(), self.poses[1].position);
        let h = 1e-3 / f64::from(self.steps_a_ms);
        if self.velocity == Vec3::zeros() {
            self.stepped.assemble();
        }
        let mut predictions = Vec::new();
        let mut models = Vec::new();
        self.body.assemble_with(Tangent::Exact);
        for (ms, condenser) in PERIODS.into_iter().zip(&mut self.condensers) {
            let t = f64::from(ms) * 1e-3;
            let foretold = |body: &Body, condenser: &mut Condenser| {
                let condensed = condenser.condense(body, t)?;
                // As the tick does: displacement, and velocity less that published.
                let jump = VELOCITY - self.velocity;
                let stiffness = hand(condensed, |m| &m.stiffness);
                let damper = hand(condensed, |m| &m.damping) * jump;
                let plain = -(stiffness * (VELOCITY * t) + damper);
                let drift = Vec3::from_column_slice(&condensed.drift[6..9]) * t;
                Ok::<_, StudyError>([plain, plain + drift])
            };
            let [plain, whole] = foretold(&self.stepped, condenser)?;
            let [_, exact] = foretold(&self.body, &mut exact)?;
            models.push((ms, t, [whole, plain, exact]));
        }
        let mut done = 0;
        for (ms, period, foretold) in models {
            for step in done + 1..=ms * self.steps_a_ms {
                self.poses[1].position = before + VELOCITY * (f64::from(step) * h);
                self.integrator.step(&mut self.body, h, &self.poses)?;
            }
            done = ms * self.steps_a_ms;
            let simulated = self.force() - start;
            let [error, error_without_drift, error_exact_tangent] =
                foretold.map(|change| (change - simulated).norm() / simulated.norm());
            predictions.push(Prediction {
                motion,
                damping,
                period,
                change: simulated.norm(),
                error,
                error_without_drift,
                error_exact_tangent,
            });
        }
        Ok(predictions)
    }

    /// The largest error, over all periods, where the future is one linearized step.
    fn exactness(&self) -> Result<f64, StudyError> {
        let mut worst = 0.0_f64;
        let mut condenser = Condenser::new(&self.body)?;
        for ms in PERIODS {
            let t = f64::from(ms) * 1e-3;
            let mut body = self.body.clone();
            body.assemble();
            let by = VELOCITY * t;
            let condensed = condenser.condense(&body, t)?;
            let foretold = hand(condensed, |m| &m.raw_stiffness) * by
                + hand(condensed, |m| &m.raw_damping) * (by / t)
                + hand(condensed, |m| &m.mass) * (by / (t * t));
            let reaction = |motion: Vec3| -> Result<Vec3, StudyError> {
                let mut body = body.clone();
                let mut poses = self.poses;
                poses[1].position += motion;
                body.solve(t, &poses)?;
                let report = body.handle_report(1);
                Ok(report.map_or(Vec3::zeros(), |report| report.reaction.force))
            };
            let simulated = reaction(by)? - reaction(Vec3::zeros())?;
            worst = worst.max((foretold - simulated).norm() / simulated.norm());
        }
        Ok(worst)
    }
}

/// Whether a model is published `ms` after the hand set out, every `period` (ms): only the last ones matter.
fn is_told(ms: u32, period: u32) -> bool {
    ms.is_multiple_of(period) && ms + 10 * period >= (APPROACH * 1e3) as u32
}

/// What the hand's own motion does to its force, in one of the matrices.
fn hand(
    condensed: &Condensed,
    matrix: impl Fn(&Condensed) -> &physics::linear::dense::Square,
) -> physics::Mat3 {
    physics::Mat3::from_fn(|i, j| matrix(condensed)[(6 + i, 6 + j)])
}
