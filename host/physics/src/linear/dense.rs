//! Small dense symmetric matrices: a test of definiteness, the nearest positive semidefinite matrix, and the energy
//! that a stiffness matrix stores under a load.
//!
//! The eigenvalues come from cyclic Jacobi rotations (Golub and Van Loan, "Matrix computations", section
//! 8.5), which are simple, accurate and fast enough for the few dozen rows that handles have.

use core::ops::{Index, IndexMut};

/// A negative eigenvalue within this fraction of the largest counts as rounding error.
pub const ROUNDING: f64 = 1e-12;

/// A square matrix, by columns.
///
/// ```
/// use physics::linear::dense::{Clipper, Square};
///
/// let mut matrix = Square::zeros(2);
/// matrix[(0, 0)] = 2.0;
/// matrix[(1, 1)] = -1.0;
/// let clip = Clipper::new(2).clip(&mut matrix, &[1.0, 1.0]);
/// assert_eq!(clip.count, 1);
/// assert_eq!(matrix.as_slice(), [2.0, 0.0, 0.0, 0.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Square {
    size: usize,
    data: Vec<f64>,
}

impl Square {
    /// A zero matrix of `size` rows.
    pub fn zeros(size: usize) -> Self {
        Self {
            size,
            data: vec![0.0; size * size],
        }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Entries by columns.
    pub fn as_slice(&self) -> &[f64] {
        &self.data
    }

    /// Sets every entry to `value`.
    pub fn fill(&mut self, value: f64) {
        self.data.fill(value);
    }

    /// Copies the entries of a matrix of the same size.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.data.copy_from_slice(&other.data);
    }

    /// Multiplies every entry.
    pub(crate) fn scale(&mut self, by: f64) {
        for entry in &mut self.data {
            *entry *= by;
        }
    }

    /// Replaces the matrix by its transpose.
    pub(crate) fn transpose(&mut self) {
        for j in 0..self.size {
            for i in 0..j {
                self.data.swap(j * self.size + i, i * self.size + j);
            }
        }
    }

    /// Sets every entry above the diagonal to zero.
    pub(crate) fn clear_upper(&mut self) {
        for j in 0..self.size {
            for i in 0..j {
                self[(i, j)] = 0.0;
            }
        }
    }

    /// Replaces the matrix by its symmetric part.
    pub fn symmetrize(&mut self) {
        for j in 0..self.size {
            for i in 0..j {
                let mean = 0.5 * (self[(i, j)] + self[(j, i)]);
                self[(i, j)] = mean;
                self[(j, i)] = mean;
            }
        }
    }
}

impl Index<(usize, usize)> for Square {
    type Output = f64;
    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.data[j * self.size + i]
    }
}

impl IndexMut<(usize, usize)> for Square {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.data[j * self.size + i]
    }
}

/// The part that clipping removed from a matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Clip {
    /// Number of eigenvalues raised to zero (beyond rounding).
    pub count: usize,
    /// Magnitude of the most negative eigenvalue as a fraction of the largest magnitude, or 0 if none is negative.
    pub fraction: f64,
}

/// The eigenvalues and eigenvectors of symmetric matrices of one size.
#[derive(Clone, Debug)]
pub struct Eigen {
    work: Square,
    vectors: Square,
}

impl Eigen {
    /// A workspace for matrices of `size` rows.
    pub fn new(size: usize) -> Self {
        Self {
            work: Square::zeros(size),
            vectors: Square::zeros(size),
        }
    }

    /// Diagonalizes a symmetric `matrix`.
    pub fn solve(&mut self, matrix: &Square) {
        self.work.copy_from(matrix);
        jacobi(&mut self.work, &mut self.vectors);
    }

    /// Eigenvalue number `k` of the last matrix. The eigenvalues are in no order.
    pub fn value(&self, k: usize) -> f64 {
        self.work[(k, k)]
    }

    /// Eigenvector number `k` of the last matrix, of length one.
    pub fn vector(&self, k: usize) -> &[f64] {
        let size = self.vectors.size;
        &self.vectors.data[k * size..(k + 1) * size]
    }

    /// Whether every eigenvalue of a symmetric `matrix` is below one. Takes a Cholesky factorization.
    pub fn is_below_one(&mut self, matrix: &Square) -> bool {
        for (work, entry) in self.work.data.iter_mut().zip(&matrix.data) {
            *work = -entry;
        }
        is_positive(&mut self.work, 1.0)
    }
}

/// Workspace of [`clip`](Clipper::clip), for one size of matrix.
#[derive(Clone, Debug)]
pub struct Clipper {
    work: Square,
    vectors: Square,
}

impl Clipper {
    /// A workspace for matrices of `size` rows.
    pub fn new(size: usize) -> Self {
        Self {
            work: Square::zeros(size),
            vectors: Square::zeros(size),
        }
    }

