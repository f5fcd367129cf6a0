//! The kernel of elements that have none for vector instructions: their assembled matrix.

use super::elements::Elements;
use super::kernel::{Counted, Kernel};
use crate::Vec3;
use crate::cost::Cost;
use crate::lanes::{Node, Real, add, to_node, to_vec};
use crate::linear::block_matrix::BlockMatrix;
use crate::material::Tangent;

/// Elements with their assembled matrix.
#[derive(Debug)]
pub(super) struct Assembled {
    elements: Box<dyn Elements>,
    matrix: BlockMatrix,
    rest: Vec<Vec3>,
    x: Vec<Vec3>,
    force: Vec<Vec3>,
}

impl Assembled {
    /// A kernel of `elements`, whose nodes are in the solver's order and which are bound to `matrix`. `rest` contains
    /// the rest positions of the nodes (m).
    pub(super) fn new(elements: Box<dyn Elements>, matrix: &BlockMatrix, rest: &[Vec3]) -> Self {
        Self {
            elements,
            matrix: matrix.clone(),
            rest: rest.to_vec(),
            x: rest.to_vec(),
            force: vec![Vec3::zeros(); rest.len()],
        }
    }
}

impl<T: Real> Kernel<T> for Assembled {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        for ((x, rest), d) in self.x.iter_mut().zip(&self.rest).zip(d) {
            *x = rest + to_vec(d);
        }
        self.matrix.clear();
        self.force.fill(Vec3::zeros());
        self.elements
            .assemble(&self.x, Tangent::Clipped, &mut self.force, &mut self.matrix);
        for (sum, force) in force.iter_mut().zip(&self.force) {
            add(sum, &to_node(force));
        }
        self.elements.energy(&self.x)
    }

    fn product(&mut self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        for (row, y) in y.iter_mut().enumerate() {
            let mut sum = [T::ZERO; 3];
            for (column, block) in self.matrix.blocks(row) {
                let (b, u) = (&block.data.0, &u[column]);
                for i in 0..3 {
                    sum[i] += T::of(b[0][i]) * u[0] + T::of(b[1][i]) * u[1] + T::of(b[2][i]) * u[2];
                }
            }
            for i in 0..3 {
                y[i] += factor * sum[i];
            }
        }
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        matrix.add_all(&self.matrix);
    }

    fn bytes(&self) -> usize {
        self.elements.bytes()
            + self.matrix.bytes()
            + size_of_val(self.rest.as_slice())
            + size_of_val(self.x.as_slice())
            + size_of_val(self.force.as_slice())
    }
}

impl Counted for Assembled {
    fn linearize_cost(&self) -> Option<Cost> {
        None
    }

    fn product_cost(&self) -> Option<Cost> {
        // A product and a sum for each entry, and a further product and sum for each row.
        let (nodes, blocks) = (self.matrix.nodes(), self.matrix.block_count());
        Some(Cost::read(self.matrix.bytes()) + Cost::flops(18 * blocks + 6 * nodes))
    }
}
