//! The interface of a set of elements to the realtime step, on padded nodes.
//!
//! A step linearizes a kernel once. The solver then calls its product repeatedly. A matrix is assembled only for a
//! factorization.

use super::torn::TearableKernel;
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

    /// The kernel as one of triangles that can tear, or `None` if it cannot follow edits.
    fn tearable(&mut self) -> Option<&mut dyn TearableKernel<T>> {
        None
    }
}

/// The cost of the two computations of a kernel, for reports and benchmarks. Each element states its counts in a file of
/// their own, beside its kernel.
pub(crate) trait Counted {
    /// The cost of `linearize` without displacements and forces, or `None` if it has not been counted.
    fn linearize_cost(&self) -> Option<Cost>;

    /// The cost of `product` without the vectors, or `None` if it has not been counted.
    fn product_cost(&self) -> Option<Cost>;
}
