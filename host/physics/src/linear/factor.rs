//! Sparse Cholesky factorization of the step matrix on the free nodes, in a given order. `faer` computes the numbers.
//!
//! Unlike [`crate::linear::cholesky`], this factor is numbered by the places of an order that the caller gives, so
//! that [`crate::linear::panel`] can read its columns. All memory is allocated once per topology.

use super::block_matrix::BlockMatrix;
use super::order::places;
use super::sparse_cholesky::{Elimination, FactorCode, SparseCholesky};
use super::step_matrix::StepMatrix;
use super::supernodes::Supernodes;
use crate::Vec3;
use crate::cost::Cost;
use crate::error::CondenseError;
use faer::sparse::linalg::cholesky::SymbolicCholeskyRaw;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;

/// Number of right-hand sides that [`Factor::solve`] solves at once.
const COLUMNS: usize = 6;

/// The rank of a block that is not stored because it lies in the lower triangle.
const LOWER: u32 = u32::MAX;

/// A factorization of `mass_factor M + stiffness_factor K` on the free nodes, refreshed in place.
///
/// Unknown `3 p + i` is axis `i` of the node at place `p` of the order.
#[derive(Debug)]
pub struct Factor {
    order: Vec<u32>,
    places: Vec<u32>,
    supernodes: Supernodes,
    /// For each free block of the matrix, in its order of storage: the number of blocks before it in its column.
    rank: Vec<u32>,
    /// Upper triangle by columns. Rows and columns are places.
    sparse: SparseCholesky,
}

impl Factor {
    /// Analyzes the pattern of `matrix`, whose free nodes are eliminated in `order`, and allocates the memory.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Topology`] if `order` is no order of the free nodes, and
    /// [`CondenseError::Symbolic`] if the matrix is too large for memory or 32-bit indices.
    pub fn new(matrix: &BlockMatrix, order: &[u32]) -> Result<Self, CondenseError> {
        Self::with_code(matrix, order, FactorCode::Fastest)
    }

    /// [`new`](Self::new) with a choice of the code of the factorization.
    ///
    /// # Errors
    ///
    /// As `new`.
    pub fn with_code(
        matrix: &BlockMatrix,
        order: &[u32],
        code: FactorCode,
    ) -> Result<Self, CondenseError> {
        let unknowns = 3 * matrix.free();
        let mut sorted = order.to_vec();
        sorted.sort_unstable();
        if !sorted.iter().copied().eq(0..matrix.free() as u32) {
            return Err(CondenseError::Topology);
        }
        let places = places(order);
        let mut column_start = Vec::with_capacity(unknowns + 1);
        let mut row_index = Vec::new();
        let mut rank = Vec::with_capacity(matrix.block_count());
        let mut upper = Vec::new();
        column_start.push(0);
        for (place, &node) in order.iter().enumerate() {
            let rows = matrix.free_blocks(node as usize);
            upper.clear();
            upper.extend(
                rows.map(|(row, _)| places[row])
                    .filter(|&row| row as usize <= place),
            );
            upper.sort_unstable();
            for axis in 0..3 {
                for &row in &upper {
                    let end = if row as usize == place { axis + 1 } else { 3 };
                    row_index.extend((0..end).map(|i| 3 * row + i));
                }
                column_start.push(row_index.len() as u32);
            }
        }
        for node in 0..matrix.free() {
            // The first of the node's three columns contains all blocks of the column, the diagonal block in part.
            let start = column_start[3 * places[node] as usize] as usize;
            let end = column_start[3 * places[node] as usize + 1] as usize;
            for (row, _) in matrix.free_blocks(node) {
                let found = row_index[start..end].binary_search(&(3 * places[row]));
                rank.push(found.map_or(LOWER, |at| (at / 3) as u32));
            }
        }
        let elimination = Elimination::AsNumbered;
        Ok(Self {
            order: order.to_vec(),
            supernodes: Supernodes::new(matrix, order),
            places,
            rank,
            sparse: SparseCholesky::new(column_start, row_index, elimination, code, COLUMNS)?,
        })
    }

    /// Number of scalar unknowns.
    pub fn unknowns(&self) -> usize {
        3 * self.order.len()
    }

    /// Number of entries that the factor stores.
    pub fn factor_entries(&self) -> usize {
        self.sparse.numbers.len()
    }

    /// The cost of a factorization. A column of `l` entries costs a root, `l - 1` divisions and `l (l - 1)` operations
    /// of its updates of later columns. The numbers count as written once; a blocked algorithm may access them more
    /// often.
    pub(crate) fn cost(&self) -> Cost {
        let mut length = vec![0; self.unknowns()];
        self.columns(0..self.unknowns(), |column, _, values| {
            length[column] += values.len();
        });
        let [values, rows, numbers] = self.sparse.parts();
        Cost::update(values)
            + Cost::read(rows)
            + Cost::read(size_of_val(self.rank.as_slice()))
            + Cost::write(numbers)
            + Cost::flops(length.iter().map(|l| l * l).sum())
    }

