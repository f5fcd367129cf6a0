//! Incomplete Cholesky factorization on 3 x 3 blocks with the pattern of the matrix.
//!
//! `A ~ L L^T`, where `L` has blocks only where `A` has (J. A. Meijerink and H. A. van der Vorst, "An iterative
//! solution method for linear systems of which the coefficient matrix is a symmetric M-matrix", 1977). The step matrix
//! is no M-matrix, so a pivot may be too small. The diagonal blocks are then enlarged step by step until all pivots are
//! large enough (T. A. Manteuffel, "An incomplete factorization technique for positive definite linear systems", 1980).
//!
//! The factor is stored in f32, which suffices for the preconditioner of an iteration in f64. Sums are in f64.

use super::sweep;
use crate::cost::Cost;
use crate::error::CondenseError;
use crate::lanes::Node;
use crate::linear::block_matrix::BlockMatrix;
use crate::linear::read_ahead::{self, Share};
use crate::linear::step_matrix::StepMatrix;
use crate::{Mat3, Vec3};

/// Numbers of a block.
pub(crate) const BLOCK: usize = 9;

/// Numbers past the end of the last block. A row of a block is read as four numbers, of which the last is not used.
pub(crate) const PADDING: usize = 3;

/// The least ratio of a pivot after elimination to the pivot of the diagonal block alone. Below it, rounding and
/// dropped fill dominate the pivot.
const LEAST_PIVOT: f64 = 1e-4;

/// The first fraction by which diagonal blocks are enlarged. It doubles from attempt to attempt.
const FIRST_SHIFT: f64 = 1e-3;

/// The last fraction. With it, every diagonal block is many times as large as the terms that elimination subtracts, for
/// a positive definite matrix with some tens of neighbours to a node.
const LAST_SHIFT: f64 = 1e3;

/// The factor: rows of blocks, each row's last the inverse of its diagonal block.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// One past the last index into `columns` of each row.
    row_end: Vec<u32>,
    /// Columns before the diagonal, by rows, ascending.
    columns: Vec<u32>,
    /// Blocks row by row, in the order of reading, and `PADDING` numbers.
    values: Vec<f32>,
    shift: f64,
}

/// The inverse of the Cholesky factor of a diagonal block, and its pivots. Returns `None` if a pivot is not positive or
/// below [`LEAST_PIVOT`] times the corresponding pivot in `alone`.
fn inverse_root(block: &Mat3, alone: Option<&Vec3>) -> Option<(Mat3, Vec3)> {
    let mut root = Mat3::zeros();
    let mut pivots = Vec3::zeros();
    for j in 0..3 {
        let mut pivot = block[(j, j)];
        for k in 0..j {
            pivot -= root[(j, k)] * root[(j, k)];
        }
        let least = alone.map_or(0.0, |alone| LEAST_PIVOT * alone[j]);
        if !(pivot > least && pivot.is_finite()) {
            return None;
        }
        pivots[j] = pivot;
        root[(j, j)] = pivot.sqrt();
        for i in j + 1..3 {
            let mut sum = block[(i, j)];
            for k in 0..j {
                sum -= root[(i, k)] * root[(j, k)];
            }
            root[(i, j)] = sum / root[(j, j)];
        }
    }
    let mut inverse = Mat3::zeros();
    for j in 0..3 {
        for i in j..3 {
            let mut sum = if i == j { 1.0 } else { 0.0 };
            for k in j..i {
                sum -= root[(i, k)] * inverse[(k, j)];
            }
            inverse[(i, j)] = sum / root[(i, i)];
        }
    }
    Some((inverse, pivots))
}

/// Block number `at`.
#[inline(always)]
fn load(values: &[f32], at: usize) -> Mat3 {
    let block = &values[BLOCK * at..BLOCK * (at + 1)];
    Mat3::from_fn(|i, j| f64::from(block[3 * i + j]))
}

#[inline(always)]
fn store(values: &mut [f32], at: usize, block: &Mat3) {
    let values = &mut values[BLOCK * at..BLOCK * (at + 1)];
    for i in 0..3 {
        for j in 0..3 {
            values[3 * i + j] = block[(i, j)] as f32;
        }
    }
}

impl Blocks {
    /// A factor without numbers for the free nodes of `matrix`, in their order.
    pub fn new(matrix: &BlockMatrix) -> Self {
        let mut row_end = Vec::with_capacity(matrix.free());
        let mut columns = Vec::new();
        for row in 0..matrix.free() {
            let before = matrix.free_blocks(row).map(|(column, _)| column);
            columns.extend(before.take_while(|&column| column < row).map(|c| c as u32));
            row_end.push(columns.len() as u32);
        }
        columns.shrink_to_fit();
        let blocks = columns.len() + row_end.len();
        Self {
            values: vec![0.0; BLOCK * blocks + PADDING],
            row_end,
            columns,
            shift: 0.0,
        }
    }

