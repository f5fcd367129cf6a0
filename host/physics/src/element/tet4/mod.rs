//! Linear tetrahedra under Hooke's law in vectors: `tets` holds them, `kernels` computes on a block of them.

pub(crate) mod kernels;
mod tets;

pub use tets::{ENERGY_FLOPS, LINEARIZE_FLOPS, PRODUCT_FLOPS, TURN_FLOPS, Tet, Tets};
