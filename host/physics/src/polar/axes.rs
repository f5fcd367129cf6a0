//! Principal axes of elements by Jacobi rotations from the previous axes.
//!
//! The right axes of a deformation gradient `F = I + H` are the eigenvectors of `F^T F`, and so of
//! `G = H + H^T + H^T H`, which keeps the digits of small strains. A sweep rotates each pair of axes until the entry of
//! `V^T G V` between the two is zero (Jacobi, 1846). The sweeps converge quadratically from any start, with equal
//! singular values as well. Axes are stored as a quaternion, as in McAdams, Selle, Tamstorf, Teran and Sifakis,
//! "Computing the singular value decomposition of 3 x 3 matrices with minimal branching and elementary floating point
//! operations", 2011. They therefore stay orthonormal over any number of steps.
//!
//! The functions have no branches and are always inlined into the loop over lanes that calls them.

use super::lanes::{Matrix, Quaternion, rotation_less_identity};
use super::matrices::{Symmetric, matrix, product_of, times};
use crate::lanes::Real;

/// Below the square root of this number of rounding errors of the first stretch, the second one does not determine its
/// left axis.
const LINE: f64 = 64.0;

/// The decomposition `F = u diag(s) v^T` with proper rotations `u` and `v`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decomposed<T> {
    pub(crate) u: Matrix<T>,
    /// Descending in magnitude. Only the last may be negative.
    pub(crate) s: [T; 3],
    pub(crate) v: Matrix<T>,
}

/// `F^T F - I`, twice the Green strain, of `F = I + H`.
#[inline(always)]
pub(crate) fn green<T: Real>(h: &Matrix<T>) -> Symmetric<T> {
    let entry = |i: usize, j: usize| {
        let product = h[0][i] * h[0][j] + h[1][i] * h[1][j] + h[2][i] * h[2][j];
        (h[i][j] + h[j][i]) + product
    };
    [
        entry(0, 0),
        entry(1, 1),
        entry(2, 2),
        entry(1, 2),
        entry(0, 2),
        entry(0, 1),
    ]
}

/// One sweep of Jacobi rotations over the eigenvectors `q` of the strain `green`. Returns the new eigenvectors and
/// whether they have converged.
#[inline(always)]
pub(crate) fn sweep<T: Real>(q: Quaternion<T>, green: &Symmetric<T>) -> (Quaternion<T>, bool) {
    let v = rotation(q);
    let turned = product_of(&matrix(green), &v);
    let entry = |i: usize, j: usize| {
        v[0][i] * turned[0][j] + v[1][i] * turned[1][j] + v[2][i] * turned[2][j]
    };
    let (a00, a11, a22) = (entry(0, 0), entry(1, 1), entry(2, 2));
    let (a12, a02, a01) = (entry(1, 2), entry(0, 2), entry(0, 1));
    // The sum of the squared stretches.
    let size = T::of(3.0) + (a00 + a11 + a22);
    let beside = a12 * a12 + a02 * a02 + a01 * a01;
    let converged = beside <= T::SMALL_TURN * (size * size);

    let [w, x, y, z] = q;
    let turn = Turn::new(a00, a11, a01);
    let (a00, a11) = (a00 + turn.tangent * a01, a11 - turn.tangent * a01);
    let (cosine, sine) = turn.whole();
    let (a02, a12) = (cosine * a02 + sine * a12, cosine * a12 - sine * a02);
    let ((w, z), (y, x)) = (turn.apply_half(w, z), turn.apply_half(y, x));

    let turn = Turn::new(a11, a22, a12);
    let a22 = a22 - turn.tangent * a12;
    let (cosine, _) = turn.whole();
    let a02 = cosine * a02;
    let ((w, x), (z, y)) = (turn.apply_half(w, x), turn.apply_half(z, y));

    let turn = Turn::new(a22, a00, a02);
    let ((w, y), (x, z)) = (turn.apply_half(w, y), turn.apply_half(x, z));

    let norm = w * w + x * x + y * y + z * z;
    let scale = T::of(1.0) / norm.sqrt();
    ([w * scale, x * scale, y * scale, z * scale], converged)
}

