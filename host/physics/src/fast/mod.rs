//! The fast realtime step: corotational bodies without an assembled matrix.
//!
//! - [`lanes`]: numbers of either precision, and node vectors to and from arrays over elements.
//! - [`polar`]: rotations of elements, from where they last were.
//! - [`tet`]: linear tetrahedra in blocks: forces, energies and products with the stiffness.
//! - `tet_kernels`: what is computed on such a block.

pub mod lanes;
pub mod polar;
pub mod tet;
mod tet_kernels;

/// A vector by node: x, y, z and a zero that fills it up to a power of two.
pub type Node<T> = [T; 4];
