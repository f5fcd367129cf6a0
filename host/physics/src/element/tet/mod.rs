//! Tetrahedra of elastic solids: code that linear and quadratic tetrahedra have in common.
//!
//! - [`shape`]: shape functions and quadrature.
//! - [`solid`]: any law, in the exact form.
//! - `principal` and `principal_kernels`: any isotropic law, in the vector form; `principal_cost`: its operations.

pub(crate) mod principal;
mod principal_cost;
pub(crate) mod principal_kernels;
pub mod shape;
pub mod solid;
