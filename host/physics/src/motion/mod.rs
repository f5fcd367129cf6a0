//! How a body moves: realtime steps, and steps and equilibria solved to a tolerance.
//!
//! - [`Stepper`]: one linearization, without assembling anything, by conjugate gradients on a frozen factor.
//! - [`refresh`]: a new factor, made beside the steps.
//! - `sleep`: bodies at rest are not stepped.
//! - `step`: the same step, assembled; [`AssembledStepper`]: that in four calls.
//! - [`newton`], [`integrator`] and [`equilibrium`]: steps and equilibria solved to a tolerance.

mod assembled;
pub mod equilibrium;
pub mod integrator;
pub mod newton;
pub mod refresh;
mod sleep;
mod step;
pub mod stepper;

pub use assembled::AssembledStepper;
pub use equilibrium::{Equilibrium, EquilibriumOptions, EquilibriumReport};
pub use integrator::{Integrator, IntegratorOptions, StepReport, TimeScheme};
pub use newton::{NewtonOptions, NewtonReport};
pub use refresh::Refresher;
pub use stepper::{Guess, Part, Stepper, StepperOptions, StepperReport, complete_bytes};
