//! Signed singular values of a 3 x 3 matrix.
//!
//! `F = U diag(s) V^T` with proper rotations `U` and `V`. The singular value of least magnitude carries the sign of
//! `det F` (Irving, Teran and Fedkiw, "Invertible finite elements for robust simulation of large deformation", 2004).
//! One-sided Jacobi rotations (Hestenes, 1958) rotate pairs of columns of `F V` until all columns are orthogonal. The
//! method computes small singular values as accurately as large ones and has no case that fails.

use crate::{Mat3, Vec3};

/// The largest number of sweeps. No tested matrix needed as many.
const MAX_SWEEPS: usize = 12;
/// Columns whose cosine is below this bound count as orthogonal.
const ORTHOGONAL: f64 = 1e-15;

/// The decomposition `F = u diag(s) v^T`.
///
/// ```
/// use physics::{Mat3, Vec3};
/// use physics::polar::svd::svd;
///
/// // A mirrored matrix: the singular value of least magnitude is negative.
/// let decomposed = svd(&Mat3::from_diagonal(&Vec3::new(1.0, -0.5, 2.0)));
/// assert!((decomposed.s - Vec3::new(2.0, 1.0, -0.5)).norm() < 1e-15);
/// assert!((decomposed.u.determinant() - 1.0).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Svd {
    /// Left rotation.
    pub u: Mat3,
    /// Singular values, descending in magnitude. Only the last may be negative.
    pub s: Vec3,
    /// Right rotation.
    pub v: Mat3,
}

/// A unit vector perpendicular to `to`, a unit vector.
fn perpendicular(to: &Vec3) -> Vec3 {
    let axis = match to.iamin() {
        0 => Vec3::x(),
        1 => Vec3::y(),
        _ => Vec3::z(),
    };
    to.cross(&axis).normalize()
}

/// The decomposition of a finite matrix. A matrix that is zero or not finite gives zero singular values.
pub fn svd(f: &Mat3) -> Svd {
    svd_from(f, &Mat3::identity())
}

/// The decomposition of `f` from `start`, a rotation near the right rotation of `f`. It takes fewer sweeps than
/// [`svd`].
pub fn svd_from(f: &Mat3, start: &Mat3) -> Svd {
    let scale = f.amax();
    if scale == 0.0 || !scale.is_finite() {
        return Svd {
            u: Mat3::identity(),
            s: Vec3::zeros(),
            v: Mat3::identity(),
        };
    }
    let mut v: [Vec3; 3] = core::array::from_fn(|k| start.column(k).into());
    let mut b = v.map(|v| f * v / scale);
    for _ in 0..MAX_SWEEPS {
        let mut turned = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (pp, qq, pq) = (b[p].norm_squared(), b[q].norm_squared(), b[p].dot(&b[q]));
            if pq == 0.0 || pq * pq <= ORTHOGONAL * ORTHOGONAL * pp * qq {
                continue;
            }
            turned = true;
            let zeta = (qq - pp) / (2.0 * pq);
            let t = libm::copysign(1.0, zeta) / (zeta.abs() + libm::sqrt(1.0 + zeta * zeta));
            let c = 1.0 / libm::sqrt(1.0 + t * t);
            let s = c * t;
            (b[p], b[q]) = (b[p] * c - b[q] * s, b[p] * s + b[q] * c);
            (v[p], v[q]) = (v[p] * c - v[q] * s, v[p] * s + v[q] * c);
        }
        if !turned {
            break;
        }
    }
    // Sort in descending order. An exchange of columns changes a sign, so that `v` stays a rotation.
    for (p, q) in [(0, 1), (1, 2), (0, 1)] {
        if b[p].norm_squared() < b[q].norm_squared() {
            (b[p], b[q]) = (b[q], -b[p]);
            (v[p], v[q]) = (v[q], -v[p]);
        }
    }
    let first = b[0].norm();
    let u0 = b[0] / first;
    // The part of the second column orthogonal to the first. It makes `u` orthogonal even if this part is tiny.
    let rest = b[1] - u0 * u0.dot(&b[1]);
    let second = rest.norm();
    let u1 = if second > 1e-14 * first {
        rest / second
    } else {
        perpendicular(&u0)
    };
    let u2 = u0.cross(&u1);
    Svd {
        u: Mat3::from_columns(&[u0, u1, u2]),
        s: Vec3::new(first, u1.dot(&b[1]), u2.dot(&b[2])) * scale,
        v: Mat3::from_columns(&v),
    }
}
