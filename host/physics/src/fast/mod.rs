//! The fast realtime step: corotational bodies without an assembled matrix.
//!
//! - [`lanes`]: numbers of either precision, and node vectors to and from arrays over elements.
//! - [`polar`]: rotations of elements, from where they last were.
//! - [`tet`]: linear tetrahedra in blocks: forces, energies and products with the stiffness.

pub mod lanes;
pub mod polar;
pub mod tet;

/// A vector by node: x, y, z and a zero that fills it up to a power of two.
pub type Node<T> = [T; 4];
