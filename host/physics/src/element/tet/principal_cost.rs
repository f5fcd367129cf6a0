//! The operations and bytes of a product with tetrahedra of an isotropic law, counted by hand. Linearizations have not
//! been counted.

use super::principal::PrincipalTets;
use super::principal_kernels::{Cell, Four, Ten};
use crate::cost::Cost;
use crate::element::kernel::Counted;
use crate::lanes::Real;

/// Operations of a product at each point: change to principal axes 45, the gradient 45, the modulus 33 and its factor
/// 9, forces 45, change back 45.
const POINT_FLOPS: usize = 45 + 45 + 33 + 9 + 45 + 45;

/// A cell whose operations have been counted.
trait CountedCell<const N: usize, const Q: usize>: Cell<N, Q> {
    /// Operations of `spread`, `collect` and of the sums on both sides.
    const ENDS_FLOPS: usize;
}

impl CountedCell<4, 1> for Four {
    const ENDS_FLOPS: usize = 9 + 18;
}

impl CountedCell<10, 4> for Ten {
    const ENDS_FLOPS: usize = 27 + 117 + 117 + 54;
}

impl<T: Real, C: CountedCell<N, Q>, const N: usize, const Q: usize> Counted
    for PrincipalTets<T, C, N, Q>
{
    fn linearize_cost(&self) -> Option<Cost> {
        None
    }

    fn product_cost(&self) -> Option<Cost> {
        let flops = C::ENDS_FLOPS + Q * POINT_FLOPS;
        let cost = Cost::read(size_of_val(self.nodes.as_slice()))
            + Cost::read(size_of_val(self.tangents.as_slice()))
            + Cost::flops(flops * self.places.len());
        Some(cost)
    }
}
