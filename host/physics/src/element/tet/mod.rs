//! Tetrahedra of elastic solids: code that linear and quadratic tetrahedra have in common.
//!
//! - [`shape`]: shape functions and quadrature.
//! - [`solid`]: any law, in the exact form.
//! - `principal`: any isotropic law, in the vector form; `principal_linearize` and `principal_kernels`: its forces and
//!   tangents, and its products; `principal_cost`: its operations.

pub(crate) mod principal;
mod principal_cost;
pub(crate) mod principal_kernels;
mod principal_linearize;
pub mod shape;
pub mod solid;
