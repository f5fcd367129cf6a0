//! What a stepper is asked, and what it answers.

use crate::linear::precondition::Preconditioner;
use crate::linear::sparse_cholesky::FactorCode;

/// Where conjugate gradients start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guess {
    /// The velocity stays.
    Velocity,
    /// The velocity changes as in the last step: closer in a smooth motion, twice too far where one begins.
    Acceleration,
    /// The velocity changes by those fractions of its last changes that would have fitted best: closest in a smooth
    /// motion, and no further off where one begins or ends.
    #[default]
    Fitted,
}

/// How a step is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepperOptions {
    /// The residual to reach, as a fraction of the forces that act on the free nodes and of what moves them.
    pub tolerance: f64,
    /// Most iterations; the step is taken with what they have found.
    pub max_iterations: usize,
    /// Where they start.
    pub guess: Guess,
    /// What preconditions them; what the stepper was made with stays. An incomplete factor wants more of them: on a
    /// sheet of 30 thousand triangles up to 140.
    pub preconditioner: Preconditioner,
    /// A step of more iterations than this asks for a new factor, as does one whose iterations bring little. On an
    /// incomplete factor, of so many more than a quarter above those of the first step on it.
    pub patience: usize,
    /// Whether the next step makes it, which takes many times as long as a step. Otherwise someone else has to:
    /// see [`Stepper::lend`](crate::motion::stepper::Stepper::lend).
    pub refresh: bool,
    /// The code that factorizes.
    pub code: FactorCode,
    /// A body of which no vertex has been faster than this for some steps sleeps (m/s); 0 for none that does. See
    /// `sleep` for what that leaves out.
    pub sleep_speed: f64,
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
        }
    }
}

/// How a step went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepperReport {
    /// Iterations spent.
    pub iterations: usize,
    /// By how much each of them shortened the residual, in the geometric mean; 0 without any.
    pub rate: f64,
    /// Norm of the residual at the end (N), as the recurrence carries it.
    pub residual: f64,
    /// Norm of the forces that act on the free nodes, and of what moves them (N).
    pub reference: f64,
    /// Whether the tolerance was met.
    pub converged: bool,
    /// Fraction of the motion that was held back, for with all of it the body would have made energy.
    pub held_back: f64,
    /// Whether the body sleeps and nothing was done.
    pub asleep: bool,
}
