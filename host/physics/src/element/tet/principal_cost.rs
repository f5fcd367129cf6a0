//! The operations and bytes of the kernels of tetrahedra of an isotropic law, counted by hand. `tests/element_cost.rs`
//! counts the operations again.

use super::hooke_cost::CountedCell;
use super::principal::PrincipalTets;
use crate::cost::Cost;
use crate::element::kernel::Counted;
use crate::lanes::Real;
use crate::material::law::lane_law::LaneLaw;
use crate::material::law::{StVenantKirchhoff, StableNeoHookean};

/// Operations of a product at each point: change to principal axes 45, the gradient 45, the modulus 33 and its factor
/// 9, forces 45, change back 45.
const POINT_FLOPS: usize = 45 + 45 + 33 + 9 + 45 + 45;

/// Operations of a linearization at each point, without the law: `F - I` 45, the Green strain 42, one sweep over the axes,
/// stretches and left axes 139, turned gradients 45, whether the stretches are definite 14, the moduli of shears 12, forces
/// 45 and the sum of energies 1.
const POINT_LINEARIZE_FLOPS: usize = 45 + 42 + SWEEP_FLOPS + 139 + 45 + 14 + 12 + 45 + 1;

/// Operations of a sweep: the axes as a matrix 24, the strain in the axes 75, convergence 10, three angles 45, the strain
/// after each rotation 31, the axes after each rotation 36 and their normalization 13.
const SWEEP_FLOPS: usize = 24 + 75 + 10 + 45 + 31 + 36 + 13;

/// A law whose operations have been counted.
pub(super) trait CountedLaw: LaneLaw {
    /// Operations of energy and stress.
    const RESPOND_FLOPS: usize;
    /// Operations of the moduli.
    const MODULI_FLOPS: usize;
}

impl CountedLaw for StVenantKirchhoff {
    // The Green strain takes 42.
    const RESPOND_FLOPS: usize = 83 + 42;
    const MODULI_FLOPS: usize = 52;
}

impl CountedLaw for StableNeoHookean {
    // The logarithm takes 28. Its split into exponent and mantissa counts as one.
    const RESPOND_FLOPS: usize = 153 + 28;
    const MODULI_FLOPS: usize = 77;
}

impl<L: CountedLaw, T: Real, C: CountedCell<N, Q>, const N: usize, const Q: usize> Counted
    for PrincipalTets<L, T, C, N, Q>
{
    fn linearize_cost(&self) -> Option<Cost> {
        let flops =
            C::ENDS_FLOPS + Q * (POINT_LINEARIZE_FLOPS + L::RESPOND_FLOPS + L::MODULI_FLOPS);
        let cost = Cost::read(size_of_val(self.nodes.as_slice()))
            + Cost::read(size_of_val(self.rest.as_slice()))
            + Cost::update(size_of_val(self.right.as_slice()))
            + Cost::write(size_of_val(self.tangents.as_slice()))
            + Cost::flops(flops * self.places.len());
        Some(cost)
    }

    fn product_cost(&self) -> Option<Cost> {
        let flops = C::ENDS_FLOPS + Q * POINT_FLOPS;
        let cost = Cost::read(size_of_val(self.nodes.as_slice()))
            + Cost::read(size_of_val(self.tangents.as_slice()))
            + Cost::flops(flops * self.places.len());
        Some(cost)
    }
}
