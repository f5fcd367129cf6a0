//! The cost of the phases of a step: bytes and operations, counted from the data. Each phase can also run alone, to be
//! timed.
//!
//! The bytes of each array are counted once for each pass that reads or writes the array. Nodes are gathered many times
//! in a pass and counted once, because the nearest cache serves the other times. Operations are additions,
//! subtractions, multiplications, divisions and roots as they are written, one each. Comparisons, changes of sign and
//! the padding of nodes are not counted. Bytes and operations over the time of a phase show what limits the phase: see S.
//! Williams, A. Waterman and D. Patterson, "Roofline: an insightful visual performance model for multicore
//! architectures" (2009).

use super::{Solved, Stepper};
use crate::cost::Cost;
use crate::element::parts::Divided;
use crate::element::precision::Precision;
use crate::error::CondenseError;
use crate::lanes::Node;
use crate::linear::vectors;

/// A phase of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Forces and tangent of all elements.
    Linearize,
    /// The stiffness times a vector.
    Product,
    /// The preconditioner: the rounding of the residual, a solve with the factor, and the product of residual and
    /// result.
    Precondition,
    /// The other operations of an iteration on whole vectors.
    Vectors,
    /// A new factor and, for a complete factor, its panels. Not every step has this phase.
    Refresh,
}

impl<T: Precision> Stepper<T> {
    /// The cost of a phase; `None` for elements without a kernel of their own, whose cost is not counted, and for the
    /// refresh while the refresher is lent.
    ///
    /// The cost of a refresh counts the factorization and the panels. The assembly of the matrix is left out: it takes
    /// some hundredths of their operations.
    #[inline(never)]
    pub fn cost(&self, phase: Phase) -> Option<Cost> {
        let node = size_of::<Node<T>>();
        let all = node * self.places.node.len();
        let free = node * self.places.free;
        match phase {
            Phase::Linearize | Phase::Product => {
                // The forces, or the result, start at zero. The vector that is multiplied is counted with the first
                // kernel.
                let mut sum = Cost::write(all) + Cost::read(all).again();
                sum.touched += all;
                for (i, set) in self.elements.sets.iter().enumerate() {
                    let own = match phase {
                        Phase::Linearize => set.linearize_cost()?,
                        _ => set.product_cost()?,
                    };
                    sum = sum + own + Cost::update(all).again();
                    if i > 0 {
                        sum = sum + Cost::read(all).again();
                    }
                }
                Some(sum)
            }
            Phase::Precondition => {
                let z = size_of::<Node<f32>>() * self.places.free;
                let ends = Cost::read(free) + Cost::read(free).again() + Cost::write(z);
                let dot = Cost::read(z).again() + Cost::flops(6 * self.places.free);
                Some(self.factor.solves.cost() + ends + dot)
            }
            Phase::Vectors => {
                let turn = Cost::read((size_of::<Node<f32>>() + size_of::<T>()) * self.places.free)
                    + Cost::update(free)
                    + Cost::write(free)
                    + Cost::flops(9 * self.places.free);
                let dot = Cost::read(2 * free).again() + Cost::flops(6 * self.places.free);
                let advance = Cost::read(2 * free).again()
                    + Cost::update(2 * free)
                    + Cost::flops(18 * self.places.free);
                Some(turn + dot + advance)
            }
            Phase::Refresh => self
                .factor
                .refresher
                .as_ref()
                .map(|refresher| refresher.cost()),
        }
    }

    /// Repeats a phase at the present state of the body. The next step is not affected.
    ///
    /// # Errors
    ///
    /// [`CondenseError::NotAssembled`] before the first step, and those of [`Refresher::work`](crate::Refresher::work).
    #[inline(never)]
    pub fn repeat(&mut self, phase: Phase) -> Result<(), CondenseError> {
        let factors = self.factor.factors.ok_or(CondenseError::NotAssembled)?;
        match phase {
            Phase::Linearize => self.elements.linearize_here(&*self.team),
            Phase::Product => {
                self.cg.q.fill([T::ZERO; 4]);
                self.elements
                    .product(&*self.team, T::of(1.0), &self.cg.u, &mut self.cg.q);
            }
            Phase::Precondition => {
                self.precondition(Solved::Step);
            }
            Phase::Vectors => {
                let free = self.places.free;
                let (p, q) = (&mut self.cg.p[..free], &mut self.cg.q[..free]);
                vectors::turn(&self.cg.z, T::ZERO, &self.cg.inertia, p, q);
                // A step of length zero. It depends on the product, so that the compiler keeps the product.
                let none = T::of(0.0 * vectors::dot(p, q).clamp(0.0, 1.0));
                vectors::advance(
                    none,
                    p,
                    q,
                    &mut self.cg.u[..free],
                    &mut self.cg.residual[..free],
                );
            }
            Phase::Refresh => self.refresh(factors)?,
        }
        Ok(())
    }

    /// Memory of the refresher (bytes); 0 while the refresher is lent.
    pub fn refresher_bytes(&self) -> usize {
        let refresher = self.factor.refresher.as_ref();
        refresher.map_or(0, |refresher| refresher.bytes())
    }

    /// Memory of the stepper (bytes): its own arrays and, unless it is lent, the refresher, without the shapes of local
    /// models.
    #[inline(never)]
    pub fn bytes(&self) -> usize {
        let (places, elements, cg) = (&self.places, &self.elements, &self.cg);
        let sets: usize = elements.sets.iter().map(Divided::bytes).sum();
        let (mask, d, force) = (&places.mask, &elements.d, &elements.force);
        let by_place = [mask, d, force, &cg.u, &cg.residual, &cg.p, &cg.q];
        let nodes: usize = by_place.iter().map(|v| size_of_val(v.as_slice())).sum();
        size_of::<Self>()
            + sets
            + self.refresher_bytes()
            + self.factor.solves.bytes()
            + nodes
            + size_of_val(self.history.as_slice())
            + size_of_val(cg.fits.as_slice())
            + size_of_val(cg.sums.as_slice())
            + size_of_val(cg.z.as_slice())
            + size_of_val(cg.inertia.as_slice())
            + size_of_val(places.mass.as_slice())
            + size_of_val(places.of.as_slice())
            + size_of_val(places.node.as_slice())
            + size_of_val(elements.at.as_slice())
            + size_of_val(places.rest.as_slice())
    }
}
