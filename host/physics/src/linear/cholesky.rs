//! Sparse Cholesky factorization of the step matrix on the free nodes, in the numbering of the nodes.
//!
//! The fill-reducing order (approximate minimum degree) and the symbolic factorization are computed once per topology.
//! Each factorization then only computes numbers, in memory that was allocated before.

use super::block_matrix::BlockMatrix;
pub use super::sparse_cholesky::FactorCode;
use super::sparse_cholesky::{Elimination, SparseCholesky};
use super::step_matrix::StepMatrix;
use crate::Vec3;
use crate::error::CondenseError;

/// A factorization of `mass_factor M + stiffness_factor K` on the free nodes, refreshed in place.
#[derive(Debug)]
pub struct Cholesky {
    /// Upper triangle by columns.
    sparse: SparseCholesky,
    /// Whether the factor is that of the values.
    is_current: bool,
}

impl Cholesky {
    /// Analyzes the pattern of `matrix` and allocates the memory, for solves of up to `columns` right-hand sides at
    /// once.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`] if the matrix is too large for memory or 32-bit indices.
    pub fn new(
        matrix: &BlockMatrix,
        columns: usize,
        code: FactorCode,
    ) -> Result<Self, CondenseError> {
        let unknowns = 3 * matrix.free();
        let mut column_start = Vec::with_capacity(unknowns + 1);
        let mut row_index = Vec::new();
        column_start.push(0);
        for node in 0..matrix.free() {
            for axis in 0..3 {
                for (row, _) in matrix.free_blocks(node).filter(|&(row, _)| row <= node) {
                    let end = if row == node { axis + 1 } else { 3 };
                    row_index.extend((0..end).map(|i| (3 * row + i) as u32));
                }
                column_start.push(row_index.len() as u32);
            }
        }
        let elimination = Elimination::MinimumDegree;
        let sparse = SparseCholesky::new(column_start, row_index, elimination, code, columns)?;
        Ok(Self {
            sparse,
            is_current: false,
        })
    }

    /// Number of scalar unknowns.
    pub fn unknowns(&self) -> usize {
        self.sparse.unknowns()
    }

    /// Number of entries of the factor.
    pub fn factor_entries(&self) -> usize {
        self.sparse.numbers.len()
    }

    /// Factorizes `mass_factor M + stiffness_factor K`, unless it is the matrix of the last factor. `matrix` must have the pattern given to `new`, and `mass` (kg)
    /// has an entry for each of its nodes.
    ///
    /// `mask` has for each free node and axis 1 if the axis is free and 0 if it is guided. Guided axes are uncoupled,
    /// with 1 on the diagonal.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Topology`] if the pattern has another size, and
    /// [`CondenseError::NotPositiveDefinite`].
    pub fn factorize(
        &mut self,
        matrix: &BlockMatrix,
        mass: &[f64],
        mass_factor: f64,
        stiffness_factor: f64,
        mask: Option<&[Vec3]>,
    ) -> Result<(), CondenseError> {
        if 3 * matrix.free() != self.unknowns() {
            return Err(CondenseError::Topology);
        }
        let step = StepMatrix {
            stiffness: matrix,
            mass,
            mass_factor,
            stiffness_factor,
            mask,
        };
        let (mut next, mut is_same) = (0, self.is_current);
        self.is_current = false;
        for node in 0..matrix.free() {
            for axis in 0..3 {
                // The matrix is symmetric: row `node` is also column `node`.
                for (row, block) in matrix.free_blocks(node).filter(|&(row, _)| row <= node) {
                    let end = if row == node { axis + 1 } else { 3 };
                    for i in 0..end {
                        let Some(value) = self.sparse.values.get_mut(next) else {
                            return Err(CondenseError::Topology);
                        };
                        let entry = step.entry((node, axis), (row, i), block[(axis, i)]);
                        is_same &= *value == entry;
                        *value = entry;
                        next += 1;
                    }
                }
            }
        }
        if next != self.sparse.values.len() {
            return Err(CondenseError::Topology);
        }
        if !is_same {
            self.sparse.factorize()?;
        }
        self.is_current = true;
        Ok(())
    }

    /// Solves in place for the right-hand sides in `columns`, one after the other, each with
    /// [`unknowns`](Self::unknowns) entries (x, y, z of each free node).
    ///
    /// More right-hand sides than the `columns` given to `new` are solved in several batches.
    pub fn solve(&mut self, columns: &mut [f64]) {
        self.sparse.solve(columns);
    }
}
