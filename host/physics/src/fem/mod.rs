//! A thin elastic sheet with handles: forces, implicit steps, and its condensation onto the handles.
//!
//! - [`membrane`]: in-plane elasticity, one corotational constant-strain triangle at a time.
//! - [`woven`]: in-plane elasticity of a sheet with a grain, by the laws in [`sheet_law`].
//! - [`bending`]: a constant matrix that resists folding.
//! - [`block_matrix`]: the stiffness, in 3 x 3 blocks on a fixed pattern.
//! - [`handle`]: rigid groups of vertices that a hand holds.
//! - [`body`] and `step`: the sheet, its construction and its time step.
//! - [`pcg`]: preconditioned conjugate gradients for the step.
//! - [`cholesky`] and [`condense`]: what the hands feel, as small dense matrices between handles.
//!
//! A step goes `assemble`, `solve`, and, where a local model is published, `condense`. The three are
//! separate so that the caller can time each and leave out what a scene does not need.

pub mod bending;
pub mod block_matrix;
pub mod body;
pub mod cholesky;
pub mod condense;
pub mod dense;
pub mod error;
pub mod handle;
pub mod law;
pub mod material;
pub mod membrane;
pub mod pcg;
pub mod sheet_law;
mod step;
pub mod weave;
pub mod woven;

pub use body::{Sheet, SheetConfig};
pub use condense::{Condensed, Condenser};
pub use error::{CondenseError, SheetError, StepError};
pub use handle::{Freedom, HandlePose, HandleReport, HandleSpec, Wrench};
pub use material::Material;
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
