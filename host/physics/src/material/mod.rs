//! Materials: their parameters, and the energy density and stress of a deformation.
//!
//! A law is a function of a deformation gradient and the parameters of a material. It is independent of elements,
//! meshes and time.
//!
//! - [`Material`], [`SolidMaterial`], [`ThreadMaterial`], [`Weave`], [`Rigidity`]: the parameters.
//! - [`law`]: laws of elastic solids.
//! - [`sheet_law`]: laws of thin sheets with a grain.

pub mod law;
mod parameters;
pub mod sheet_law;
pub mod weave;

pub use parameters::{Material, SolidMaterial, ThreadMaterial};
pub use weave::{Rigidity, Weave};

/// The kind of tangent that a law or an element returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tangent {
    /// The exact derivative of the force. It is indefinite under compression.
    Exact,
    /// The exact derivative with its negative eigenvalues set to zero: positive semidefinite.
    Clipped,
}
