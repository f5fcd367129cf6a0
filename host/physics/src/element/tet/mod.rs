//! Tetrahedra of elastic solids: what linear and quadratic ones have in common.
//!
//! - [`shape`]: shape functions and quadrature.
//! - [`solid`]: any law, exactly.
//! - `principal` and `principal_kernels`: any isotropic law, in vectors.

pub(crate) mod principal;
pub(crate) mod principal_kernels;
pub mod shape;
pub mod solid;
