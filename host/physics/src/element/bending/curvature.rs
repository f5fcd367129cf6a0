//! The curvature of one triangle, and its first and second derivatives.
//!
//! The triangle has the sides `e_1`, `e_2` from its first vertex, the unit normal `n`, and at each of its sides the
//! derivative `theta_e` of the position across the side, of length 1 at rest. The slope at a side relative to the
//! triangle is
//!
//! ```text
//! s_e = n . theta_e / sqrt((1 - EASE) |theta_e|^2 + EASE)
//! ```
//!
//! the sine of half the fold. (Without the root the slope of a fold would decrease beyond a right angle, and a sheet
//! would fold flat by itself.) Neither a stretch of the triangle's plane nor a rigid motion changes the slopes.
//! With the weights `b_e` of the triangle and the slopes at rest the energy is
//!
//! ```text
//! W = |k|^2 / 2        k = sum_e b_e s_e - k_0
//! ```
//!
//! Derivatives follow from `dn = -sum_k g_k (n . de_k)` with the dual vectors `g_k` of the sides in the triangle's plane.

use crate::{Mat3, Vec3};

/// Fraction of the length at rest that keeps the slope of a closed fold finite. The slope increases up to a fold of 145
/// degrees.
pub(super) const EASE: f64 = 0.01;

/// Square of twice the area of a triangle, relative to that at rest, below which its normal has no direction.
pub(super) const THIN: f64 = 1e-12;

/// Number of vectors on which the curvature of a triangle depends: three derivatives and two sides.
pub(super) const VECTORS: usize = 5;

/// The constants of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    /// The weights of the slopes at its sides (sqrt(J)): the square root of Kirchhoff's matrix times the curvature that
    /// a slope makes. Zero on a border.
    pub(super) weights: [Vec3; 3],
    /// Square of twice its area at rest (m^4).
    pub(super) square: f64,
}

/// A triangle in a state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bent {
    /// The weighted curvature less that at rest (sqrt(J)).
    pub(super) curvature: Vec3,
    n: Vec3,
    /// The dual vectors of the two sides (1/m).
    g: [Vec3; 2],
    theta: [Vec3; 3],
    /// One over the root.
    r: [f64; 3],
    /// `n . theta`
    tau: [f64; 3],
}

impl Bent {
    /// For each side, 1 if the derivative across it leads out of the triangle, and -1 if it leads into it.
    fn leads_out(&self) -> [f64; 3] {
        let [g1, g2] = self.g;
        let inward = [-g1 - g2, g1, g2];
        [0, 1, 2].map(|e| {
            let leads_in = self.theta[e].dot(&inward[e]) > 0.0;
            if leads_in { -1.0 } else { 1.0 }
        })
    }

    /// The slopes at the sides, out of the triangle: sines of the angles between the triangle and the sheet there.
    pub(super) fn outward_slopes(&self) -> [f64; 3] {
        let signs = self.leads_out();
        [0, 1, 2].map(|e| signs[e] * self.r[e] * self.tau[e])
    }
}

impl Facet {
    /// The triangle with these derivatives at its sides and these two sides (m). `rest` is its weighted curvature at rest
    /// (sqrt(J)).
    pub(super) fn bend(&self, theta: [Vec3; 3], [e1, e2]: [Vec3; 2], rest: Vec3) -> Bent {
        let normal = e1.cross(&e2);
        let square = normal.norm_squared().max(THIN * self.square);
        let n = normal / square.sqrt();
        let g = [e2.cross(&normal) / square, normal.cross(&e1) / square];
        let r = theta.map(|t| 1.0 / ((1.0 - EASE) * t.norm_squared() + EASE).sqrt());
        let tau = theta.map(|t| n.dot(&t));
        let slopes = (0..3).map(|e| self.weights[e] * (r[e] * tau[e]));
        Bent {
            curvature: slopes.sum::<Vec3>() - rest,
            n,
            g,
            theta,
            r,
            tau,
        }
    }

    /// The moments that the slopes feel (N m): the derivative of the energy by the slopes.
    fn moments(&self, bent: &Bent) -> [f64; 3] {
        self.weights.map(|weight| weight.dot(&bent.curvature))
    }

    /// The same moments for slopes that lead out of the triangle. Some derivatives lead into the triangle.
    pub(super) fn outward_moments(&self, bent: &Bent) -> [f64; 3] {
        let moments = self.moments(bent);
        let signs = bent.leads_out();
        [0, 1, 2].map(|e| moments[e] * signs[e])
    }

    /// The derivative of the energy by the five vectors.
    pub(super) fn gradient(&self, bent: &Bent) -> [Vec3; VECTORS] {
        let p = self.moments(bent);
        let slopes = bent.slopes();
        let mut gradient = [Vec3::zeros(); VECTORS];
        for (e, p) in p.into_iter().enumerate() {
            for (sum, slope) in gradient.iter_mut().zip(&slopes[e]) {
                *sum += slope * p;
            }
        }
        gradient
    }

    /// The derivatives of the three components of the weighted curvature by the five vectors. The Gauss-Newton part of
    /// the second derivatives is the sum of their outer products.
    pub(super) fn derivatives(&self, bent: &Bent) -> [[Vec3; VECTORS]; 3] {
        let slopes = bent.slopes();
        [0, 1, 2].map(|c| {
            let mut sum = [Vec3::zeros(); VECTORS];
            for (weight, slopes) in self.weights.iter().zip(&slopes) {
                for (sum, slope) in sum.iter_mut().zip(slopes) {
                    *sum += slope * weight[c];
                }
            }
            sum
        })
    }

