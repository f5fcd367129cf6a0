//! The operations and bytes of the kernels of `tet10`, counted by hand. `tests/element_cost.rs` counts the operations again.

use super::QuadraticTets;
use super::kernels::POINTS;
use crate::cost::Cost;
use crate::element::kernel::Counted;
use crate::element::tet4::TURN_FLOPS;
use crate::lanes::Real;
use crate::lanes::block::Lanes;
use crate::material::law::Frame;

/// Operations of a linearization for each element: differences 27, `spread` 117, at each point `F - I` 45, one Newton
/// iteration, rotated gradients and energy 215 and forces 45, then `collect` 117, and sums of forces 54.
pub const LINEARIZE_FLOPS: usize = 27 + 117 + POINTS * (45 + TURN_FLOPS + 215 + 45) + 117 + 54;

/// Operations of a product: differences 27, `spread` 117, at each point the gradient 45, its symmetric part 10, the
/// stress 6 and forces 45, then `collect` 117, and sums of forces 54.
pub const PRODUCT_FLOPS: usize = 27 + 117 + POINTS * (45 + 10 + 6 + 45) + 117 + 54;

/// Operations of the energy, at each point those of a linear tetrahedron.
pub const ENERGY_FLOPS: usize = POINTS * 13;

impl<T: Real> Counted for QuadraticTets<T> {
    fn linearize_cost(&self) -> Option<Cost> {
        if self.frame == Frame::Fixed {
            return Some(self.product_cost()? + Cost::flops(ENERGY_FLOPS * self.len()));
        }
        let ratios = self.blocks.turned.len() * size_of::<Lanes<T>>();
        let cost = Cost::read(size_of_val(self.blocks.nodes.as_slice()))
            + Cost::read(size_of_val(self.blocks.rest.as_slice()))
            + Cost::update(size_of_val(self.blocks.rotations.as_slice()))
            + Cost::write(size_of_val(self.blocks.turned.as_slice()) - ratios)
            + Cost::read(ratios)
            + Cost::flops(LINEARIZE_FLOPS * self.len());
        Some(cost)
    }

    fn product_cost(&self) -> Option<Cost> {
        let cost = Cost::read(size_of_val(self.blocks.nodes.as_slice()))
            + Cost::read(size_of_val(self.blocks.turned.as_slice()))
            + Cost::flops(PRODUCT_FLOPS * self.len());
        Some(cost)
    }
}
