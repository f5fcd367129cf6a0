//! Sparse Cholesky factorization of the free nodes' step matrix: a thin layer over `faer`.
//!
//! The fill-reducing order (approximate minimum degree) and the symbolic factorization are computed once
//! per topology; each factorization then only fills numbers into memory set aside for it, on one thread.
//!
//! `faer` gathers columns into dense blocks (supernodes) and works on those with the widest vector
//! instructions that the machine has, chosen when the program runs: machines round differently. Column by
//! column (simplicial) it is plain scalar code: the same bytes wherever the same program runs ([`Kernels`]).

use super::block_matrix::BlockMatrix;
use super::error::CondenseError;
use crate::Vec3;
use core::fmt;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::{LltError as Pivot, LltRegularization};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};

/// Which code factorizes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernels {
    /// The fastest that this machine has.
    #[default]
    Fastest,
    /// The same on every machine.
    Portable,
}

/// A factorization of `mass_factor M + stiffness_factor K` on the free nodes, refreshed in place.
pub struct Cholesky {
    unknowns: usize,
    /// Upper triangle by columns.
    column_start: Vec<u32>,
    row_index: Vec<u32>,
    values: Vec<f64>,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<f64>,
    scratch: MemBuffer,
    /// Right-hand sides for which `scratch` has room.
    columns: usize,
}

impl fmt::Debug for Cholesky {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Cholesky")
            .field("unknowns", &self.unknowns)
            .field("entries", &self.values.len())
            .field("factor_entries", &self.factor.len())
            .finish_non_exhaustive()
    }
}

impl Cholesky {
    /// Analyzes the pattern of `matrix` and sets memory aside, for solves of up to `columns` right-hand
    /// sides.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`] when the matrix is too large for memory or 32-bit indices.
    pub fn new(
        matrix: &BlockMatrix,
        columns: usize,
        kernels: Kernels,
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
        let failed = |reason: &dyn fmt::Debug| CondenseError::Symbolic {
            unknowns,
            reason: format!("{reason:?}"),
        };
        let pattern = SymbolicSparseColMatRef::new_checked(
            unknowns,
            unknowns,
            &column_start,
            None,
            &row_index,
        );
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: match kernels {
                Kernels::Fastest => SupernodalThreshold::FORCE_SUPERNODAL,
                Kernels::Portable => SupernodalThreshold::FORCE_SIMPLICIAL,
            },
            ..CholeskySymbolicParams::default()
        };
        let symbolic =
            factorize_symbolic_cholesky(pattern, Side::Upper, SymmetricOrdering::Amd, params)
                .map_err(|error| failed(&error))?;
        let need = StackReq::any_of(&[
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()),
            symbolic.solve_in_place_scratch::<f64>(columns.max(1), Par::Seq),
        ]);
        let scratch = MemBuffer::try_new(need).map_err(|error| failed(&error))?;
        Ok(Self {
            unknowns,
            values: vec![0.0; row_index.len()],
            factor: vec![0.0; symbolic.len_val()],
            column_start,
            row_index,
            symbolic,
            scratch,
            columns: columns.max(1),
        })
    }

    /// Number of scalar unknowns.
    pub fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// Number of entries of the factor.
    pub fn factor_entries(&self) -> usize {
        self.factor.len()
    }

    /// Factorizes `mass_factor M + stiffness_factor K`; `matrix` must have the pattern given to `new`.
    ///
    /// `mask` holds for each free node and axis 1 where it is free and 0 where it is guided: the latter are
    /// uncoupled, with 1 on the diagonal.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Topology`] when the pattern has another size, and
    /// [`CondenseError::NotPositiveDefinite`].
    pub fn factorize(
        &mut self,
        matrix: &BlockMatrix,
        mass: &[f64],
        mass_factor: f64,
        stiffness_factor: f64,
        mask: Option<&[Vec3]>,
    ) -> Result<(), CondenseError> {
        if 3 * matrix.free() != self.unknowns {
            return Err(CondenseError::Topology);
        }
        let is_guided = |node: usize, axis: usize| mask.is_some_and(|mask| mask[node][axis] == 0.0);
        let mut next = 0;
        for node in 0..matrix.free() {
            for axis in 0..3 {
                // The matrix is symmetric: row `node` read along is column `node` read down.
                for (row, block) in matrix.free_blocks(node).filter(|&(row, _)| row <= node) {
                    let end = if row == node { axis + 1 } else { 3 };
                    for i in 0..end {
                        let Some(value) = self.values.get_mut(next) else {
                            return Err(CondenseError::Topology);
                        };
                        let coupled = !is_guided(node, axis) && !is_guided(row, i);
                        *value = if coupled {
                            stiffness_factor * block[(axis, i)]
                        } else {
                            0.0
                        };
                        next += 1;
                    }
                }
                // The diagonal closes each column.
                if let Some(value) = next
                    .checked_sub(1)
                    .and_then(|last| self.values.get_mut(last))
                {
                    if is_guided(node, axis) {
                        *value = 1.0;
                    } else {
                        *value += mass_factor * mass[node];
                    }
                }
            }
        }
        if next != self.values.len() {
            return Err(CondenseError::Topology);
        }
        let pattern = SymbolicSparseColMatRef::new_checked(
            self.unknowns,
            self.unknowns,
            &self.column_start,
            None,
            &self.row_index,
        );
        let result = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            SparseColMatRef::new(pattern, &self.values),
            Side::Upper,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut self.scratch),
            Spec::default(),
        );
        match result {
            Ok(_) => Ok(()),
            Err(Pivot::NonPositivePivot { index }) => {
                Err(CondenseError::NotPositiveDefinite { pivot: index })
            }
        }
    }

    /// Solves in place for the right-hand sides in `columns`, one after the other, each with
    /// [`unknowns`](Self::unknowns) entries (x, y, z of each free node).
    ///
    /// More of them than `new` was told of are solved in several goes.
    pub fn solve(&mut self, columns: &mut [f64]) {
        if self.unknowns == 0 {
            return;
        }
        for columns in columns.chunks_mut(self.columns * self.unknowns) {
            let count = columns.len() / self.unknowns;
            let columns = &mut columns[..count * self.unknowns];
            LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(columns, self.unknowns, count),
                Par::Seq,
                MemStack::new(&mut self.scratch),
            );
        }
    }
}
