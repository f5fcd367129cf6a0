//! The compliance of the openings of pairs, and the springs of the pairs in the preconditioner.
//!
//! Let `B` part the two vertices of each pair by unit forces along the three axes, and let `P` be the factor in place of
//! the matrix. The columns `Y = P^-1 B` are kept, with the compliance `C = B^T Y`: the change of each opening by each
//! force. The columns have three uses.
//!
//! - A residual `r` will change the openings by `Y^T r`, before any iteration.
//! - The openings respond to forces by `C`, along any direction of the pairs.
//! - The pairs hold across their directions by springs `S`, which the factor lacks. With `W = S^(1/2)` the inverse of the
//!   sum is that of Woodbury (Golub and Van Loan, "Matrix computations", section 2.1.4),
//!
//! ```text
//! (P + B S B^T)^-1 = P^-1 - Y W (1 + W C W)^-1 W Y^T
//! ```
//!
//! and the openings respond by `(1 + C S)^-1 C`.

use crate::lanes::{Node, Real};
use crate::linear::vectors;
use crate::{Mat3, Vec3};

/// The largest stiffness of a spring in the preconditioner, relative to that of the body between the vertices. The
/// columns have single precision: beside a stiffer spring, the rounding errors of the difference would make the
/// preconditioner indefinite. A spring that is softer there costs iterations only.
const STIFFEST: f64 = 1e4;

/// The columns and the compliance of pairs.
#[derive(Debug, Default)]
pub(super) struct Compliance {
    /// Most pairs, and the number of pairs that have columns.
    most: usize,
    count: usize,
    /// Number of places of a column.
    stride: usize,
    /// Three columns for each pair: displacements of the places (m/N).
    columns: Vec<Node<f32>>,
    /// `C` by rows of `3 most` numbers (m/N).
    matrix: Vec<f64>,
    /// `W` for each pair (square root of N/m).
    roots: Vec<Mat3>,
    /// The Cholesky factor of `1 + W C W`, by rows of `3 most` numbers.
    lower: Vec<f64>,
    /// Whether `lower` is known.
    holds: bool,
    small: Vec<f64>,
}

impl Compliance {
    /// Room for `most` pairs of a body with free places below `stride`.
    pub(super) fn new(most: usize, stride: usize) -> Self {
        let size = 3 * most;
        Self {
            most,
            count: 0,
            stride,
            columns: vec![[0.0; 4]; size * stride],
            matrix: vec![0.0; size * size],
            roots: vec![Mat3::zeros(); most],
            lower: vec![0.0; size * size],
            holds: false,
            small: vec![0.0; size],
        }
    }

    /// Forgets all columns: the pairs, the matrix, or its factor has changed.
    pub(super) fn forget(&mut self) {
        self.count = 0;
        self.holds = false;
    }

    /// Whether there are columns.
    pub(super) fn is_known(&self) -> bool {
        self.count > 0
    }

    /// Whether the springs are in the preconditioner.
    pub(super) fn holds(&self) -> bool {
        self.holds
    }

    /// Takes the displacements `z` (m/N) of the free places under the unit force that parts a pair along an axis.
    pub(super) fn take_column(&mut self, pair: usize, axis: usize, z: &[Node<f32>]) {
        let start = (3 * pair + axis) * self.stride;
        for (kept, z) in self.columns[start..start + self.stride].iter_mut().zip(z) {
            *kept = *z;
        }
    }

    /// Takes the change of the opening of the pair `row` (m/N) under the unit force that parts the pair `column` along an
    /// axis.
    pub(super) fn take_opening(&mut self, row: usize, column: usize, axis: usize, opening: &Vec3) {
        for along in 0..3 {
            let at = (3 * row + along) * 3 * self.most + 3 * column + axis;
            self.matrix[at] = opening[along];
        }
    }

    /// Ends the columns of `count` pairs. The rounding errors of the factor leave `C` slightly unsymmetric.
    pub(super) fn complete(&mut self, count: usize) {
        self.count = count;
        let size = 3 * self.most;
        for row in 0..3 * count {
            for column in 0..row {
                let (one, other) = (row * size + column, column * size + row);
                let mean = 0.5 * (self.matrix[one] + self.matrix[other]);
                (self.matrix[one], self.matrix[other]) = (mean, mean);
            }
        }
    }

    /// Takes the springs of the pairs into the preconditioner: by pair, its unit direction and its stiffness across that
    /// direction (N/m).
    pub(super) fn hold(&mut self, springs: impl Iterator<Item = (Vec3, f64)>) {
        let size = 3 * self.most;
        for (pair, (direction, stiffness)) in springs.take(self.count).enumerate() {
            let own = |axis: usize| self.matrix[(3 * pair + axis) * size + 3 * pair + axis];
            let softest = own(0).max(own(1)).max(own(2));
            let stiffness = stiffness.min(STIFFEST / softest).max(0.0);
            let across = Mat3::identity() - direction * direction.transpose();
            self.roots[pair] = across * libm::sqrt(stiffness);
        }
        self.holds = self.eliminate();
    }