    /// Factorizes `mass_factor M + stiffness_factor K`. `matrix` must have the pattern given to `new`, and `mass` (kg)
    /// has an entry for each of its nodes.
    ///
    /// `mask` has for each free node and axis 1 if the axis is free and 0 if it is guided. Guided axes are uncoupled,
    /// with 1 on the diagonal. After an error the factor is invalid until a factorization succeeds.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Topology`] if the pattern has another size, and [`CondenseError::NotPositiveDefinite`] if
    /// a diagonal block is not positive definite.
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
        if matrix.free() != self.row_end.len() || !step.is_whole() {
            return Err(CondenseError::Topology);
        }
        self.shift = 0.0;
        loop {
            match self.attempt(&step) {
                Err(CondenseError::NotPositiveDefinite { .. }) if self.shift < LAST_SHIFT => {
                    self.shift = (2.0 * self.shift).max(FIRST_SHIFT);
                }
                result => return result,
            }
        }
    }

    /// The fraction by which diagonal blocks were enlarged in the last factorization. It is usually 0.
    pub fn shift(&self) -> f64 {
        self.shift
    }

    fn attempt(&mut self, step: &StepMatrix<'_>) -> Result<(), CondenseError> {
        let mut start = 0;
        for row in 0..self.row_end.len() {
            let end = self.row_end[row] as usize;
            // Each row before this one has one diagonal block.
            let first = start + row;
            let mut at = start;
            let mut diagonal = Mat3::zeros();
            let mut alone = Vec3::zeros();
            for (column, block) in step.stiffness.free_blocks(row) {
                if column > row {
                    break;
                }
                let mut block = step.block(row, column, block, 1.0);
                if column == row {
                    block *= 1.0 + self.shift;
                    let (_, pivots) = inverse_root(&block, None)
                        .ok_or(CondenseError::NotPositiveDefinite { pivot: 3 * row })?;
                    alone = pivots;
                    diagonal += block;
                    break;
                }
                if self.columns.get(at) != Some(&(column as u32)) {
                    return Err(CondenseError::Topology);
                }
                block -= self.product_of_rows((start, at), first, column);
                let inverse = load(&self.values, self.row_end[column] as usize + column);
                let entry = block * inverse.transpose();
                store(&mut self.values, first + at - start, &entry);
                diagonal -= entry * entry.transpose();
                at += 1;
            }
            if at != end {
                return Err(CondenseError::Topology);
            }
            let (inverse, _) = inverse_root(&diagonal, Some(&alone))
                .ok_or(CondenseError::NotPositiveDefinite { pivot: 3 * row })?;
            store(&mut self.values, end + row, &inverse);
            start = end;
        }
        Ok(())
    }

    /// `sum L_rk L_ck^T` over the columns `k` that row `r` and row `c`, which is `other`, have in common. The blocks of
    /// row `r` that are known already have the columns in `range` and begin at `first`.
    #[inline(always)]
    fn product_of_rows(&self, range: (usize, usize), first: usize, other: usize) -> Mat3 {
        let other_start = other
            .checked_sub(1)
            .map_or(0, |before| self.row_end[before] as usize);
        let ours = &self.columns[range.0..range.1];
        let theirs = &self.columns[other_start..self.row_end[other] as usize];
        let mut sum = Mat3::zeros();
        let (mut a, mut b) = (0, 0);
        while a < ours.len() && b < theirs.len() {
            if ours[a] == theirs[b] {
                let right = load(&self.values, other_start + other + b);
                sum += load(&self.values, first + a) * right.transpose();
            }
            let (left, right) = (ours[a], theirs[b]);
            a += usize::from(left <= right);
            b += usize::from(right <= left);
        }
        sum
    }

    /// Solves `L L^T x = r` in place, by places. Places past those of the factor are not changed. If `r` is shorter
    /// than the factor, the function does nothing.
    pub fn solve(&self, r: &mut [Node<f32>]) {
        if let Some(r) = r.get_mut(..self.row_end.len()) {
            sweep::solve(&self.row_end, &self.columns, &self.values, r);
        }
    }

    /// Reads a share of the numbers.
    pub(crate) fn read(&self, share: Share) {
        read_ahead::read(&self.values, share, |&number| number);
    }

    /// Memory of the factor (bytes).
    pub fn bytes(&self) -> usize {
        size_of_val(self.row_end.as_slice())
            + size_of_val(self.columns.as_slice())
            + size_of_val(self.values.as_slice())
    }

    /// The cost of a solve. Each of the two passes reads all blocks, with a product and a sum for each number.
    pub(crate) fn solve_cost(&self) -> Cost {
        let factor = Cost::read(self.bytes());
        let r = Cost::update(size_of::<Node<f32>>() * self.row_end.len());
        factor + factor.again() + r + r.again() + Cost::flops(4 * self.values.len())
    }

    /// The cost of a factorization without enlarged diagonals: two products of blocks for each block before the
    /// diagonal, and one for each column that its two rows have in common.
    pub(crate) fn factorize_cost(&self) -> Cost {
        let mut products = 0;
        let mut start = 0;
        for &end in &self.row_end {
            let row = &self.columns[start..end as usize];
            for &column in row {
                let before = (column as usize).checked_sub(1);
                let first = before.map_or(0, |before| self.row_end[before] as usize);
                let other = &self.columns[first..self.row_end[column as usize] as usize];
                products += other.iter().filter(|c| row.contains(c)).count();
            }
            products += 2 * row.len();
            start = end as usize;
        }
        Cost::update(self.bytes()) + Cost::flops(54 * products)
    }
}
