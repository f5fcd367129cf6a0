//! Bending on padded nodes: a constant sparse matrix of scalars.

use crate::element::kernel::Kernel;
use crate::lanes::block::{less, plus};
use crate::lanes::{self, Node, Real};
use crate::linear::block_matrix::BlockMatrix;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// A constant matrix of scalars: the bending of a sheet that is flat at rest.
#[derive(Debug)]
pub(crate) struct ScalarMatrix<T> {
    pub(super) row_start: Vec<u32>,
    pub(super) columns: Vec<u32>,
    pub(super) weights: Vec<T>,
    exact: Vec<f64>,
}

impl<T: Real> ScalarMatrix<T> {
    /// The matrix with these `weights` by slot of `matrix`, in the pattern of `matrix` without zeros.
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

    /// Calls `sum(row, product)` with the product of each row and `u`.
    #[inline(always)]
    fn rows(&self, u: &[Node<T>], mut sum: impl FnMut(usize, Node<T>)) {
        let ends = self.row_start[1..].iter().map(|&end| end as usize);
        let mut start = 0;
        for (row, end) in ends.enumerate() {
            let mut pull = [T::ZERO; 4];
            let entries = self.columns[start..end]
                .iter()
                .zip(&self.weights[start..end]);
            for (&column, &weight) in entries {
                let u = &u[column as usize];
                for i in 0..4 {
                    pull[i] += weight * u[i];
                }
            }
            sum(row, pull);
            start = end;
        }
    }
}

/// Subtracts the product with `d` from `force`. Returns twice the energy.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx2+bmi1+bmi2"))
)]
fn scalar_linearize<T: Real>(
    matrix: &ScalarMatrix<T>,
    d: &[Node<T>],
    force: &mut [Node<T>],
) -> f64 {
    let mut work = 0.0;
    matrix.rows(d, |row, pull| {
        force[row] = less(force[row], pull);
        work += lanes::dot(&pull, &d[row]).to_f64();
    });
    work
}

/// Adds `factor` times the product with `u` to `y`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx2+bmi1+bmi2"))
)]
fn scalar_product<T: Real>(matrix: &ScalarMatrix<T>, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
    matrix.rows(u, |row, pull| {
        y[row] = plus(y[row], pull.map(|pull| factor * pull));
    });
}

impl<T: Real> Kernel<T> for ScalarMatrix<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        0.5 * scalar_linearize(self, d, force)
    }

    fn product(&self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        scalar_product(self, factor, u, y);
    }

    fn add_to(&self, matrix: &mut BlockMatrix) {
        matrix.add_scalar(&self.exact);
    }

    fn bytes(&self) -> usize {
        size_of_val(self.row_start.as_slice())
            + size_of_val(self.columns.as_slice())
            + size_of_val(self.weights.as_slice())
            + size_of_val(self.exact.as_slice())
    }
}
