//! Matrices of the element in one lane. The functions are always inlined into the loop over lanes that calls them.

use super::lanes::Matrix;
use crate::lanes::Real;

/// A symmetric matrix: 00, 11, 22, 12, 02, 01.
pub(crate) type Symmetric<T> = [T; 6];

/// `sum a_k b_k^T` over the rows of both.
#[inline(always)]
pub(crate) fn outer<T: Real>(a: &Matrix<T>, b: &Matrix<T>) -> Matrix<T> {
    let mut sum = [[T::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            sum[i][j] = a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j];
        }
    }
    sum
}

#[inline(always)]
pub(crate) fn product_of<T: Real>(a: &Matrix<T>, b: &Matrix<T>) -> Matrix<T> {
    let mut product = [[T::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            product[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
        }
    }
    product
}

#[inline(always)]
pub(crate) fn times<T: Real>(m: &Matrix<T>, v: [T; 3]) -> [T; 3] {
    let mut product = [T::ZERO; 3];
    for i in 0..3 {
        product[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
    }
    product
}

/// `factor` times the symmetric part.
#[inline(always)]
pub(crate) fn symmetric<T: Real>(m: &Matrix<T>, factor: T) -> Symmetric<T> {
    let half = T::of(0.5) * factor;
    [
        m[0][0] * factor,
        m[1][1] * factor,
        m[2][2] * factor,
        (m[1][2] + m[2][1]) * half,
        (m[0][2] + m[2][0]) * half,
        (m[0][1] + m[1][0]) * half,
    ]
}

#[inline(always)]
pub(crate) fn matrix<T: Real>(s: &Symmetric<T>) -> Matrix<T> {
    [[s[0], s[5], s[4]], [s[5], s[1], s[3]], [s[4], s[3], s[2]]]
}

/// Stress of a strain, both scaled by `sqrt(2 mu V)` of their elements: `e + ratio tr(e) I`.
#[inline(always)]
pub(crate) fn stress<T: Real>(e: &Symmetric<T>, ratio: T) -> Symmetric<T> {
    let pressure = ratio * (e[0] + e[1] + e[2]);
    [
        e[0] + pressure,
        e[1] + pressure,
        e[2] + pressure,
        e[3],
        e[4],
        e[5],
    ]
}

/// Half of the product of strain and stress.
#[inline(always)]
pub(crate) fn energy<T: Real>(e: &Symmetric<T>, s: &Symmetric<T>) -> T {
    let along = e[0] * s[0] + e[1] * s[1] + e[2] * s[2];
    let across = e[3] * s[3] + e[4] * s[4] + e[5] * s[5];
    T::of(0.5) * along + across
}