/// The decomposition of `F = I + H` by its right axes `q`, and whether `F` determines the left axes. It does not if `F`
/// is nearly a line or a point, or if it is not finite.
#[inline(always)]
pub(crate) fn decompose<T: Real>(q: Quaternion<T>, h: &Matrix<T>) -> (Decomposed<T>, bool) {
    // The right axes as rows, and their images under `F`.
    let mut v = transposed(&rotation(q));
    let mut b = v;
    let mut squares = [T::ZERO; 3];
    for k in 0..3 {
        let moved = times(h, v[k]);
        for i in 0..3 {
            b[k][i] += moved[i];
        }
        squares[k] = dot(b[k], b[k]);
    }
    // Sort in descending order. An exchange of axes changes a sign, so that `v` stays a rotation.
    for [p, q] in [[0, 1], [1, 2], [0, 1]] {
        let swap = squares[p] < squares[q];
        for rows in [&mut v, &mut b] {
            for i in 0..3 {
                let (x, y) = (rows[p][i], rows[q][i]);
                rows[p][i] = if swap { y } else { x };
                rows[q][i] = if swap { -x } else { y };
            }
        }
        let (x, y) = (squares[p], squares[q]);
        squares[p] = if swap { y } else { x };
        squares[q] = if swap { x } else { y };
    }
    let one = T::of(1.0);
    let first = squares[0].sqrt();
    let u0 = scaled(b[0], one / first);
    // The part of the second image orthogonal to the first. It makes `u` orthogonal even if this part is tiny.
    let along = dot(u0, b[1]);
    let rest = [0, 1, 2].map(|i| b[1][i] - u0[i] * along);
    let square = dot(rest, rest);
    let u1 = scaled(rest, one / square.sqrt());
    let u2 = cross(u0, u1);
    let found = Decomposed {
        u: transposed(&[u0, u1, u2]),
        s: [first, dot(u1, b[1]), dot(u2, b[2])],
        v: transposed(&v),
    };
    (found, square > rounding::<T>(LINE) * squares[0])
}

/// A rotation of two axes in their plane that makes the entry between the two zero.
struct Turn<T> {
    /// The tangent of the angle, which is at most half a right angle.
    tangent: T,
    /// Cosine and sine of half the angle, both times the same number.
    half: [T; 2],
}

impl<T: Real> Turn<T> {
    /// The rotation for the diagonal entries `first` and `second` and the entry `beside` between the two.
    #[inline(always)]
    fn new(first: T, second: T, beside: T) -> Self {
        let difference = first - second;
        let twice = beside + beside;
        // The addend keeps the quotient finite if both are zero. It counts only if no rotation is needed.
        let root = (difference * difference + twice * twice).sqrt() + rounding(1.0);
        let swapped = difference < T::ZERO;
        let (size, along) = if swapped {
            (-difference, -twice)
        } else {
            (difference, twice)
        };
        let tangent = along / (size + root);
        // The tangent of half the angle, `t / (1 + sqrt(1 + t^2))`, by a rational function. The result is an exact
        // rotation, by an angle that is wrong by at most 0.3 degrees. The error of small angles is of the seventh order.
        let square = tangent * tangent;
        let half = [
            T::of(1.0) + T::of(0.5) * square,
            tangent * (T::of(0.5) + T::of(0.125) * square),
        ];
        Self { tangent, half }
    }

    /// Cosine and sine of the angle.
    #[inline(always)]
    fn whole(&self) -> (T, T) {
        let [c, s] = self.half;
        let (cc, ss) = (c * c, s * s);
        let inverse = T::of(1.0) / (cc + ss);
        ((cc - ss) * inverse, (c + c) * s * inverse)
    }

    /// Two components of the quaternion of the axes after the rotation.
    #[inline(always)]
    fn apply_half(&self, first: T, second: T) -> (T, T) {
        let [c, s] = self.half;
        (c * first - s * second, c * second + s * first)
    }
}

/// `factor` times the square of the rounding error.
#[inline(always)]
fn rounding<T: Real>(factor: f64) -> T {
    let error = T::EPSILON.to_f64();
    T::of(factor * (error * error))
}

#[inline(always)]
fn rotation<T: Real>(q: Quaternion<T>) -> Matrix<T> {
    let mut r = rotation_less_identity(q);
    for i in 0..3 {
        r[i][i] += T::of(1.0);
    }
    r
}

#[inline(always)]
fn transposed<T: Real>(m: &Matrix<T>) -> Matrix<T> {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| m[j][i]))
}

#[inline(always)]
fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn scaled<T: Real>(a: [T; 3], factor: T) -> [T; 3] {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

#[inline(always)]
fn cross<T: Real>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
