//! The kernel of elements in blocks: elements that compute with vector instructions, and the slots of their stiffness.

use super::elements::slots;
use super::kernel::{Counted, Kernel};
use super::torn::TearableKernel;
use crate::Mat3;
use crate::cost::Cost;
use crate::lanes::{Node, Real};
use crate::linear::block_matrix::{BlockMatrix, ElementSlots};
use core::fmt;

/// Elements of `N` nodes in blocks. The functions are those of [`Kernel`], but for the stiffness, which is that of one
/// element.
pub(crate) trait InBlocks<T, const N: usize>: fmt::Debug + Send {
    /// Adds the elastic forces (N) at displacements `d` (m) to `force` and stores the tangent at `d`. Returns the
    /// elastic energy (J).
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64;

    /// Adds `factor` times the latest stiffness times `u` to `y`.
    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]);

    /// The 3 x 3 blocks of an element's latest stiffness (N/m), by its nodes.
    fn stiffness(&self, element: usize) -> [[Mat3; N]; N];

    /// Memory of the elements (bytes).
    fn bytes(&self) -> usize;

    /// See [`Kernel::tearable`].
    fn tearable(&mut self) -> Option<&mut dyn TearableKernel<T>> {
        None
    }
}

/// Elements in blocks, and the slots of the blocks of their stiffness in the matrix.
#[derive(Debug)]
pub(crate) struct Placed<E, const N: usize> {
    elements: E,
    slots: Vec<ElementSlots<N>>,
}

impl<E, const N: usize> Placed<E, N> {
    /// `elements` with these `nodes`, element by element, and their slots in `matrix`.
    pub(crate) fn new(
        elements: E,
        nodes: impl Iterator<Item = [u32; N]>,
        matrix: &BlockMatrix,
    ) -> Self {
        Self {
            elements,
            slots: slots(nodes, matrix),
        }
    }
}

impl<T: Real, E: InBlocks<T, N> + Counted, const N: usize> Kernel<T> for Placed<E, N> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        self.elements.linearize(d, force)
    }

    fn product(&mut self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        self.elements.product(factor, u, y);
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        for (element, slots) in self.slots.iter().enumerate() {
            let blocks = self.elements.stiffness(element);
            for (slots, blocks) in slots.iter().zip(&blocks) {
                for (&slot, block) in slots.iter().zip(blocks) {
                    matrix.add(slot, block);
                }
            }
        }
    }

    fn bytes(&self) -> usize {
        self.elements.bytes() + size_of_val(self.slots.as_slice())
    }

    fn tearable(&mut self) -> Option<&mut dyn TearableKernel<T>> {
        self.elements.tearable()
    }
}

impl<E: Counted, const N: usize> Counted for Placed<E, N> {
    fn linearize_cost(&self) -> Option<Cost> {
        self.elements.linearize_cost()
    }

    fn product_cost(&self) -> Option<Cost> {
        self.elements.product_cost()
    }
}
