//! Elements: forces, energies and stiffness of sets of elements. The exact form and the form for vector instructions
//! stand side by side.
//!
//! - [`Elements`]: what any set of elements gives a body, exactly.
//! - `kernel`: what the realtime step needs of a set, on padded nodes.
//! - [`tet`]: what linear and quadratic tetrahedra have in common: shape functions, any law exactly, any isotropic law in
//!   vectors.
//! - [`tet4`], [`tet10`]: linear and quadratic tetrahedra under Hooke's law, in vectors.
//! - [`triangle`]: membranes, with a grain or without.
//! - [`truss`]: bars of a thread, a suture or a net.
//! - [`bending`]: what a sheet that is flat at rest resists bending with.

pub mod bending;
pub mod elements;
pub(crate) mod kernel;
pub mod tet;
pub mod tet10;
pub mod tet4;
pub mod triangle;
pub mod truss;

pub use elements::Elements;
