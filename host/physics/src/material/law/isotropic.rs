//! Isotropic laws as functions of the signed principal stretches.
//!
//! In the axes of `F = U diag(s) V^T` the modulus is block diagonal: a 3 x 3 block of stretches, three *twists*
//! and three *flips*. The twists and the flips are eigenvalues in closed form (Smith, de Goes and Kim, "Analytic
//! eigensystems for isotropic distortion energies", 2019). To clip them is to set the negative ones to zero.

use super::{Lame, Law, Modulus, Response};
use crate::material::Tangent;
use crate::polar::svd::{Svd, svd, svd_from};
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
    /// For each pair of axes `ij`, the derivative of the shear `P_ij` by `F_ij` (Pa).
    pub fn same(&self) -> Vec3 {
        (self.flip + self.twist) * 0.5
    }

    /// For each pair of axes `ij`, the derivative of the shear `P_ij` by `F_ji` (Pa).
    pub fn crossed(&self) -> Vec3 {
        (self.flip - self.twist) * 0.5
    }
}

/// The principal axes of a deformation gradient `F = u diag(s) v^T`, and the derivatives of a law in these axes.
#[derive(Clone, Copy, Debug)]
pub struct Axes {
    /// The left axes, a rotation.
    pub u: Mat3,
    /// The right axes, a rotation.
    pub v: Mat3,
    /// Derivatives of the energy density.
    pub principal: Principal,
}

impl Axes {
    fn new(svd: Svd, tangent: Tangent, law: impl Fn(&Vec3) -> Principal) -> Self {
        let Svd { u, s, v } = svd;
        let mut principal = law(&s);
        if tangent == Tangent::Clipped {
            principal.stretch = clipped(&principal.stretch);
            principal.twist = principal.twist.sup(&Vec3::zeros());
            principal.flip = principal.flip.sup(&Vec3::zeros());
        }
        Self { u, v, principal }
    }
}

/// Energy density, stress and clipped modulus of a law at one deformation gradient, the modulus in principal axes.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Energy per rest volume (J/m^3).
    pub energy: f64,
    /// First Piola-Kirchhoff stress (Pa).
    pub stress: Mat3,
    /// The modulus.
    pub axes: Axes,
}

/// A law as the vector kernels call it. The last argument is an estimate of the right axes of the deformation
/// gradient.
pub type PointLaw = fn(Lame, &Mat3, &Mat3) -> Point;

/// Evaluates `law` at `f`. The function `principal` gives the derivatives of the law by the principal stretches, and
/// `start` is an estimate of the right axes of `f`.
pub(crate) fn point<L: Law>(
    law: &L,
    lame: Lame,
    f: &Mat3,
    start: &Mat3,
    principal: impl Fn(&Vec3) -> Principal,
) -> Point {
    Point {
        energy: law.energy(lame, f),
        stress: law.stress(lame, f),
        axes: Axes::new(
            svd_from(f, &orthonormal(start)),
            Tangent::Clipped,
            principal,
        ),
    }
}

/// The rotation near `rounded`, a rotation whose columns are orthonormal only up to rounding (Gram-Schmidt).
fn orthonormal(rounded: &Mat3) -> Mat3 {
    let x = rounded.column(0).normalize();
    let y = rounded.column(1) - x * x.dot(&rounded.column(1));
    let y = y.normalize();
    Mat3::from_columns(&[x, y, x.cross(&y)])
}

/// A pivot above this fraction of the trace is no rounding error.
const PIVOT: f64 = 1e-10;

/// The pairs of axes. Pair `k` lacks axis `k`.
pub const PAIRS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// Stress and modulus at `f` of the law whose derivatives by the principal stretches `law` gives.
pub fn respond(f: &Mat3, tangent: Tangent, law: impl Fn(&Vec3) -> Principal) -> Response {
    let Axes { u, v, principal } = Axes::new(svd(f), tangent, law);
    let p = principal;
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

/// Whether every pivot of the elimination is clearly positive.
fn is_definite(matrix: &Mat3) -> bool {
    let least = PIVOT * matrix.trace();
    let first = matrix[(0, 0)];
    let (y, z) = (matrix[(1, 0)] / first, matrix[(2, 0)] / first);
    let second = matrix[(1, 1)] - y * matrix[(0, 1)];
    let beside = matrix[(2, 1)] - z * matrix[(0, 1)];
    let third = matrix[(2, 2)] - z * matrix[(0, 2)] - beside * beside / second;
    first > least && second > least && third > least && least > 0.0
}

/// A symmetric matrix with its negative eigenvalues set to zero.
fn clipped(matrix: &Mat3) -> Mat3 {
    if is_definite(matrix) {
        return *matrix;
    }
    // The singular values of a symmetric matrix are the magnitudes of its eigenvalues: the result is `(A + |A|) / 2`.
    let Svd { s, v, .. } = svd(matrix);
    let size = v * Mat3::from_diagonal(&s.abs()) * v.transpose();
    let sum = (matrix + size) * 0.5;
    (sum + sum.transpose()) * 0.5
}
