//! Linear tetrahedra under Hooke's law in the vector form: `tets` stores them, `kernels` computes on their blocks, `cost`
//! counts the operations.

mod cost;
pub(crate) mod kernels;
mod tets;

pub use cost::{ENERGY_FLOPS, LINEARIZE_FLOPS, PRODUCT_FLOPS, TURN_FLOPS};
pub use tets::{Tet, Tets};

use super::kernel::Kernel;
use super::placed::Placed;
use crate::lanes::Real;
use crate::linear::block_matrix::BlockMatrix;
use crate::material::law::Frame;

/// The kernel of `tets` under Hooke's law in `frame`, whose blocks are in `matrix`.
pub(super) fn kernel<T: Real>(
    frame: Frame,
    tets: Vec<Tet>,
    matrix: &BlockMatrix,
) -> Box<dyn Kernel<T>> {
    let nodes: Vec<_> = tets.iter().map(|tet| tet.nodes).collect();
    let elements = Tets::<T>::new(tets.into_iter()).in_frame(frame);
    Box::new(Placed::new(elements, nodes.into_iter(), matrix))
}
