//! What a step needs of a set of elements, on padded nodes.
//!
//! A kernel is linearized once a step and then multiplied by as often as the solver asks: nothing is assembled
//! unless a factor is to be made. [`Assembled`] serves elements that have no kernel of their own.

use super::tet::Tets;
use super::{Node, Real};
use crate::Vec3;
use crate::fem::{BlockMatrix, Elements, Tangent};
use core::fmt;

/// A set of elements, linearized where it was last told to be.
pub(crate) trait Kernel<T>: fmt::Debug + Send {
    /// Adds the elastic forces (N) at displacements `d` (m) to `force` and keeps the tangent there. Returns the
    /// elastic energy (J).
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64;

    /// Adds `factor K u` to `y`.
    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]);

    /// Adds the blocks of `K` to `matrix`.
    fn add_to(&self, matrix: &mut BlockMatrix);
}

impl<T: Real> Kernel<T> for Tets<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        Tets::linearize(self, d, force).to_f64()
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        Tets::product(self, factor, u, y);
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        for element in 0..self.len() {
            let (nodes, blocks) = (self.nodes(element), self.stiffness(element));
            for (row, blocks) in nodes.into_iter().zip(&blocks) {
                for (column, block) in nodes.into_iter().zip(blocks) {
                    if let Some(slot) = matrix.slot(row, column) {
                        matrix.add(slot, block);
                    }
                }
            }
        }
    }
}

/// Elements by their assembled matrix.
#[derive(Debug)]
pub(crate) struct Assembled {
    elements: Box<dyn Elements>,
    matrix: BlockMatrix,
    rest: Vec<Vec3>,
    x: Vec<Vec3>,
    force: Vec<Vec3>,
}

impl Assembled {
    /// `elements` over nodes in the solver's order and bound to `matrix`; `rest` are their positions (m).
    pub(crate) fn new(elements: Box<dyn Elements>, matrix: &BlockMatrix, rest: &[Vec3]) -> Self {
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
            *x = rest + super::to_vec(d);
        }
        self.matrix.clear();
        self.force.fill(Vec3::zeros());
        self.elements
            .assemble(&self.x, Tangent::Clipped, &mut self.force, &mut self.matrix);
        for (sum, force) in force.iter_mut().zip(&self.force) {
            super::add(sum, &super::to_node(force));
        }
        self.elements.energy(&self.x)
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
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
}

/// A constant matrix of scalars: the bending of a sheet that is flat at rest.
#[derive(Debug)]
pub(crate) struct ScalarMatrix<T> {
    row_start: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<T>,
    exact: Vec<f64>,
}

impl<T: Real> ScalarMatrix<T> {
    /// `weights` by slot of `matrix`, whose pattern it takes; zeros are left out.
    pub(crate) fn new(matrix: &BlockMatrix, weights: &[f64]) -> Self {
        let mut row_start = vec![0];
        let (mut columns, mut kept) = (Vec::new(), Vec::new());
        for row in 0..matrix.nodes() {
            let (in_row, first) = matrix.row(row);
            for (offset, &column) in in_row.iter().enumerate() {
                if weights[first + offset] != 0.0 {
                    columns.push(column);
                    kept.push(T::of(weights[first + offset]));
                }
            }
            row_start.push(columns.len() as u32);
        }
        Self {
            row_start,
            columns,
            weights: kept,
            exact: weights.to_vec(),
        }
    }

    /// Row `row` times `u`.
    #[inline]
    fn row(&self, row: usize, u: &[Node<T>]) -> Node<T> {
        let range = self.row_start[row] as usize..self.row_start[row + 1] as usize;
        let mut sum = [T::ZERO; 4];
        for (&column, &weight) in self.columns[range.clone()].iter().zip(&self.weights[range]) {
            let u = &u[column as usize];
            for i in 0..4 {
                sum[i] += weight * u[i];
            }
        }
        sum
    }
}

impl<T: Real> Kernel<T> for ScalarMatrix<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        let mut energy = 0.0;
        for (row, force) in force.iter_mut().enumerate() {
            let pull = self.row(row, d);
            for i in 0..3 {
                force[i] -= pull[i];
            }
            energy += super::dot(&pull, &d[row]).to_f64();
        }
        0.5 * energy
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        for (row, y) in y.iter_mut().enumerate() {
            let pull = self.row(row, u);
            for i in 0..3 {
                y[i] += factor * pull[i];
            }
        }
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        matrix.add_scalar(&self.exact);
    }
}
