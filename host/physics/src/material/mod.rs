//! Materials: what a deformation costs, point by point.
//!
//! A law knows a deformation gradient and the parameters of a material, nothing of elements, meshes or time.
//!
//! - [`Material`], [`SolidMaterial`], [`ThreadMaterial`], [`Weave`]: the parameters.
//! - [`law`]: laws of elastic solids.
//! - [`sheet_law`]: laws of thin sheets with a grain.

pub mod law;
mod parameters;
pub mod sheet_law;
pub mod weave;

pub use parameters::{Material, SolidMaterial, ThreadMaterial};
pub use weave::Weave;

/// Which tangent an element gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tangent {
    /// The derivative of the force, indefinite under compression.
    Exact,
    /// Its negative parts clipped: positive semidefinite.
    Clipped,
}
