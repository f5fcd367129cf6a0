//! Isotropic laws by their signed principal stretches.
//!
//! In the axes of `F = U diag(s) V^T` the modulus falls apart into a 3 x 3 block of stretches, three
//! *twists* and three *flips*, whose eigenvalues have closed forms (Smith, de Goes and Kim, "Analytic
//! eigensystems for isotropic distortion energies", 2019). Clipping is then a matter of signs.

use super::{Lame, Law, Modulus, Response};
use crate::material::Tangent;
use crate::polar::svd::{Svd, svd, svd_from};
use crate::{Mat3, Vec3};

/// Derivatives of the energy density by the principal stretches (Pa).
#[derive(Clone, Copy, Debug)]
pub struct Principal {
    /// First derivatives: the principal stresses.
    pub stress: Vec3,
    /// Second derivatives.
    pub stretch: Mat3,
    /// `(psi_i + psi_j) / (s_i + s_j)` for the pairs 12, 02, 01: eigenvalues of the turns of one axis into
    /// another.
    pub twist: Vec3,
    /// `(psi_i - psi_j) / (s_i - s_j)` for the same pairs: eigenvalues of the shears.
    pub flip: Vec3,
}

impl Principal {
    /// By pair of axes `ij`, how the shear `P_ij` answers to `F_ij`.
    pub fn same(&self) -> Vec3 {
        (self.flip + self.twist) * 0.5
    }

    /// By pair of axes `ij`, how the shear `P_ij` answers to `F_ji`.
    pub fn crossed(&self) -> Vec3 {
        (self.flip - self.twist) * 0.5
    }
}

/// The axes of a deformation gradient `F = u diag(s) v^T`, and what a law says in them.
#[derive(Clone, Copy, Debug)]
pub struct Axes {
    /// The left ones, a rotation.
    pub u: Mat3,
    /// The right ones, a rotation.
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

/// All that a law says at one deformation gradient, its modulus clipped and in principal axes.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Energy per rest volume (J/m^3).
    pub energy: f64,
    /// First Piola-Kirchhoff stress (Pa).
    pub stress: Mat3,
    /// The modulus.
    pub axes: Axes,
}

/// A law as [`fast`](crate::lanes) calls it: with the right axes of a deformation gradient near this one.
pub type PointLaw = fn(Lame, &Mat3, &Mat3) -> Point;

/// What `law`, whose derivatives by the principal stretches are `principal`, says at `f`, whose right axes are near
/// those of `start`.
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

/// A rotation from one that rounding has worn.
fn orthonormal(worn: &Mat3) -> Mat3 {
    let x = worn.column(0).normalize();
    let y = worn.column(1) - x * x.dot(&worn.column(1));
    let y = y.normalize();
    Mat3::from_columns(&[x, y, x.cross(&y)])
}

/// A pivot above this share of the trace is not rounding.
const PIVOT: f64 = 1e-10;

/// The pairs of axes, by the axis that is left out.
pub const PAIRS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

/// Stress and modulus at `f` of the law with these derivatives.
pub fn respond(f: &Mat3, tangent: Tangent, law: impl Fn(&Vec3) -> Principal) -> Response {
    let Axes { u, v, principal } = Axes::new(svd(f), tangent, law);
    let p = principal;
    // In principal axes: dP_ii by dF_jj; and dP_ij by dF_ij and dF_ji.
    let (same, crossed) = (p.same(), p.crossed());
    // The modulus of the term a_ij E_ij (x) E_kl, with E_ij = u_i v_j^T, has the block v_j[J] v_l[L]
    // u_i u_k^T. Sum over what is not zero, for fixed right axes first.
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

/// Whether elimination meets no pivot that is not clearly positive.
fn is_definite(matrix: &Mat3) -> bool {
    let least = PIVOT * matrix.trace();
    let first = matrix[(0, 0)];
    let (y, z) = (matrix[(1, 0)] / first, matrix[(2, 0)] / first);
    let second = matrix[(1, 1)] - y * matrix[(0, 1)];
    let beside = matrix[(2, 1)] - z * matrix[(0, 1)];
    let third = matrix[(2, 2)] - z * matrix[(0, 2)] - beside * beside / second;
    first > least && second > least && third > least && least > 0.0
}

/// A symmetric matrix with its negative eigenvalues replaced by zero.
fn clipped(matrix: &Mat3) -> Mat3 {
    if is_definite(matrix) {
        return *matrix;
    }
    // The singular values of a symmetric matrix are its eigenvalues but for signs: `(A + |A|) / 2`.
    let Svd { s, v, .. } = svd(matrix);
    let size = v * Mat3::from_diagonal(&s.abs()) * v.transpose();
    let sum = (matrix + size) * 0.5;
    (sum + sum.transpose()) * 0.5
}
