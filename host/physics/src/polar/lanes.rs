//! Rotations of elements by Newton iterations from the previous rotations.
//!
//! The rotation `R` of a deformation gradient `F` makes `R^T F` symmetric and maximizes its trace. With a guess of `R`,
//! `A = R^T F` and its symmetric part `S`, the turn `w` that makes `exp(-[w]) A` symmetric to first order solves
//! `(tr S I - S) w = axial(A - A^T)`. This is Newton's method. It converges quadratically, and nearly cubically if
//! strains are small.
//!
//! As a function of the rotation's quaternion the trace is a quadratic form. It has no local maximum but the global
//! one. If `tr S I - S` is positive definite, the iteration has therefore found the maximum, also in an inverted
//! element, and the rotation is that of [`svd`](crate::polar::svd). Otherwise the caller uses the singular values.

use super::svd::svd;
use crate::Mat3;
use crate::lanes::Real;

/// A 3 x 3 matrix by rows.
pub type Matrix<T> = [[T; 3]; 3];

/// A unit quaternion, its scalar part first.
pub type Quaternion<T> = [T; 4];

/// The least ratio of the determinant of `tr S I - S` to the cube of its trace (1/27 at rest). If the sum of two
/// stretches is below some hundredths of the largest, the caller uses the singular values.
const DEFINITE: f64 = 1e-4;

/// `R - I`. The digits of a small rotation are kept.
#[inline(always)]
pub fn rotation_less_identity<T: Real>(q: Quaternion<T>) -> Matrix<T> {
    let [w, x, y, z] = q;
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    [
        [-(yy + zz), xy - wz, xz + wy],
        [xy + wz, -(xx + zz), yz - wx],
        [xz - wy, yz + wx, -(xx + yy)],
    ]
}

/// `R^T (I + H) - I` from `Q = R - I`, without forming either sum. The digits of small strains are kept.
#[inline(always)]
pub fn strain<T: Real>(q: &Matrix<T>, h: &Matrix<T>) -> Matrix<T> {
    let mut e = [[T::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            let product = q[0][i] * h[0][j] + q[1][i] * h[1][j] + q[2][i] * h[2][j];
            e[i][j] = (q[j][i] + h[i][j]) + product;
        }
    }
    e
}

/// One Newton iteration for the rotation of `F = I + H`. Returns the new quaternion and whether it has converged.
#[inline(always)]
pub fn turn<T: Real>(q: Quaternion<T>, h: &Matrix<T>) -> (Quaternion<T>, bool) {
    let e = strain(&rotation_less_identity(q), h);
    let half = T::of(0.5);
    let two = T::of(2.0);
    // tr S I - S.
    let (m00, m11, m22) = (
        two + (e[1][1] + e[2][2]),
        two + (e[0][0] + e[2][2]),
        two + (e[0][0] + e[1][1]),
    );
    let m01 = -half * (e[0][1] + e[1][0]);
    let m02 = -half * (e[0][2] + e[2][0]);
    let m12 = -half * (e[1][2] + e[2][1]);
    // Its adjugate and determinant.
    let c00 = m11 * m22 - m12 * m12;
    let c01 = m02 * m12 - m01 * m22;
    let c02 = m01 * m12 - m02 * m11;
    let c11 = m00 * m22 - m02 * m02;
    let c12 = m01 * m02 - m00 * m12;
    let c22 = m00 * m11 - m01 * m01;
    let determinant = m00 * c00 + m01 * c01 + m02 * c02;
    let trace = m00 + m11 + m22;
    let definite =
        m00 > T::ZERO && c22 > T::ZERO && determinant > T::of(DEFINITE) * (trace * trace * trace);

    let a = [e[2][1] - e[1][2], e[0][2] - e[2][0], e[1][0] - e[0][1]];
    let inverse = T::of(1.0) / determinant;
    let w = [
        (c00 * a[0] + c01 * a[1] + c02 * a[2]) * inverse,
        (c01 * a[0] + c11 * a[1] + c12 * a[2]) * inverse,
        (c02 * a[0] + c12 * a[1] + c22 * a[2]) * inverse,
    ];
    let square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
    // Without strain, `|w|` is the tangent of the angle. The tangent of half the angle is near `2 |w| / (4 + |w|^2)`.
    let scalar = T::of(4.0) + square;
    let [x, y, z] = [w[0] + w[0], w[1] + w[1], w[2] + w[2]];
    let turned = [
        q[0] * scalar - (q[1] * x + q[2] * y + q[3] * z),
        q[0] * x + q[1] * scalar + (q[2] * z - q[3] * y),
        q[0] * y + q[2] * scalar + (q[3] * x - q[1] * z),
        q[0] * z + q[3] * scalar + (q[1] * y - q[2] * x),
    ];
    let norm = turned[0] * turned[0]
        + turned[1] * turned[1]
        + turned[2] * turned[2]
        + turned[3] * turned[3];
    let scale = T::of(1.0) / norm.sqrt();
    let unit = [
        turned[0] * scale,
        turned[1] * scale,
        turned[2] * scale,
        turned[3] * scale,
    ];
    (unit, definite && square <= T::SMALL_TURN)
}

/// The quaternion of the rotation of `I + H` from singular values. It is always finite.
pub fn quaternion<T: Real>(h: &Matrix<T>) -> Quaternion<T> {
    let f = Mat3::from_fn(|i, j| h[i][j].to_f64() + if i == j { 1.0 } else { 0.0 });
    let svd = svd(&f);
    of_rotation(&(svd.u * svd.v.transpose()))
}

/// The quaternion of the rotation matrix `r`.
pub(crate) fn of_rotation<T: Real>(r: &Mat3) -> Quaternion<T> {
    // Division by the largest component (Shepperd, Journal of Guidance and Control 1, 1978).
    let trace = r.trace();
    let (largest, _) = [trace, r[(0, 0)], r[(1, 1)], r[(2, 2)]]
        .into_iter()
        .enumerate()
        .fold((0, f64::MIN), |best, (k, value)| {
            if value > best.1 { (k, value) } else { best }
        });
    let axial = [
        r[(2, 1)] - r[(1, 2)],
        r[(0, 2)] - r[(2, 0)],
        r[(1, 0)] - r[(0, 1)],
    ];
    let mut q = [1.0 + trace, axial[0], axial[1], axial[2]];
    if largest > 0 {
        let i = largest - 1;
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        q[0] = axial[i];
        q[1 + i] = 1.0 + 2.0 * r[(i, i)] - trace;
        q[1 + j] = r[(i, j)] + r[(j, i)];
        q[1 + k] = r[(i, k)] + r[(k, i)];
    }
    let norm = (q.iter().map(|c| c * c).sum::<f64>()).sqrt();
    q.map(|c| T::of(c / norm))
}

/// `R` as a matrix.
pub fn matrix<T: Real>(q: Quaternion<T>) -> Mat3 {
    let less = rotation_less_identity(q.map(Real::to_f64));
    Mat3::from_fn(|i, j| less[i][j]) + Mat3::identity()
}
