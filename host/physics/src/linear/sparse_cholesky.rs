//! Sparse Cholesky factorization on the upper triangle of a matrix by columns: a thin layer over `faer`.
//!
//! The symbolic factorization is computed once per pattern. Each factorization then only computes numbers, on one
//! thread, in memory that was allocated before.
//!
//! `faer` groups columns into dense blocks (supernodes). It selects the widest vector instructions of the machine at
//! run time, so machines round differently. Its factorization column by column (simplicial) is plain scalar code. The
//! same program then gives the same bytes on every machine ([`FactorCode`]).

use crate::error::CondenseError;
use core::fmt;
use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::{LltError as Pivot, LltRegularization};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};

/// The code of the sparse factorization.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FactorCode {
    /// The fastest code on this machine. Its rounding depends on the machine.
    #[default]
    Fastest,
    /// Scalar code with the same rounding on every machine.
    Portable,
}

/// The order in which unknowns are eliminated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Elimination {
    /// A fill-reducing order by approximate minimum degree.
    MinimumDegree,
    /// The order of the numbers of the unknowns.
    AsNumbered,
}

/// The upper triangle of a matrix by columns, and its factor.
pub(crate) struct SparseCholesky {
    pub(crate) column_start: Vec<u32>,
    row_index: Vec<u32>,
    /// Entries of the upper triangle. The caller sets them before [`factorize`](Self::factorize).
    pub(crate) values: Vec<f64>,
    pub(crate) symbolic: SymbolicCholesky<u32>,
    pub(crate) numbers: Vec<f64>,
    scratch: MemBuffer,
    /// Number of right-hand sides for which `scratch` has room.
    columns: usize,
}

impl fmt::Debug for SparseCholesky {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SparseCholesky")
            .field("unknowns", &self.unknowns())
            .field("entries", &self.values.len())
            .field("factor_entries", &self.numbers.len())
            .finish_non_exhaustive()
    }
}

impl SparseCholesky {
    /// Analyzes a pattern and allocates the memory, for solves of up to `columns` right-hand sides at once. The rows of
    /// each column ascend and end with the diagonal.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`] if the matrix is too large for memory or 32-bit indices.
    pub(crate) fn new(
        column_start: Vec<u32>,
        row_index: Vec<u32>,
        elimination: Elimination,
        code: FactorCode,
        columns: usize,
    ) -> Result<Self, CondenseError> {
        let unknowns = column_start.len() - 1;
        let failed = |reason: &dyn fmt::Debug| CondenseError::Symbolic {
            unknowns,
            reason: format!("{reason:?}"),
        };
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: match code {
                FactorCode::Fastest => SupernodalThreshold::FORCE_SUPERNODAL,
                FactorCode::Portable => SupernodalThreshold::FORCE_SIMPLICIAL,
            },
            ..CholeskySymbolicParams::default()
        };
        let ordering = match elimination {
            Elimination::MinimumDegree => SymmetricOrdering::Amd,
            Elimination::AsNumbered => SymmetricOrdering::Identity,
        };
        let pattern = pattern(&column_start, &row_index);
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Upper, ordering, params)
            .map_err(|error| failed(&error))?;
        let columns = columns.max(1);
        let need = StackReq::any_of(&[
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()),
            symbolic.solve_in_place_scratch::<f64>(columns, Par::Seq),
        ]);
        let scratch = MemBuffer::try_new(need).map_err(|error| failed(&error))?;
        Ok(Self {
            values: vec![0.0; row_index.len()],
            numbers: vec![0.0; symbolic.len_val()],
            column_start,
            row_index,
            symbolic,
            scratch,
            columns,
        })
    }

    /// Number of unknowns.
    pub(crate) fn unknowns(&self) -> usize {
        self.column_start.len() - 1
    }

    /// Factorizes `values`. After an error the factor is invalid until a factorization succeeds.
    ///
    /// # Errors
    ///
    /// [`CondenseError::NotPositiveDefinite`].
    pub(crate) fn factorize(&mut self) -> Result<(), CondenseError> {
        let pattern = pattern(&self.column_start, &self.row_index);
        let result = self.symbolic.factorize_numeric_llt(
            &mut self.numbers,
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

    /// Solves in place for the right-hand sides in `columns`, stored one after the other. If they are more than the
    /// workspace has room for, they are solved in several batches.
    pub(crate) fn solve(&mut self, columns: &mut [f64]) {
        let unknowns = self.unknowns();
        if unknowns == 0 {
            return;
        }
        for columns in columns.chunks_mut(self.columns * unknowns) {
            let count = columns.len() / unknowns;
            let columns = &mut columns[..count * unknowns];
            LltRef::new(&self.symbolic, &self.numbers).solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(columns, unknowns, count),
                Par::Seq,
                MemStack::new(&mut self.scratch),
            );
        }
    }

    /// Bytes of the entries of the matrix, of their rows, and of the factor's numbers.
    pub(crate) fn parts(&self) -> [usize; 3] {
        [
            size_of_val(self.values.as_slice()),
            size_of_val(self.row_index.as_slice()),
            size_of_val(self.numbers.as_slice()),
        ]
    }

    /// Memory of the factor (bytes), with the pattern and the workspace of `faer`.
    pub(crate) fn bytes(&self) -> usize {
        let pattern = match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(symbolic) => {
                size_of_val(symbolic.col_ptr()) + size_of_val(symbolic.row_idx())
            }
            SymbolicCholeskyRaw::Supernodal(symbolic) => {
                size_of_val(symbolic.supernode_begin())
                    + size_of_val(symbolic.col_ptr_for_row_idx())
                    + size_of_val(symbolic.col_ptr_for_val())
                    + size_of_val(symbolic.row_idx())
                    + size_of_val(symbolic.nnz_per_super())
            }
        };
        pattern
            + self.parts().iter().sum::<usize>()
            + size_of_val(self.column_start.as_slice())
            + size_of_val(&*self.scratch)
    }
}

fn pattern<'a>(column_start: &'a [u32], row_index: &'a [u32]) -> SymbolicSparseColMatRef<'a, u32> {
    let unknowns = column_start.len() - 1;
    SymbolicSparseColMatRef::new_checked(unknowns, unknowns, column_start, None, row_index)
}
