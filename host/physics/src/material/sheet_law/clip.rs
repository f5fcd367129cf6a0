//! The positive semidefinite part of small symmetric matrices: negative eigenvalues set to zero.
//!
//! This part is the nearest positive semidefinite matrix in the Frobenius norm (Higham, "Computing a nearest
//! symmetric positive semidefinite matrix", 1988). Teran et al., "Robust quasistatic finite elements and flesh
//! simulation", 2005, clip the tangent of each element in this manner. The eigenvalues come from Jacobi's rotations
//! (Golub and Van Loan, "Matrix computations", 4th edition, section 8.5). These need neither an initial guess nor a
//! shift, compute small eigenvalues as accurately as the matrix allows, and end after a bounded number of sweeps.

/// A symmetric 4 x 4 matrix, stored in full.
pub(crate) type Sym4 = [[f64; 4]; 4];

/// The largest number of sweeps. Convergence is quadratic, and 4 x 4 matrices take three or four sweeps. The bound
/// serves matrices that do not reach the threshold because of rounding.
const MAX_SWEEPS: usize = 12;

/// The pairs of a sweep. Consecutive pairs are disjoint, so that a processor works on two rotations at a time
/// (the order of Brent and Luk, "The solution of singular-value and symmetric eigenvalue problems on
/// multiprocessor arrays", 1985).
const ROUND: [(usize, usize); 6] = [(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)];

/// Relative size of an off-diagonal entry that changes no eigenvalue by a bit.
const NEGLIGIBLE: f64 = 1e-17;

/// Relative size of the rounding error of a matrix that is a sum of a dozen terms.
const ROUNDING: f64 = 1e-15;

/// Positive part of the matrix with entries xx, xy, yy.
pub(crate) fn clip2(s: [f64; 3]) -> [f64; 3] {
    let mean = 0.5 * (s[0] + s[2]);
    let radius = libm::hypot(0.5 * (s[0] - s[2]), s[1]);
    let (large, small) = (mean + radius, mean - radius);
    if small >= 0.0 {
        return s;
    }
    if large <= 0.0 {
        return [0.0; 3];
    }
    // large v v^T, with v v^T = (S - small I) / (large - small).
    let scale = large / (large - small);
    [scale * (s[0] - small), scale * s[1], scale * (s[2] - small)]
}

/// Positive part of `h`. It is `h` itself if `h` is positive semidefinite up to rounding.
pub(crate) fn clip4(h: &Sym4) -> Sym4 {
    // A sheet is mostly in tension, where `h` is semidefinite. Elimination costs a small fraction of the eigenvalues.
    if is_semidefinite(h) {
        return *h;
    }
    let (values, vectors) = eigen(h);
    let mut clipped = [[0.0; 4]; 4];
    for (value, v) in values.iter().zip(&vectors) {
        if *value > 0.0 {
            for i in 0..4 {
                for j in 0..4 {
                    clipped[i][j] += value * v[i] * v[j];
                }
            }
        }
    }
    clipped
}

/// Whether elimination without exchanges meets no negative pivot. The result may be `false` for a semidefinite
/// matrix, but not `true` for another.
fn is_semidefinite(h: &Sym4) -> bool {
    let rounding = ROUNDING * (0..4).map(|k| h[k][k].abs()).sum::<f64>();
    let mut a = *h;
    for k in 0..3 {
        // The remainder after a pivot this small would be mostly rounding error.
        if a[k][k] <= 1e4 * rounding {
            return false;
        }
        for i in k + 1..4 {
            let factor = a[i][k] / a[k][k];
            for j in k + 1..4 {
                a[i][j] -= factor * a[k][j];
            }
        }
    }
    // A sheet at rest has no stiffness against spin: the pivot is zero up to rounding of either sign.
    a[3][3] >= -rounding
}

