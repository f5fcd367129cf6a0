//! Isotropic laws as functions of the signed principal stretches.
//!
//! In the axes of `F = U diag(s) V^T` the modulus is block diagonal: a 3 x 3 block of stretches, three *twists*
//! and three *flips*. The twists and the flips are eigenvalues in closed form (Smith, de Goes and Kim, "Analytic
//! eigensystems for isotropic distortion energies", 2019). To clip them is to set the negative ones to zero.

use super::lane_law::LaneModuli;
use super::{Modulus, Response};
use crate::lanes::Real;
use crate::material::Tangent;
use crate::polar::matrices::{Symmetric, matrix};
use crate::polar::svd::{Svd, svd};
use crate::{Mat3, Vec3};

/// Derivatives of the energy density by the principal stretches (Pa).
#[derive(Clone, Copy, Debug)]
pub struct Principal {
    /// First derivatives: the principal stresses.
    pub stress: Vec3,
    /// Second derivatives (Pa).
    pub stretch: Mat3,
    /// `(psi_i + psi_j) / (s_i + s_j)` for the pairs 12, 02, 01: the eigenvalues of the rotations in the planes of
    /// these axes.
    pub twist: Vec3,
    /// `(psi_i - psi_j) / (s_i - s_j)` for the same pairs: the eigenvalues of the shears.
    pub flip: Vec3,
}

impl Principal {
    /// The derivatives with these first and second ones.
    pub(super) fn new(stress: Vec3, moduli: &LaneModuli<f64>) -> Self {
        Self {
            stress,
            stretch: symmetric(&moduli.stretch),
            twist: moduli.twist.into(),
            flip: moduli.flip.into(),
        }
    }

    /// For each pair of axes `ij`, the derivative of the shear `P_ij` by `F_ij` (Pa).
    pub fn same(&self) -> Vec3 {
        (self.flip + self.twist) * 0.5
    }

    /// For each pair of axes `ij`, the derivative of the shear `P_ij` by `F_ji` (Pa).
    pub fn crossed(&self) -> Vec3 {
        (self.flip - self.twist) * 0.5
    }
}

/// A pivot above this fraction of the trace is no rounding error.
const PIVOT: f64 = 1e-10;

/// The pairs of axes. Pair `k` lacks axis `k`.
pub const PAIRS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// Stress and modulus at `f` of the law whose derivatives by the principal stretches `law` gives.
pub fn respond(f: &Mat3, tangent: Tangent, law: impl Fn(&Vec3) -> Principal) -> Response {
    let Svd { u, s, v } = svd(f);
    let mut p = law(&s);
    if tangent == Tangent::Clipped {
        p.stretch = clipped(&p.stretch);
        p.twist = p.twist.sup(&Vec3::zeros());
        p.flip = p.flip.sup(&Vec3::zeros());
    }
    // In principal axes: dP_ii by dF_jj; and dP_ij by dF_ij and dF_ji.
    let (same, crossed) = (p.same(), p.crossed());
    // The modulus of the term a_ij E_ij (x) E_kl, with E_ij = u_i v_j^T, has the block v_j[J] v_l[L]
    // u_i u_k^T. Sum over the terms that are not zero, for fixed right axes first.
    let mut right = [[Mat3::zeros(); 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            right[i][j] += u.column(i) * u.column(j).transpose() * p.stretch[(i, j)];
        }
    }
    for (k, [i, j]) in PAIRS.into_iter().enumerate() {
        for (i, j) in [(i, j), (j, i)] {
            right[j][j] += u.column(i) * u.column(i).transpose() * same[k];
            right[j][i] += u.column(i) * u.column(j).transpose() * crossed[k];
        }
    }
    let mut half = [[Mat3::zeros(); 3]; 3];
    for j in 0..3 {
        for big in 0..3 {
            for l in 0..3 {
                half[j][big] += right[j][l] * v[(big, l)];
            }
        }
    }
    let modulus: Modulus = core::array::from_fn(|a| {
        core::array::from_fn(|b| {
            half[0][b] * v[(a, 0)] + half[1][b] * v[(a, 1)] + half[2][b] * v[(a, 2)]
        })
    });
    Response {
        stress: u * Mat3::from_diagonal(&p.stress) * v.transpose(),
        modulus,
    }
}

/// Whether every pivot of the elimination is clearly positive. Without branches, for loops over lanes.
#[inline(always)]
pub(crate) fn is_definite<T: Real>(matrix: &Symmetric<T>) -> bool {
    let [first, b, c, bc, ac, ab] = *matrix;
    let least = T::of(PIVOT) * (first + b + c);
    let (y, z) = (ab / first, ac / first);
    let second = b - y * ab;
    let beside = bc - z * ab;
    let third = c - z * ac - beside * beside / second;
    first > least && second > least && third > least && least > T::ZERO
}

/// The matrix with these entries.
pub(crate) fn symmetric(entries: &Symmetric<f64>) -> Mat3 {
    let rows = matrix(entries);
    Mat3::from_fn(|i, j| rows[i][j])
}

/// A symmetric matrix with its negative eigenvalues set to zero.
pub(crate) fn clipped(matrix: &Mat3) -> Mat3 {
    let m = |i, j| matrix[(i, j)];
    if is_definite(&[m(0, 0), m(1, 1), m(2, 2), m(2, 1), m(2, 0), m(1, 0)]) {
        return *matrix;
    }
    // The singular values of a symmetric matrix are the magnitudes of its eigenvalues: the result is `(A + |A|) / 2`.
    let Svd { s, v, .. } = svd(matrix);
    let size = v * Mat3::from_diagonal(&s.abs()) * v.transpose();
    let sum = (matrix + size) * 0.5;
    (sum + sum.transpose()) * 0.5
}
