//! How well the local model of a solid predicts the force between publications.
//!
//! A cube of gelatine is pressed between a fixed plate and a hand. From some moment on the hand moves at a constant
//! velocity. The change of its force after 1 to 50 ms is predicted as in the tick: by stiffness, damping and drift,
//! condensed for that period. The prediction is compared with a simulation with far shorter steps. A scheme that holds
//! the force has the error 1. There are two motions:
//!
//! - **from rest**: the body is at rest, and the velocity of the hand jumps, which no hand can do: the worst case.
//! - **steady**: the hand has accelerated for 0.2 s and keeps its velocity.
//!
//! A body in steady motion keeps moving without the hand. Stiffness and damping cannot represent this, because they
//! attribute the whole change to the displacement of the hand; the drift can. The errors of a model without drift are
//! therefore listed beside those of the published model. The models come from a body that is stepped as in the host;
//! its drift contains the error of these steps.
//!
//! The prediction is exact for one linearized step of implicit Euler that is as long as the period, if the inertia is
//! added, which is published but not extrapolated. The condensation is defined by this property, and the property is
//! checked.

use super::solve::{vertices, weightless};
use crate::{Level, StudyError};
use physics::mesh::generate_box::solid_box;
use physics::{
    Body, BodyConfig, Border, Condensed, Condenser, Equilibrium, EquilibriumOptions, Freedom,
    HandlePose, HandleSpec, Integrator, IntegratorOptions, SolidLaw, SolidMaterial, Tangent,
    TimeScheme, Vec3,
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
/// Time in which the steady hand accelerates to its velocity (s).
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
    /// Time since the publication of the model, and the period for which the model was condensed (s).
    pub period: f64,
    /// Change of the hand's force over the period, as simulated (N).
    pub change: f64,
    /// Error of the predicted change, as a fraction of the change.
    pub error: f64,
    /// Error of a prediction without the drift, as a fraction of the change.
    pub error_without_drift: f64,
    /// Error of a prediction with drift, as a fraction of the change, condensed from the exact tangent of a body that no
    /// step has moved. Steps need a tangent
    /// without negative eigenvalues and condense that one; their drift contains the difference in compressed cells.
    pub error_exact_tangent: f64,
}

/// The results.
#[derive(Clone, Debug, Serialize)]
pub struct LocalModels {
    /// Length of the short steps (s).
    pub step: f64,
    /// Largest error, as a fraction of the change, for one linearized step with inertia.
    pub exactness: f64,
    /// All cells.
    pub predictions: Vec<Prediction>,
}

/// Runs all cases. `progress` receives the fraction done.
pub(super) fn run(level: Level, progress: &mut dyn FnMut(f64)) -> Result<LocalModels, StudyError> {
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
            .extend(scene.predict("from_rest", damping)?);
        let mut scene = Scene::new(cells, damping, steps_a_ms)?;
        scene.approach()?;
        found.predictions.extend(scene.predict("steady", damping)?);
    }
    progress(1.0);
    Ok(found)
}

/// The compressed cube, with a fixed plate (handle 0) and the hand (handle 1).
struct Scene {
    body: Body,
    /// The same body, stepped as in the host.
    stepped: Body,
    poses: [HandlePose; 2],
    /// Velocity of the hand before the prediction (m/s).
    velocity: Vec3,
    integrator: Integrator,
    /// One condenser for each period, for the stepped body.
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
                    border: Border::Hinged,
                }
            });
        let config = BodyConfig {
            stiffness_damping: damping,
            ..weightless()
        };
        let law = SolidLaw::Corotational;
        let mut body = Body::solid(&mesh, &[GELATINE], law, config, &handles)?;
        let poses = [-0.5, 0.45].map(|side| HandlePose::at(Vec3::z() * (side * EDGE)));
        Equilibrium::new(&body, EquilibriumOptions::default())?.solve(&mut body, &poses, 1.0)?;
        let options = IntegratorOptions {
            scheme: TimeScheme::TrBdf2,
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

    /// Accelerates the hand to [`VELOCITY`].
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
                for (condenser, period) in due.filter(|(_, period)| is_published(ms, *period)) {
                    condenser.condense(&self.stepped, f64::from(period) * 1e-3)?;
                }
            }
        }
        self.velocity = VELOCITY;
        Ok(())
    }

    /// Compares the prediction of the model of each period with the simulation.
    fn predict(
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
            let predicted = |body: &Body, condenser: &mut Condenser| {
                let condensed = condenser.condense(body, t)?;
                // The displacement, and the velocity less the published velocity, as in the tick.
                let jump = VELOCITY - self.velocity;
                let stiffness = hand(condensed, |m| &m.stiffness);
                let damper = hand(condensed, |m| &m.damping) * jump;
                let plain = -(stiffness * (VELOCITY * t) + damper);
                let drift = Vec3::from_column_slice(&condensed.drift[6..9]) * t;
                Ok::<_, StudyError>([plain, plain + drift])
            };
            let [plain, whole] = predicted(&self.stepped, condenser)?;
            let [_, exact] = predicted(&self.body, &mut exact)?;
            models.push((ms, t, [whole, plain, exact]));
        }
        let mut done = 0;
        for (ms, period, predicted) in models {
            for step in done + 1..=ms * self.steps_a_ms {
                self.poses[1].position = before + VELOCITY * (f64::from(step) * h);
                self.integrator.step(&mut self.body, h, &self.poses)?;
            }
            done = ms * self.steps_a_ms;
            let simulated = self.force() - start;
            let [error, error_without_drift, error_exact_tangent] =
                predicted.map(|change| (change - simulated).norm() / simulated.norm());
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

    /// The largest error over all periods for one linearized step.
    fn exactness(&self) -> Result<f64, StudyError> {
        let mut worst = 0.0_f64;
        let mut condenser = Condenser::new(&self.body)?;
        for ms in PERIODS {
            let t = f64::from(ms) * 1e-3;
            let mut body = self.body.clone();
            body.assemble();
            let by = VELOCITY * t;
            let condensed = condenser.condense(&body, t)?;
            let predicted = hand(condensed, |m| &m.raw_stiffness) * by
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
            worst = worst.max((predicted - simulated).norm() / simulated.norm());
        }
        Ok(worst)
    }
}

/// Whether a model with the period `period` (ms) is published `ms` after the start of the hand. Only the last models
/// matter.
fn is_published(ms: u32, period: u32) -> bool {
    ms.is_multiple_of(period) && ms + 10 * period >= (APPROACH * 1e3) as u32
}

/// The block of one of the matrices that relates the hand's motion to its force.
fn hand(
    condensed: &Condensed,
    matrix: impl Fn(&Condensed) -> &physics::linear::dense::Square,
) -> physics::Mat3 {
    physics::Mat3::from_fn(|i, j| matrix(condensed)[(6 + i, 6 + j)])
}