    /// Replaces a symmetric `matrix` by the nearest positive semidefinite matrix. The distance is measured after row
    /// and column `i` are divided by `scale[i]`, which gives all entries the same unit.
    ///
    /// If a Cholesky factorization succeeds up to [`ROUNDING`], `matrix` is not changed.
    pub fn clip(&mut self, matrix: &mut Square, scale: &[f64]) -> Clip {
        let size = matrix.size();
        let mut largest = 0.0_f64;
        for j in 0..size {
            for i in 0..size {
                self.work[(i, j)] = matrix[(i, j)] / (scale[i] * scale[j]);
            }
            largest = largest.max(self.work[(j, j)].abs());
        }
        self.vectors.copy_from(&self.work);
        if is_positive(&mut self.vectors, ROUNDING * largest) {
            return Clip::default();
        }
        jacobi(&mut self.work, &mut self.vectors);
        let eigenvalue = |k: usize| self.work[(k, k)];
        let magnitude = (0..size).map(|k| eigenvalue(k).abs()).fold(0.0, f64::max);
        let mut clip = Clip::default();
        for k in 0..size {
            let fraction = -eigenvalue(k) / magnitude;
            if fraction > ROUNDING {
                clip.count += 1;
                clip.fraction = clip.fraction.max(fraction);
            }
        }
        if clip.count > 0 {
            for j in 0..size {
                for i in 0..=j {
                    let mut sum = 0.0;
                    for k in 0..size {
                        let value = self.work[(k, k)].max(0.0);
                        sum += value * self.vectors[(i, k)] * self.vectors[(j, k)];
                    }
                    let value = sum * scale[i] * scale[j];
                    matrix[(i, j)] = value;
                    matrix[(j, i)] = value;
                }
            }
        }
        clip
    }

    /// `load . matrix^-1 load / 2` of a symmetric `matrix` whose eigenvalues are raised to at least `floor`.
    ///
    /// Row and column `i` are divided by `scale[i]` first, as in [`clip`](Self::clip). For a stiffness (N/m) and forces
    /// (N) the result is the stored energy (J). The floor bounds it if the matrix is nearly singular.
    pub fn stored(&mut self, matrix: &Square, scale: &[f64], load: &[f64], floor: f64) -> f64 {
        let size = matrix.size();
        for j in 0..size {
            for i in 0..size {
                self.work[(i, j)] = matrix[(i, j)] / (scale[i] * scale[j]);
            }
        }
        jacobi(&mut self.work, &mut self.vectors);
        let mut energy = 0.0;
        for k in 0..size {
            let along: f64 = (0..size)
                .map(|i| self.vectors[(i, k)] * load[i] / scale[i])
                .sum();
            energy += 0.5 * along * along / self.work[(k, k)].max(floor);
        }
        energy
    }
}

/// Whether `matrix + shift I` has a Cholesky factor. The function overwrites the matrix.
fn is_positive(matrix: &mut Square, shift: f64) -> bool {
    let size = matrix.size();
    for k in 0..size {
        let mut pivot = matrix[(k, k)] + shift;
        for j in 0..k {
            pivot -= matrix[(k, j)] * matrix[(k, j)];
        }
        // A zero matrix (of a body without stiffness) is semidefinite.
        if pivot == 0.0 && shift == 0.0 {
            return (0..size).all(|i| (0..size).all(|j| matrix[(i, j)] == 0.0));
        }
        if pivot <= 0.0 || pivot.is_nan() {
            return false;
        }
        let root = libm::sqrt(pivot);
        matrix[(k, k)] = root;
        for i in k + 1..size {
            let mut sum = matrix[(i, k)];
            for j in 0..k {
                sum -= matrix[(i, j)] * matrix[(k, j)];
            }
            matrix[(i, k)] = sum / root;
        }
    }
    true
}

/// Diagonalizes the symmetric `a`; the columns of `v` become its eigenvectors.
fn jacobi(a: &mut Square, v: &mut Square) {
    let size = a.size();
    v.fill(0.0);
    for i in 0..size {
        v[(i, i)] = 1.0;
    }
    // Convergence is quadratic. A hundred rows usually take ten sweeps.
    for _ in 0..30 {
        let mut off = 0.0;
        let mut diagonal = 0.0;
        for j in 0..size {
            diagonal += a[(j, j)] * a[(j, j)];
            for i in 0..j {
                off += a[(i, j)] * a[(i, j)];
            }
        }
        if off <= 1e-32 * diagonal || off.is_nan() {
            return;
        }
        for q in 1..size {
            for p in 0..q {
                rotate(a, v, p, q);
            }
        }
    }
}

/// One rotation that makes `a[(p, q)]` zero.
fn rotate(a: &mut Square, v: &mut Square, p: usize, q: usize) {
    let apq = a[(p, q)];
    if apq == 0.0 {
        return;
    }
    let theta = 0.5 * (a[(q, q)] - a[(p, p)]) / apq;
    let t = theta.signum() / (theta.abs() + libm::sqrt(1.0 + theta * theta));
    let c = 1.0 / libm::sqrt(1.0 + t * t);
    let s = t * c;
    let size = a.size();
    for k in 0..size {
        let (akp, akq) = (a[(k, p)], a[(k, q)]);
        a[(k, p)] = c * akp - s * akq;
        a[(k, q)] = s * akp + c * akq;
    }
    for k in 0..size {
        let (apk, aqk) = (a[(p, k)], a[(q, k)]);
        a[(p, k)] = c * apk - s * aqk;
        a[(q, k)] = s * apk + c * aqk;
    }
    for k in 0..size {
        let (vkp, vkq) = (v[(k, p)], v[(k, q)]);
        v[(k, p)] = c * vkp - s * vkq;
        v[(k, q)] = s * vkp + c * vkq;
    }
}
