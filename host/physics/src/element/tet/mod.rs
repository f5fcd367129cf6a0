//! Tetrahedra of elastic solids, linear and quadratic.
//!
//! - [`cell`]: a tetrahedron as the kernels take it, and by what linear and quadratic ones differ there.
//! - [`shape`]: shape functions and quadrature.
//! - [`solid`]: any law, in the exact form.
//! - [`hooke`]: Hooke's law, in the vector form, with `hooke_kernels` and `hooke_cost`.
//! - `principal`: any isotropic law, in the vector form; `principal_linearize` and `principal_kernels`: its forces and
//!   tangents, and its products; `principal_cost`: its operations.

pub mod cell;
pub mod hooke;
mod hooke_cost;
mod hooke_kernels;
pub(crate) mod principal;
mod principal_cost;
mod principal_kernels;
mod principal_linearize;
mod quadratic;
pub mod shape;
pub mod solid;
