//! The interface of a set of elements to the realtime step, on padded nodes.
//!
//! A step linearizes a kernel once. The solver then calls its product repeatedly. A matrix is assembled only for a
//! factorization.

use super::Torn;
use crate::Mat3;
use crate::cost::Cost;
use crate::lanes::Node;
use crate::linear::block_matrix::BlockMatrix;
use core::fmt;

/// A set of elements with its latest linearization.
pub(crate) trait Kernel<T>: Counted + fmt::Debug + Send {
    /// Adds the elastic forces (N) at displacements `d` (m) to `force` and stores the tangent at `d`. Returns the
    /// elastic energy (J).
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64;

    /// Adds `factor K u` to `y`.
    fn product(&mut self, factor: T, u: &[Node<T>], y: &mut [Node<T>]);

    /// Adds the blocks of `K` to `matrix`.
    fn add_to(&self, matrix: &mut BlockMatrix);

    /// Memory of the kernel (bytes).
    fn bytes(&self) -> usize;

    /// Makes room for `triangles` more triangles, so that [`follow`](Self::follow) allocates nothing. The result is `false`
    /// if the kernel cannot follow edits.
    #[allow(dead_code, reason = "the stepper of a torn sheet calls it")]
    fn reserve(&mut self, _triangles: usize) -> bool {
        false
    }

    /// Follows the latest edit of a torn surface. Products use the tangent of the next linearization. From then on
    /// [`add_to`](Self::add_to) adds nothing of the set: a new factor is made from kernels of the torn sheet.
    #[allow(dead_code, reason = "the stepper of a torn sheet calls it")]
    fn follow(&mut self, _torn: &Torn<'_>) {}

    /// Calls `add` with the blocks (N/m) of the tangent of `triangles` at displacements `d` (m), by row and column.
    #[allow(dead_code, reason = "the stepper of a torn sheet calls it")]
    fn local_stiffness(
        &self,
        _triangles: &[u32],
        _d: &[Node<T>],
        _add: &mut dyn FnMut(u32, u32, &Mat3),
    ) {
    }
}

/// What the two computations of a kernel cost, for reports and benchmarks. Each element states its counts in a file of
/// their own, beside its kernel.
pub(crate) trait Counted {
    /// The cost of `linearize` without displacements and forces, or `None` if it has not been counted.
    fn linearize_cost(&self) -> Option<Cost>;

    /// The cost of `product` without the vectors, or `None` if it has not been counted.
    fn product_cost(&self) -> Option<Cost>;
}