/// Eigenvalues, and the eigenvectors by rows.
fn eigen(h: &Sym4) -> ([f64; 4], Sym4) {
    let mut a = *h;
    let mut v = [[0.0; 4]; 4];
    for (k, row) in v.iter_mut().enumerate() {
        row[k] = 1.0;
    }
    let size = a.iter().flatten().map(|x| x.abs()).fold(0.0, f64::max);
    let negligible = NEGLIGIBLE * size;
    for _ in 0..MAX_SWEEPS {
        if ROUND.iter().all(|&(p, q)| a[p][q].abs() <= negligible) {
            break;
        }
        for (p, q) in ROUND {
            rotate(&mut a, &mut v, p, q);
        }
    }
    ([a[0][0], a[1][1], a[2][2], a[3][3]], v)
}

/// One rotation in the plane of `p` and `q`, after which `a[p][q]` is zero.
fn rotate(a: &mut Sym4, v: &mut Sym4, p: usize, q: usize) {
    let apq = a[p][q];
    if apq == 0.0 {
        return;
    }
    // The smaller of the two angles. If the quotient overflows, the tangent is zero, its limit.
    let theta = 0.5 * (a[q][q] - a[p][p]) / apq;
    let tangent = 1.0 / (theta.abs() + libm::sqrt(theta * theta + 1.0));
    let t = if theta < 0.0 { -tangent } else { tangent };
    let c = 1.0 / libm::sqrt(t * t + 1.0);
    let s = t * c;
    a[p][p] -= t * apq;
    a[q][q] += t * apq;
    a[p][q] = 0.0;
    a[q][p] = 0.0;
    for k in 0..4 {
        if k != p && k != q {
            let (x, y) = (a[k][p], a[k][q]);
            a[k][p] = c * x - s * y;
            a[k][q] = s * x + c * y;
            a[p][k] = a[k][p];
            a[q][k] = a[k][q];
        }
        let (x, y) = (v[p][k], v[q][k]);
        v[p][k] = c * x - s * y;
        v[q][k] = s * x + c * y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entries between -1 and 1 from a linear congruential generator (Knuth's constants).
    fn random(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    #[test]
    fn eigenvectors_are_orthonormal_and_give_the_matrix_back() {
        let mut state = 1;
        for case in 0..1000 {
            let mut h = [[0.0; 4]; 4];
            for i in 0..4 {
                for j in 0..=i {
                    h[i][j] = random(&mut state);
                    // Nearly diagonal, graded and diagonal matrices as well.
                    if i != j && case % 4 > 0 {
                        h[i][j] *= [1e-9, 1e-200, 0.0][case % 4 - 1];
                    }
                    h[j][i] = h[i][j];
                }
            }
            let (values, v) = eigen(&h);
            for i in 0..4 {
                for j in 0..4 {
                    let back: f64 = (0..4).map(|k| values[k] * v[k][i] * v[k][j]).sum();
                    let dot: f64 = (0..4).map(|k| v[i][k] * v[j][k]).sum();
                    // A few dozen rotations of numbers of order one.
                    assert!((back - h[i][j]).abs() < 1e-14, "{h:?}");
                    assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-14, "{h:?}");
                }
            }
        }
    }

    #[test]
    fn a_definite_matrix_is_kept_and_a_negative_one_vanishes() {
        let mut h = [[0.1; 4]; 4];
        for k in 0..4 {
            h[k][k] = 1.0;
        }
        assert_eq!(clip4(&h), h);
        assert_eq!(clip4(&h.map(|row| row.map(|x| -x))), [[0.0; 4]; 4]);
        assert_eq!(clip4(&[[0.0; 4]; 4]), [[0.0; 4]; 4]);
        assert_eq!(clip2([2.0, 1.0, 2.0]), [2.0, 1.0, 2.0]);
        assert_eq!(clip2([-2.0, 1.0, -2.0]), [0.0; 3]);
        // Eigenvalues 1 and -1 along the diagonals.
        assert_eq!(clip2([0.0, 1.0, 0.0]), [0.5, 0.5, 0.5]);
    }
}
