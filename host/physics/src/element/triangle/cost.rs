//! The operations and bytes of the kernels of triangles, counted by hand. `tests/element_cost.rs` counts the operations
//! again.

use super::triangles::Triangles;
use crate::cost::Cost;
use crate::element::kernel::Counted;
use crate::lanes::Real;

/// Operations of a linearization for each element: differences 6, `F - I` 18, the polar decomposition 147, stress,
/// energy and forces 45, the tangent in the plane and out of it 216, and the sums of forces 12.
pub const LINEARIZE_FLOPS: usize = 6 + 18 + 147 + 45 + 216 + 12;

/// Operations of a product: differences 6, their scaling 6, the product with a symmetric 6 x 6 matrix 66, and the sums
/// of forces 12.
pub const PRODUCT_FLOPS: usize = 6 + 6 + 66 + 12;

impl<T: Real> Counted for Triangles<T> {
    fn linearize_cost(&self) -> Option<Cost> {
        let cost = Cost::read(size_of_val(self.blocks.nodes.as_slice()))
            + Cost::read(size_of_val(self.blocks.rest.as_slice()))
            + Cost::write(size_of_val(self.blocks.stiffness.as_slice()))
            + Cost::flops(LINEARIZE_FLOPS * self.count());
        Some(cost)
    }

    fn product_cost(&self) -> Option<Cost> {
        let cost = Cost::read(size_of_val(self.blocks.nodes.as_slice()))
            + Cost::read(size_of_val(self.blocks.stiffness.as_slice()))
            + Cost::flops(PRODUCT_FLOPS * self.count());
        Some(cost)
    }
}
