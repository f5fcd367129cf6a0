//! Deformable bodies with handles: forces, time steps, equilibria, and their condensation onto the handles.
//!
//! - [`law`] and [`shape`], joined in [`solid`]: tetrahedra of elastic solids.
//! - [`membrane`] and [`bending`]: thin sheets.
//! - `triangle_frame` and `surface_polar`: a triangle at rest, and how it turns and stretches.
//! - [`load`]: tractions as forces on vertices.
//! - [`sheet_law`], put onto triangles in [`woven`]: thin sheets with a grain.
//! - [`elements`]: what any set of elements gives a body.
//! - [`block_matrix`]: the stiffness, in 3 x 3 blocks on a fixed pattern.
//! - [`handle`] and `support`: vertices that a hand holds, and vertices that are guided along some axes.
//! - [`body`], `build`, `energy`, `memory` and `step`: the body, its construction, its sums, what it holds and its
//!   realtime step.
//! - `exchange`: the same body made of something else.
//! - [`pcg`]: preconditioned conjugate gradients for that step.
//! - `guard`: a bound on the energy that a step may leave.
//! - `rounding`: what rounding leaves unknown of positions, forces and energies.
//! - [`newton`], [`integrator`] and [`equilibrium`]: steps and equilibria solved to a tolerance.
//! - [`cholesky`], [`condense`] and `reduction`: what the hands feel, as small dense matrices between handles.
//!
//! A realtime step goes `assemble`, `solve`, and, where a local model is published, `condense`. The three
//! are separate so that the caller can time each and leave out what a scene does not need.

pub mod bending;
pub mod block_matrix;
pub mod body;
mod build;
pub mod cholesky;
pub mod condense;
pub mod dense;
pub mod elements;
mod energy;
pub mod equilibrium;
pub mod error;
mod exchange;
pub(crate) mod guard;
pub mod handle;
pub mod integrator;
pub mod law;
pub mod load;
pub mod material;
pub mod membrane;
mod memory;
pub mod newton;
pub mod pcg;
pub(crate) mod reduction;
pub(crate) mod rounding;
pub mod shape;
pub mod sheet_law;
pub mod solid;
pub(crate) mod sparse_cholesky;
mod step;
mod support;
pub(crate) mod surface_polar;
mod triangle_frame;
pub mod truss;
pub mod weave;
mod weight;
pub mod woven;

pub use block_matrix::BlockMatrix;
pub use body::{Body, BodyConfig};
pub use build::{SheetLawName, SolidLaw};
pub use condense::{Condensed, Condenser};
pub use elements::Elements;
pub use equilibrium::{Equilibrium, EquilibriumOptions, EquilibriumReport};
pub use error::{BodyError, CondenseError, StepError};
pub use handle::{Freedom, HandlePose, HandleReport, HandleSpec, Wrench};
pub use integrator::{Integrator, IntegratorOptions, Scheme, StepReport};
pub use material::{Material, SolidMaterial, ThreadMaterial};
pub use newton::{NewtonOptions, NewtonReport};
pub use pcg::{Budget, SolveReport};
pub use weave::Weave;
pub use woven::Woven;

/// Which tangent an element gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tangent {
    /// The derivative of the force, indefinite under compression.
    Exact,
    /// Its negative parts clipped: positive semidefinite.
    Clipped,
}
