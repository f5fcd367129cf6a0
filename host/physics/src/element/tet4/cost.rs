//! The operations and bytes of the kernels of `tet4`, counted by hand. `tests/element_cost.rs` counts the operations again.

use super::Tets;
use crate::cost::Cost;
use crate::element::kernel::Counted;
use crate::lanes::Real;
use crate::lanes::block::Lanes;
use crate::material::law::Frame;

/// Operations of a linearization for each element: differences 9, `F - I` 45, one Newton iteration, rotated gradients
/// and energy 215, forces 45, and their sums 18.
pub const LINEARIZE_FLOPS: usize = 9 + 45 + TURN_FLOPS + 215 + 45 + 18;

/// Operations of one Newton iteration for a rotation: rotation and strain 84, `tr S I - S`, its adjugate and
/// determinant 40, the turn 24, the product of quaternions 35 and its normalization 13.
pub const TURN_FLOPS: usize = 84 + 40 + 24 + 35 + 13;

/// Operations of a product: differences 9, their gradient 45, its symmetric part 10, the stress 6, forces 45, their
/// sums 18.
pub const PRODUCT_FLOPS: usize = 9 + 45 + 10 + 6 + 45 + 18;

/// Operations of the energy: three products of normal and three of shear components, their sums and a half, and the sum
/// over elements.
pub const ENERGY_FLOPS: usize = 13;

impl<T: Real> Counted for Tets<T> {
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
