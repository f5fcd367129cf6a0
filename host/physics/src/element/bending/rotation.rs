//! The rotation of a sheet about an edge: the normal derivative at the middle of the edge, from nearby vertices.
//!
//! A quadratic function on a plane has the normal derivative
//!
//! ```text
//! dw/dn = sum_j c_j w_j
//! ```
//!
//! at the middle of an edge, if the weights `c` reproduce the six quadratics. Of all such weights these are the nearest,
//! in the sum of squares, to those of the mean of the two triangles' gradients. That mean is exact already if the two
//! triangles are a parallelogram, so on a regular mesh only the four vertices of the two triangles have a weight. Else
//! the vertices of the neighbouring triangles join in.

use super::few::{Few, MOST_NEAR};
use super::sheet::BentSheet;
use super::unfold::{Nearby, nearby};
use crate::{Mat3, Vec3};

/// Weights whose squares sum to more than this value, relative to those of the mean, come from vertices near a common
/// conic, which hardly tell quadratics apart. They would make the sheet stiff in a short wave.
const LARGEST: f64 = 10.0;

/// Weights that miss the derivative of a quadratic by more than this value come from vertices on a common conic.
const EXACT: f64 = 1e-9;

/// Fraction of the mean diagonal of the normal equations that keeps them regular. On a strip of one row of cells no
/// vertices tell all quadratics apart, but the mean has the derivative of the quadratic that they do not see.
const REGULAR: f64 = 1e-12;

/// The same fraction if no vertices nearby give exact weights: the weights are then bounded.
const EASED: f64 = 1e-3;

/// One of the two triangles at an edge, by the index of its vertex across the edge.
#[derive(Clone, Copy, Debug)]
pub(super) enum Across {
    /// The triangle at y < 0.
    Before = 2,
    /// The triangle at y > 0.
    Beyond = 3,
}

/// The three quadratics at a place: those of unit curvature xx, xy and yy.
fn quadratic([x, y]: &[f64; 2]) -> Vec3 {
    Vec3::new(0.5 * x * x, x * y, 0.5 * y * y)
}

impl Nearby {
    /// The weights of the gradient of one triangle at the edge: of its ends and of the vertex across.
    fn one_sided(&self, across: Across) -> [(usize, f64); 3] {
        let [x, y] = self.at[across as usize];
        [
            (0, (x - 0.5) / y),
            (1, -(x + 0.5) / y),
            (across as usize, 1.0 / y),
        ]
    }

    /// The weights of the mean of the two triangles' gradients.
    fn mean(&self) -> Few<f64> {
        let mut weights = [0.0; MOST_NEAR];
        for across in [Across::Before, Across::Beyond] {
            for (index, weight) in self.one_sided(across) {
                weights[index] += 0.5 * weight;
            }
        }
        weights.into_iter().take(self.at.len()).collect()
    }

    /// For each vertex the three quadratics, less their best linear fit over all vertices.
    fn curved(&self) -> Option<Few<Vec3>> {
        let linear = |[x, y]: &[f64; 2]| Vec3::new(1.0, *x, *y);
        let (mut normal, mut mixed) = (Mat3::zeros(), Mat3::zeros());
        for at in self.at.iter() {
            normal += linear(at) * linear(at).transpose();
            mixed += linear(at) * quadratic(at).transpose();
        }
        let fit = normal.try_inverse()? * mixed;
        let rest = |at: &[f64; 2]| quadratic(at) - fit.transpose() * linear(at);
        Some(self.at.iter().map(rest).collect())
    }

    /// The weights nearest to the mean that reproduce quadratics, and whether they do so and are bounded. The normal
    /// equations are made regular by `fraction` of their mean diagonal.
    fn weights(&self, fraction: f64) -> (Few<f64>, bool) {
        let mean = self.mean();
        let Some(curved) = self.curved() else {
            return (mean, true);
        };
        // The normal derivative of a quadratic vanishes in the middle of the edge.
        let missed = |weights: &[f64]| -> Vec3 {
            let places = self.at.iter().zip(weights);
            places.map(|(at, weight)| quadratic(at) * *weight).sum()
        };
        let mut normal = Mat3::zeros();
        for curved in curved.iter() {
            normal += curved * curved.transpose();
        }
        let regular = Mat3::identity() * (normal.trace() / 3.0 * fraction);
        let Some(inverse) = (normal + regular).try_inverse() else {
            return (mean, true);
        };
        let factors = -(inverse * missed(&mean));
        let weights = mean.iter().zip(curved.iter());
        let weights: Few<f64> = weights.map(|(w, q)| w + q.dot(&factors)).collect();
        let squares = |weights: &[f64]| weights.iter().map(|w| w * w).sum::<f64>();
        let bounded = squares(&weights) <= LARGEST * squares(&mean);
        let exact = missed(&weights).amax() <= EXACT;
        (weights, bounded && exact)
    }
}

/// The weights of the normal derivative in one of the two triangles, times the length of the edge, by vertex.
pub(super) fn gradient(nearby: &Nearby, across: Across) -> Few<(u32, f64)> {
    let weights = nearby.one_sided(across);
    let by_vertex = weights.map(|(index, weight)| (nearby.vertices[index], weight));
    by_vertex.into_iter().collect()
}

/// The weights of the normal derivative, times the length of the edge, by vertex. `wider` gives more vertices, and is
/// called if `nearby` are near a conic.
pub(super) fn rotation(nearby: &Nearby, wider: impl FnOnce() -> Nearby) -> Few<(u32, f64)> {
    let (mut weights, good) = nearby.weights(REGULAR);
    let mut vertices = nearby.vertices;
    if !good {
        let wider = wider();
        let (exact, good) = wider.weights(REGULAR);
        weights = if good { exact } else { wider.weights(EASED).0 };
        vertices = wider.vertices;
    }
    let largest = weights.iter().fold(0.0, |most: f64, w| most.max(w.abs()));
    let pairs = vertices.iter().copied().zip(weights.iter().copied());
    // The remainder that rounding leaves of a zero would fill the matrix.
    pairs.filter(|(_, w)| w.abs() > 1e-12 * largest).collect()
}

/// The weights of the mean of the two triangles' gradients across side `k` of a triangle (1/m), by vertex.
pub(super) fn plain(sheet: &BentSheet, side: (usize, usize)) -> Few<(u32, f64)> {
    let near = nearby(sheet, &[], &[], side, 0);
    let length = sheet.length(side, &[]);
    let weights = near.mean();
    let pairs = near.vertices.iter().zip(weights.iter());
    pairs.map(|(&v, weight)| (v, weight / length)).collect()
}
