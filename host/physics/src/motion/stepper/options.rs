//! The options and the report of a stepper.

use crate::linear::precondition::Preconditioner;
use crate::linear::sparse_cholesky::FactorCode;

/// The start of conjugate gradients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guess {
    /// The velocity is that of the last step.
    Velocity,
    /// The velocity changes as in the last step: closer in a smooth motion, twice too far when a motion begins.
    Acceleration,
    /// The velocity changes by a fitted combination of its last changes: closest in a smooth motion, and no further off
    /// when a motion begins or ends.
    #[default]
    Fitted,
}

/// The options of the solve in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepperOptions {
    /// The residual to reach, as a fraction of the forces on the free nodes and of the forces that move these nodes.
    pub tolerance: f64,
    /// Most iterations. A step that reaches this number uses the solution so far.
    pub max_iterations: usize,
    /// The start of the iterations.
    pub guess: Guess,
    /// The preconditioner. A stepper keeps its preconditioner until the topology epoch changes. An incomplete factor
    /// needs more iterations: up to 140 on a sheet of 30 thousand triangles.
    pub preconditioner: Preconditioner,
    /// A step of more iterations than this number asks for a new factor, as does one whose iterations reduce the
    /// residual too little. For an incomplete factor, the number counts from five quarters of the iterations of the
    /// first step on that factor.
    pub patience: usize,
    /// Whether the next step makes the new factor, which takes many times as long as a step. Otherwise the caller has
    /// to make the factor: see [`Stepper::lend`](crate::motion::stepper::Stepper::lend).
    pub refresh: bool,
    /// The code of the factorization.
    pub code: FactorCode,
    /// A body sleeps after some steps in which no vertex was faster than this speed (m/s); 0 turns sleep off. See
    /// `sleep` for the error that sleep causes.
    pub sleep_speed: f64,
    /// Whether the body may touch something. Its guess then follows no trend by more than its size, because the contacts of a
    /// step are found where the guess leads.
    pub may_touch: bool,
}

impl Default for StepperOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            max_iterations: 100,
            guess: Guess::default(),
            preconditioner: Preconditioner::default(),
            patience: 3,
            refresh: true,
            code: FactorCode::default(),
            sleep_speed: 1e-7,
            may_touch: false,
        }
    }
}

/// The report of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepperReport {
    /// Iterations of the solve.
    pub iterations: usize,
    /// Geometric mean of the factors by which the iterations reduced the residual; 0 without iterations.
    pub rate: f64,
    /// Norm of the residual at the end (N), from the recurrence.
    pub residual: f64,
    /// Norm of the forces on the free nodes and of the forces that move these nodes (N).
    pub reference: f64,
    /// Whether the tolerance was met.
    pub converged: bool,
    /// Fraction of the motion that was held back, because the whole motion would have added energy to the body.
    pub held_back: f64,
    /// Whether the body sleeps and the step did nothing.
    pub asleep: bool,
}
