//! The motion of a body: realtime steps, and steps and equilibria solved to a tolerance.
//!
//! - [`Stepper`]: one linearization by conjugate gradients on a frozen factor, without an assembled matrix.
//! - [`refresh`]: a new factor, made in parallel with the steps.
//! - `sleep`: bodies at rest, which are not stepped.
//! - [`constraint`]: laws over the differences of nodes, in the equation of a step.
//! - [`joined`]: bodies that are joined, solved together. [`touching`]: the same with contacts.
//! - [`tearing`]: the tears of a sheet, after each step.
//! - `step`: the same step with an assembled matrix.
//! - [`newton`], [`integrator`] and [`equilibrium`]: steps and equilibria solved to a tolerance.

pub mod constraint;
pub mod contacts;
pub mod equilibrium;
pub mod integrator;
pub mod joined;
pub mod joint_equation;
pub mod newton;
pub mod refresh;
mod sleep;
mod step;
pub mod stepper;
pub mod tearing;
pub mod touching;

pub use constraint::cohesion::Cohesion;
pub use equilibrium::in_contact::{ContactEquilibrium, Goal};
pub use equilibrium::{Equilibrium, EquilibriumOptions, EquilibriumReport};
pub use integrator::{Integrator, IntegratorOptions, StepReport, TimeScheme};
pub use newton::{NewtonOptions, NewtonReport};
pub use refresh::Refresher;
pub use stepper::{
    Equation, Guess, Ledger, Phase, Stepper, StepperOptions, StepperReport, complete_bytes,
};
pub use tearing::{Course, Grown, IsClear, Starts, TearLimit, TearOptions, TearReport, Tearing};