    /// Memory of the factor (bytes), with the pattern and the workspace of `faer`.
    pub fn bytes(&self) -> usize {
        self.sparse.bytes()
            + self.supernodes.bytes()
            + size_of_val(self.order.as_slice())
            + size_of_val(self.places.as_slice())
            + size_of_val(self.rank.as_slice())
    }

    /// The free node at each place.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The place of each free node.
    pub fn places(&self) -> &[u32] {
        &self.places
    }

    /// The supernodes of the factor, merged if the merging makes panels faster. (`faer` has supernodes of its own.)
    pub fn supernodes(&self) -> &Supernodes {
        &self.supernodes
    }

    /// Factorizes `mass_factor M + stiffness_factor K`. `matrix` must have the pattern given to `new`, and `mass` (kg)
    /// has an entry for each of its nodes.
    ///
    /// `mask` has for each free node and axis 1 if the axis is free and 0 if it is guided. Guided axes are uncoupled,
    /// with 1 on the diagonal. After an error the factor is invalid until a factorization succeeds.
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
        let step = StepMatrix {
            stiffness: matrix,
            mass,
            mass_factor,
            stiffness_factor,
            mask,
        };
        self.gather(&step).ok_or(CondenseError::Topology)?;
        self.sparse.factorize()
    }

    /// Writes the upper triangle by columns; `None` if the pattern is another.
    fn gather(&mut self, step: &StepMatrix<'_>) -> Option<()> {
        let matrix = step.stiffness;
        if matrix.free() != self.order.len() || !step.is_whole() {
            return None;
        }
        let mut ranks = self.rank.iter();
        for node in 0..matrix.free() {
            let place = self.places[node] as usize;
            for (row, block) in matrix.free_blocks(node) {
                let &rank = ranks.next()?;
                if rank == LOWER {
                    continue;
                }
                for axis in 0..3 {
                    // The matrix is symmetric: row `node` is also column `node`.
                    let start =
                        self.sparse.column_start[3 * place + axis] as usize + 3 * rank as usize;
                    let end = if row == node { axis + 1 } else { 3 };
                    let column = self.sparse.values.get_mut(start..start + end)?;
                    for (i, value) in column.iter_mut().enumerate() {
                        *value = step.entry((node, axis), (row, i), block[(axis, i)]);
                    }
                }
            }
        }
        ranks.next().is_none().then_some(())
    }

    /// Solves in place for the right-hand sides in `columns`, one after the other, each with
    /// [`unknowns`](Self::unknowns) entries (x, y, z of the node at each place).
    pub fn solve(&mut self, columns: &mut [f64]) {
        self.sparse.solve(columns);
    }

    /// Passes the column of each unknown in `range`, ascending, to `piece`, in pieces: the number of the column, the
    /// rows of the piece (ascending) and their values, from the diagonal down.
    pub(crate) fn columns(
        &self,
        range: core::ops::Range<usize>,
        mut piece: impl FnMut(usize, Rows<'_>, &[f64]),
    ) {
        match self.sparse.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(symbolic) => {
                for column in range {
                    let start = symbolic.col_ptr()[column] as usize;
                    let end = symbolic.col_ptr()[column + 1] as usize;
                    let rows = Rows::Listed(&symbolic.row_idx()[start..end]);
                    piece(column, rows, &self.sparse.numbers[start..end]);
                }
            }
            SymbolicCholeskyRaw::Supernodal(symbolic) => {
                let ends = symbolic.supernode_end();
                let mut index = ends.partition_point(|&end| end as usize <= range.start);
                let factor = SupernodalLltRef::new(symbolic, &self.sparse.numbers);
                for column in range {
                    if ends[index] as usize <= column {
                        index += 1;
                    }
                    let supernode = factor.supernode(index);
                    let (first, end) = (supernode.start(), ends[index] as usize);
                    let Some(values) = supernode.val().col(column - first).try_as_col_major()
                    else {
                        continue;
                    };
                    let (own, below) = values.as_slice().split_at(end - first);
                    piece(column, Rows::From(column as u32), &own[column - first..]);
                    piece(column, Rows::Listed(supernode.pattern()), below);
                }
            }
        }
    }
}

/// Rows of a piece of a column.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Rows<'a> {
    /// Consecutive rows from this one on.
    From(u32),
    /// These rows, ascending.
    Listed(&'a [u32]),
}
