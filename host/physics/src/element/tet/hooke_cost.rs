//! The operations and bytes of the kernels of tetrahedra under Hooke's law, counted by hand. `tests/element_cost.rs`
//! counts the operations again.

use super::cell::{Cell, Four, Ten};
use super::hooke::HookeanTets;
use crate::cost::Cost;
use crate::element::kernel::Counted;
use crate::lanes::Real;
use crate::lanes::block::Lanes;
use crate::material::law::Frame;

/// Operations of a linearization at each point: `F - I` 45, one Newton iteration, rotated gradients and energy 215, and
/// forces 45.
pub const POINT_LINEARIZE_FLOPS: usize = 45 + TURN_FLOPS + 215 + 45;

/// Operations of one Newton iteration for a rotation: rotation and strain 84, `tr S I - S`, its adjugate and
/// determinant 40, the turn 24, the product of quaternions 35 and its normalization 13.
pub const TURN_FLOPS: usize = 84 + 40 + 24 + 35 + 13;

/// Operations of a product at each point: the gradient 45, its symmetric part 10, the stress 6, and forces 45.
pub const POINT_PRODUCT_FLOPS: usize = 45 + 10 + 6 + 45;

/// Operations of the energy at each point: three products of normal and three of shear components, their sums and a
/// half, and the sum over elements.
pub const POINT_ENERGY_FLOPS: usize = 13;

/// Operations of a linear tetrahedron on both sides of its point: differences 9, and sums of forces 18.
pub const LINEAR_ENDS_FLOPS: usize = 9 + 18;

/// Operations of a quadratic tetrahedron on both sides of its points: differences 27, `spread` 117, `collect` 117, and
/// sums of forces 54.
pub const QUADRATIC_ENDS_FLOPS: usize = 27 + 117 + 117 + 54;

/// A cell whose operations have been counted.
pub(crate) trait CountedCell<const N: usize, const Q: usize>: Cell<N, Q> {
    /// Operations of `spread` and `collect`.
    const ENDS_FLOPS: usize;
}

impl CountedCell<4, 1> for Four {
    const ENDS_FLOPS: usize = LINEAR_ENDS_FLOPS;
}

impl CountedCell<10, 4> for Ten {
    const ENDS_FLOPS: usize = QUADRATIC_ENDS_FLOPS;
}

impl<T: Real, C: CountedCell<N, Q>, const N: usize, const Q: usize> Counted
    for HookeanTets<T, C, N, Q>
{
    fn linearize_cost(&self) -> Option<Cost> {
        if self.frame == Frame::Fixed {
            let energy = Q * POINT_ENERGY_FLOPS * self.count();
            return Some(self.product_cost()? + Cost::flops(energy));
        }
        let ratios = self.blocks.turned.len() * size_of::<Lanes<T>>();
        let flops = C::ENDS_FLOPS + Q * POINT_LINEARIZE_FLOPS;
        let cost = Cost::read(size_of_val(self.blocks.nodes.as_slice()))
            + Cost::read(size_of_val(self.blocks.rest.as_slice()))
            + Cost::update(size_of_val(self.blocks.rotations.as_slice()))
            + Cost::write(size_of_val(self.blocks.turned.as_slice()) - ratios)
            + Cost::read(ratios)
            + Cost::flops(flops * self.count());
        Some(cost)
    }

    fn product_cost(&self) -> Option<Cost> {
        let flops = C::ENDS_FLOPS + Q * POINT_PRODUCT_FLOPS;
        let cost = Cost::read(size_of_val(self.blocks.nodes.as_slice()))
            + Cost::read(size_of_val(self.blocks.turned.as_slice()))
            + Cost::flops(flops * self.count());
        Some(cost)
    }
}
