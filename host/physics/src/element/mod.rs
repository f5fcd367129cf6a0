//! Elements: forces, energies and stiffness of sets of elements. The exact form and the form for vector instructions
//! stand side by side.
//!
//! - [`Elements`]: the interface of a set of elements to a body, in the exact form.
//! - `kernel`: the interface of a set of elements to the realtime step, on padded nodes.
//! - [`tet`]: code that linear and quadratic tetrahedra have in common: shape functions, any law in the exact form, any
//!   isotropic law in the vector form.
//! - [`tet4`], [`tet10`]: linear and quadratic tetrahedra under Hooke's law, in the vector form.
//! - [`triangle`]: membranes, isotropic or woven.
//! - [`bending`]: the bending stiffness of a sheet that is flat at rest.

pub mod bending;
pub mod elements;
pub(crate) mod kernel;
pub mod tet;
pub mod tet10;
pub mod tet4;
pub mod triangle;

pub use elements::Elements;