    /// The block of `C` between two pairs.
    fn block(&self, row: usize, column: usize) -> Mat3 {
        let size = 3 * self.most;
        Mat3::from_fn(|i, j| self.matrix[(3 * row + i) * size + 3 * column + j])
    }

    /// The Cholesky factor of `1 + W C W` (Golub and Van Loan, section 4.2). Returns whether all pivots are positive.
    fn eliminate(&mut self) -> bool {
        let size = 3 * self.most;
        for row in 0..self.count {
            for column in 0..=row {
                let mut block = self.roots[row] * self.block(row, column) * self.roots[column];
                if row == column {
                    block += Mat3::identity();
                }
                for i in 0..3 {
                    for j in 0..3 {
                        self.lower[(3 * row + i) * size + 3 * column + j] = block[(i, j)];
                    }
                }
            }
        }
        for row in 0..3 * self.count {
            for column in 0..=row {
                let (above, below) = self.lower.split_at_mut(row * size);
                let own = &mut below[..size];
                let mut sum = own[column];
                if column == row {
                    sum -= own[..row].iter().map(|l| l * l).sum::<f64>();
                    // The comparison is false for a pivot that is no number.
                    if !(sum > 0.0 && sum.is_finite()) {
                        return false;
                    }
                    own[row] = libm::sqrt(sum);
                } else {
                    let other = &above[column * size..][..=column];
                    let done: f64 = own[..column].iter().zip(other).map(|(a, b)| a * b).sum();
                    sum -= done;
                    own[column] = sum / other[column];
                }
            }
        }
        true
    }

    /// The forces of the springs (N) that resist the openings `free` (m), which the body has without the springs:
    /// `W (1 + W C W)^-1 W free`, into `self.small`.
    fn resist(&mut self, free: impl Fn(usize) -> Vec3) {
        let (size, end) = (3 * self.most, 3 * self.count);
        for pair in 0..self.count {
            let scaled = self.roots[pair] * free(pair);
            self.small[3 * pair..3 * pair + 3].copy_from_slice(scaled.as_slice());
        }
        for row in 0..end {
            let lower = &self.lower[row * size..][..=row];
            let done: f64 = lower[..row]
                .iter()
                .zip(&self.small)
                .map(|(l, x)| l * x)
                .sum();
            self.small[row] = (self.small[row] - done) / lower[row];
        }
        for row in (0..end).rev() {
            let lower = &self.lower[row * size..][..=row];
            let x = self.small[row] / lower[row];
            self.small[row] = x;
            for (l, sum) in lower[..row].iter().zip(&mut self.small) {
                *sum -= l * x;
            }
        }
        for pair in 0..self.count {
            let force = self.roots[pair] * self.force(pair);
            self.small[3 * pair..3 * pair + 3].copy_from_slice(force.as_slice());
        }
    }

    /// The values of a pair in `self.small`.
    fn force(&self, pair: usize) -> Vec3 {
        Vec3::from_column_slice(&self.small[3 * pair..3 * pair + 3])
    }

    /// Takes the displacements by the springs of the pairs from `z`, of which `opening` gives the opening of each pair (m).
    pub(super) fn add_to(
        &mut self,
        z: &mut [Node<f32>],
        opening: impl Fn(&[Node<f32>], usize) -> Vec3,
    ) {
        let whole: &[Node<f32>] = z;
        self.resist(|pair| opening(whole, pair));
        for column in 0..3 * self.count {
            let start = column * self.stride;
            let force = -self.small[column] as f32;
            vectors::add_single(force, &self.columns[start..start + self.stride], z);
        }
    }

    /// The openings (m) that a residual (N) will cause, springs included, into `openings`.
    pub(super) fn predict<T: Real>(&mut self, residual: &[Node<T>], openings: &mut [Vec3]) {
        let places = self.stride.min(residual.len());
        for (pair, opening) in openings.iter_mut().enumerate().take(self.count) {
            for axis in 0..3 {
                let start = (3 * pair + axis) * self.stride;
                let column = &self.columns[start..start + places];
                opening[axis] = vectors::dot_single(column, residual);
            }
        }
        self.soften(openings);
    }

    /// The openings (m) under a unit force that parts the pair `column` along its direction, springs included, into
    /// `openings`.
    pub(super) fn respond(&mut self, column: usize, direction: &Vec3, openings: &mut [Vec3]) {
        for (pair, opening) in openings.iter_mut().enumerate().take(self.count) {
            *opening = self.block(pair, column) * direction;
        }
        self.soften(openings);
    }

    /// Turns openings without springs into those with springs: `(1 + C S)^-1` in place.
    fn soften(&mut self, openings: &mut [Vec3]) {
        if !self.holds {
            return;
        }
        self.resist(|pair| openings[pair]);
        for pair in 0..self.count {
            for other in 0..self.count {
                openings[pair] -= self.block(pair, other) * self.force(other);
            }
        }
    }
}