    /// The other part of the second derivatives of the energy: the moments times the second derivatives of the slopes.
    pub(super) fn geometric(&self, bent: &Bent) -> [[Mat3; VECTORS]; VECTORS] {
        let (n, keep) = (bent.n, 1.0 - EASE);
        let mut all = [[Mat3::zeros(); VECTORS]; VECTORS];
        for (e, p) in self.moments(bent).into_iter().enumerate() {
            let (theta, r, tau) = (bent.theta[e], bent.r[e], bent.tau[e]);
            let rho = -keep * r * r * r;
            let sigma = 3.0 * keep * keep * r.powi(5);
            let mixed = theta * n.transpose();
            all[e][e] += (mixed + mixed.transpose()) * (p * rho)
                + theta * theta.transpose() * (p * tau * sigma)
                + Mat3::identity() * (p * tau * rho);
            let along = bent.g.map(|g| g.dot(&theta));
            for k in 0..2 {
                let g = bent.g[k];
                let block = (theta * (rho * along[k]) + g * r) * n.transpose() * -p;
                all[e][3 + k] += block;
                all[3 + k][e] += block.transpose();
                for l in 0..2 {
                    let other = bent.g[l];
                    all[3 + k][3 + l] += (n * g.transpose() * along[l]
                        + other * n.transpose() * along[k]
                        - n * n.transpose() * (tau * g.dot(&other)))
                        * (p * r);
                }
            }
        }
        all
    }
}

impl Bent {
    /// The derivatives of the three slopes by the five vectors.
    fn slopes(&self) -> [[Vec3; VECTORS]; 3] {
        [0, 1, 2].map(|e| {
            let (theta, r) = (self.theta[e], self.r[e]);
            let mut slope = [Vec3::zeros(); VECTORS];
            slope[e] = self.n * r - theta * ((1.0 - EASE) * r * r * r * self.tau[e]);
            for k in 0..2 {
                slope[3 + k] = self.n * (-r * self.g[k].dot(&theta));
            }
            slope
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1/2 and 1/2 without a pattern.
    fn vector(seed: usize) -> Vec3 {
        let value = |i: usize| f64::from(((seed * 3 + i) * 7919 % 1013) as u32) / 1013.0 - 0.5;
        Vec3::new(value(0), value(1), value(2))
    }

    fn facet() -> Facet {
        Facet {
            weights: [1, 2, 3].map(vector),
            square: 1.0,
        }
    }

    fn state(from: usize) -> [Vec3; VECTORS] {
        let [a, b, c] = [0, 1, 2].map(|i| vector(from + i) * 0.5);
        [
            Vec3::x() + a,
            Vec3::y() + b,
            c - Vec3::x() - Vec3::y(),
            Vec3::x() + vector(from + 3) * 0.5,
            Vec3::y() + vector(from + 4) * 0.5,
        ]
    }

    fn bend(facet: &Facet, v: &[Vec3; VECTORS]) -> Bent {
        facet.bend([v[0], v[1], v[2]], [v[3], v[4]], vector(4) * 0.3)
    }

    /// The derivatives against central differences, whose error is of the order of the square of the step, 1e-10.
    #[test]
    fn derivatives_are_those_of_the_energy() {
        let (facet, step) = (facet(), 1e-5);
        for from in [10, 20, 30, 40] {
            let v = state(from);
            let bent = bend(&facet, &v);
            let gradient = facet.gradient(&bent);
            let (z, geometric) = (facet.derivatives(&bent), facet.geometric(&bent));
            for a in 0..VECTORS {
                for i in 0..3 {
                    let moved = |by: f64| {
                        let mut v = v;
                        v[a][i] += by;
                        bend(&facet, &v)
                    };
                    let (low, high) = (moved(-step), moved(step));
                    let energy = |bent: &Bent| 0.5 * bent.curvature.norm_squared();
                    let slope = (energy(&high) - energy(&low)) / (2.0 * step);
                    assert!((slope - gradient[a][i]).abs() < 1e-8, "{a} {i}");
                    let (low, high) = (facet.gradient(&low), facet.gradient(&high));
                    for b in 0..VECTORS {
                        for j in 0..3 {
                            let expected = (high[b][j] - low[b][j]) / (2.0 * step);
                            let own: f64 = z.iter().map(|z| z[b][j] * z[a][i]).sum();
                            let found = own + geometric[b][a][(j, i)];
                            assert!((found - expected).abs() < 1e-8, "{b} {j} {a} {i}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_closed_fold_keeps_a_finite_slope_that_increases_up_to_145_degrees() {
        let facet = Facet {
            weights: [Vec3::x(), Vec3::zeros(), Vec3::zeros()],
            square: 1.0,
        };
        // The mean of the derivatives of two triangles that meet in a fold.
        let slope = |degrees: f64| {
            let fold = degrees.to_radians();
            let mean = (Vec3::y() + Vec3::y() * fold.cos() + Vec3::z() * fold.sin()) * 0.5;
            let sides = [Vec3::x(), Vec3::y()];
            facet.bend([mean; 3], sides, Vec3::zeros()).curvature.x
        };
        let slopes: Vec<f64> = (0..=180).map(|degrees| slope(f64::from(degrees))).collect();
        assert!(slopes[..146].windows(2).all(|two| two[1] > two[0]));
        // A right angle has the sine of 45 degrees, but for the ease.
        assert!((slopes[90] - (0.5_f64 / (1.0 + EASE)).sqrt()).abs() < 1e-12);
        assert!(slopes.iter().all(|slope| slope.abs() < 1.0));
    }
}
