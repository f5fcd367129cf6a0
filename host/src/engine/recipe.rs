//! How the solver of a body is made: before a run, and again in the background when the body's topology changes.

use super::background::Background;
use super::build::BuildOptions;
use super::plan::BodyPlan;
use super::solver::Solver;
use super::stats::StepFault;
use crate::scene::spec::{Scene, SolverName};
use physics::{Body, Preconditioner, ShapeOptions, Stepper, StepperOptions};

/// Most iterations for a shape at a time on an incomplete factor. Large sheets take the most, some hundred. The limit
/// keeps a condensation from delaying the steps for a small gain in accuracy.
const INCOMPLETE_SHAPE_ITERATIONS: usize = 200;

/// The choices of a plan that make the solver of a body.
#[derive(Clone, Copy, Debug)]
pub struct Recipe {
    /// Options of the steps on a factor.
    options: StepperOptions,
    /// Length of a step (s).
    step: f64,
    /// Whether stiffness and damping are condensed.
    condenses: bool,
    /// Whether the run is under the real clock.
    real: bool,
    /// Time that a step may take under the real clock (ns).
    budget_ns: Option<u64>,
}

impl Recipe {
    /// The recipe of a body with the plan `plan`.
    pub(super) fn new(scene: &Scene, plan: &BodyPlan, how: BuildOptions) -> Self {
        let budget = how.real.then_some(scene.host.budget).flatten();
        Self {
            options: StepperOptions {
                tolerance: scene.host.tolerance,
                max_iterations: scene.host.max_iterations,
                preconditioner: match plan.choice.solver {
                    SolverName::Incomplete => Preconditioner::Incomplete,
                    _ => Preconditioner::Complete,
                },
                code: how.code,
                refresh: false,
                may_touch: scene.has_contact(),
                ..StepperOptions::default()
            },
            step: plan.step,
            condenses: plan.condenses,
            real: how.real,
            budget_ns: budget.map(|budget| (budget * 1e9) as u64),
        }
    }

    /// Whether something of the scene touches.
    pub(super) fn may_touch(&self) -> bool {
        self.options.may_touch
    }

    /// Whether solvers do their background work on threads.
    pub(super) fn is_real(&self) -> bool {
        self.real
    }

    /// Makes the solver of `body`, with the first factor, so that the first step takes no longer than the others.
    ///
    /// # Errors
    /// [`StepFault`] for a body whose matrix cannot be factorized.
    pub(super) fn make(&self, body: &Body) -> Result<Solver, StepFault> {
        let mut stepper = Stepper::new(body, self.options)?;
        stepper.prepare(body, self.step)?;
        let shapes = self
            .condenses
            .then(|| match (body.surface(), self.options.preconditioner) {
                (Some(_), Preconditioner::Complete) => super::tears::SHAPES,
                (None, Preconditioner::Complete) => ShapeOptions::default(),
                (_, Preconditioner::Incomplete) => ShapeOptions {
                    max_iterations: INCOMPLETE_SHAPE_ITERATIONS,
                    ..ShapeOptions::default()
                },
            });
        let background = Background::new(self.real, self.step);
        Ok(Solver::new(
            stepper,
            background,
            shapes,
            (self.step, self.real),
            self.budget_ns,
        ))
    }
}
