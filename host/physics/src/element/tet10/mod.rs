//! Quadratic tetrahedra under Hooke's law in the vector form: `tets` stores them, `kernels` computes on their blocks,
//! `cost` counts the operations.

mod cost;
pub(crate) mod kernels;
mod tets;

pub use cost::{ENERGY_FLOPS, LINEARIZE_FLOPS, PRODUCT_FLOPS};
pub use tets::{QuadraticTet, QuadraticTets};

use super::kernel::Kernel;
use super::placed::Placed;
use crate::lanes::Real;
use crate::linear::block_matrix::BlockMatrix;
use crate::material::law::Frame;

/// The kernel of `tets` under Hooke's law in `frame`, whose blocks are in `matrix`.
pub(super) fn kernel<T: Real>(
    frame: Frame,
    tets: &[QuadraticTet],
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>> {
    let elements = QuadraticTets::<T>::new(tets).in_frame(frame);
    Box::new(Placed::new(
        elements,
        tets.iter().map(|tet| tet.nodes),
        matrix,
    ))
}
