//! Meshes, finite elements and condensation: pure computation.
//!
//! Every item is a plain function or struct over state and time step. There are no threads, clocks, files or printing,
//! and no knowledge of devices. A mesh is given as arrays, time as the length of a step, and every budget as a number
//! of iterations. For this reason a run repeats to the byte.
//!
//! Each folder is a room. Rooms import downwards only, as `tests/rooms.rs` checks:
//!
//! - [`condense`]: the condensation of a body onto its handles.
//! - [`motion`]: steps and equilibria of a body.
//! - [`body`]: a deformable body with handles and supports.
//! - [`element`]: sets of elements, in exact form and in a form for vector instructions.
//! - [`material`]: laws. [`polar`]: rotations and stretches.
//! - [`linear`]: systems of linear equations.
//! - [`lanes`]: numbers laid out for vector instructions. [`cost`]: the cost of a pass over arrays.
//! - [`mesh`]: line, triangle and tetrahedral meshes, their checks and generators.
//! - [`error`]: the errors of a body, a step and a condensation.
//!
//! The main types are exported here under their own names.
#![forbid(unsafe_code)]

pub mod body;
pub mod condense;
pub mod cost;
pub mod element;
pub mod error;
pub mod lanes;
pub mod linear;
pub mod material;
pub mod mesh;
pub mod motion;
pub mod polar;

pub use body::handle::{Freedom, HandlePose, HandleReport, HandleSpec, Wrench};
pub use body::{Body, BodyConfig, BodyMap, SheetLawName, SolidLaw};
pub use condense::{Condensed, Condenser, ShapeOptions, ShapeReport, Shapes};
pub use cost::Cost;
pub use element::Elements;
pub use error::{BodyError, CondenseError, StepError};
pub use lanes::{Node, Real};
pub use linear::block_matrix::BlockMatrix;
pub use linear::pcg::{Budget, SolveReport};
pub use linear::places::Places;
pub use linear::precondition::Preconditioner;
pub use linear::sparse_cholesky::FactorCode;
pub use material::{Material, SolidMaterial, Tangent, ThreadMaterial, Weave};
pub use motion::{
    AssembledStepper, Equilibrium, EquilibriumOptions, EquilibriumReport, Guess, Integrator,
    IntegratorOptions, NewtonOptions, NewtonReport, Part, Refresher, StepReport, Stepper,
    StepperOptions, StepperReport, TimeScheme, complete_bytes,
};

/// A vector in three dimensions (m, m/s or N, as its name says).
pub type Vec3 = nalgebra::Vector3<f64>;
/// A 3 x 3 matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;
