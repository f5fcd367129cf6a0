//! The operations and bytes of the kernel of bending, against which tests count.

use super::facets::BentFacets;
use super::scalar::ScalarMatrix;
use crate::cost::Cost;
use crate::element::kernel::Counted;
use crate::lanes::{Node, Real};

/// Operations of a linearization for each triangle that is flat at rest: differences 6, sides 6, normals at
/// rest and at present and dual vectors 58; for each of the three sides the derivative 24, the slope 15, the curvature 6 and the tangent 24; then energy 7,
/// moments and forces 42, and the sums of forces 21.
const LINEARIZE_FLOPS: usize = 6 + 6 + 58 + 3 * (24 + 15 + 6 + 24) + 7 + 42 + 21;

/// Operations of a product: differences 6, the rise of the sides 12, slopes and curvature of the three sides 48, moments
/// and forces 42, and the sums of forces 21.
pub const PRODUCT_FLOPS: usize = 6 + 12 + 48 + 42 + 21;

impl<T: Real> ScalarMatrix<T> {
    /// The cost of a product, without the vectors. `each` is the number of operations for an entry.
    fn cost(&self, each: usize) -> Cost {
        Cost::read(self.bytes()) + Cost::flops(each * self.entries())
    }
}

impl<T: Real> BentFacets<T> {
    /// The cost of the derivatives across edges, with `each` operations for an entry, and of the transpose.
    fn edges_cost(&self, each: usize) -> Cost {
        let vectors = 2 * size_of::<Node<T>>() * self.plan.derivatives.rows();
        self.plan.derivatives.cost(each)
            + self.plan.back.cost(6)
            + Cost::write(vectors)
            + Cost::read(vectors).again()
    }
}

impl<T: Real> Counted for BentFacets<T> {
    fn linearize_cost(&self) -> Option<Cost> {
        let blocks = &self.plan.blocks;
        let cost = Cost::read(size_of_val(blocks.nodes.as_slice()))
            + Cost::read(size_of_val(blocks.edges.as_slice()))
            + Cost::read(size_of_val(blocks.rest.as_slice()))
            + Cost::read(size_of_val(blocks.curved.as_slice()))
            + Cost::write(size_of_val(self.state.as_slice()))
            + Cost::flops(LINEARIZE_FLOPS * self.len());
        Some(self.edges_cost(9) + cost)
    }

    fn product_cost(&self) -> Option<Cost> {
        let blocks = &self.plan.blocks;
        let weights = size_of_val(blocks.rest.as_slice()) * 9 / 21;
        let cost = Cost::read(size_of_val(blocks.nodes.as_slice()))
            + Cost::read(size_of_val(blocks.edges.as_slice()))
            + Cost::read(weights)
            + Cost::read(size_of_val(self.state.as_slice()))
            + Cost::flops(PRODUCT_FLOPS * self.len());
        Some(self.edges_cost(6) + cost)
    }
}
