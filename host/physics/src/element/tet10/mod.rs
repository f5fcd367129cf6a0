//! Quadratic tetrahedra under Hooke's law in the vector form: `tets` stores them, `kernels` computes on their blocks.

pub(crate) mod kernels;
mod tets;

pub use tets::{ENERGY_FLOPS, LINEARIZE_FLOPS, PRODUCT_FLOPS, QuadraticTet, QuadraticTets};
