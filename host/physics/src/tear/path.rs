//! The path of a tear: stress intensities by interaction integrals, and the angle by which the tear turns.
//!
//! The field about the tip is superposed with a known field of pure mode I or II (Williams, "On the stress distribution
//! at the base of a stationary crack", 1957). The mixed part of the energy release rate of both together,
//!
//! ```text
//! I = sum A (sigma_ij v_i,1 + s_ij u_i,1 - s_ij eps_ij delta_1j) q,j      K = E I / 2
//! ```
//!
//! gives the intensity of that mode (Yau, Wang and Corten, "A mixed-mode crack analysis of isotropic solids using
//! conservation laws of elasticity", 1980; plane stress). `u`, `eps`, `sigma` are of the sheet, `v`, `s` of the known
//! field of intensity 1; direction 1 is that of the tear. Both stress and gradient of displacement are taken in the plane
//! of the patch, with the turn of the sheet in space taken out (see [`fields`](super::fields)). As for
//! [`driving`](super::driving), two further sums subtract the forces at vertices and the border within the rings. The
//! known field is that of straight faces. Within the rings behind a kink it is continued past the angle pi.
//!
//! Forces at vertices on a face count as part of the tip. They are those of the pairs behind the tip that let go: they
//! hold the faces together and hide the tip from the load, as the cohesive zone of a sharp tip does. The path follows the
//! field about this zone.
//!
//! Triangles of constant strain act like a tip that lies about half an edge behind its vertex. Both intensities err by this
//! shift (in a clamped strip of 6 to 16 cells across by 11 to 4 %), their ratio much less: use the ratio for the path and
//! [`Driving`](super::Driving) for the energy.
//!
//! The tear turns to where the stress about the tip is largest and free of shear: the angle `a` with
//! `K_I sin a + K_II (3 cos a - 1) = 0` (Erdogan and Sih, "On the crack extension in plates under plane loading and
//! transverse shear", 1963).

use super::driving::dot;
use super::fields::{contract, times};
use super::rings::Patch;
use super::strength::Symmetric;

/// The largest factor [by the turn](Intensity::by_turn), for `K_II = sqrt(3) K_I`. In pure sliding the factor is 4/3.
pub const MOST_BY_TURN: f64 = 27.0 / 16.0;

/// Stress intensities at a tip (Pa m^(1/2)).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Intensity {
    /// The intensity of the opening mode, `K_I`.
    pub k1: f64,
    /// The intensity of the sliding mode, `K_II`. It is positive if the face on the left of the tear's direction slides along this
    /// direction.
    pub k2: f64,
}

impl Intensity {
    /// The angle by which the tear turns (rad), counterclockwise. It lies within 70.53 degrees of straight ahead while
    /// `K_I` is not negative. Of the two roots this one has the larger stress across the new direction, and tension.
    pub fn kink(&self) -> f64 {
        let root = libm::sqrt(self.k1 * self.k1 + 8.0 * self.k2 * self.k2);
        // tan(a / 2) = (K_I - root) / (4 K_II), without the difference.
        2.0 * libm::atan2(-2.0 * self.k2, self.k1 + root)
    }

    /// The factor by which a tear that turns is driven more than straight ahead: the square of the intensity of the largest
    /// hoop stress, over the sum of the squares of both intensities. The tear starts when that intensity is `K_I` of a tear
    /// that starts straight ahead (Erdogan and Sih 1963). The factor is between 1 and [`MOST_BY_TURN`] while `K_I` is not
    /// negative; 1 without a stress.
    pub fn by_turn(&self) -> f64 {
        let (half, both) = (0.5 * self.kink(), self.k1.powi(2) + self.k2.powi(2));
        let (sine, cosine) = (libm::sin(half), libm::cos(half));
        let hoop = cosine * cosine * (self.k1 * cosine - 3.0 * self.k2 * sine);
        if both > 0.0 { hoop * hoop / both } else { 1.0 }
    }

    /// The energy release rate that belongs to these intensities, straight ahead (J/m^2).
    pub fn rate(&self, young: f64) -> f64 {
        (self.k1 * self.k1 + self.k2 * self.k2) / young
    }
}

/// The known field of one mode at a point: stress, and the derivative of the displacement along the tear.
struct Known {
    stress: Symmetric,
    slope: [f64; 2],
}

/// The fields of modes I and II of intensity 1 at distance `r` (m) and angle `theta` (rad) from the tip.
fn known(r: f64, theta: f64, young: f64, poisson: f64) -> [Known; 2] {
    let (c, s) = (libm::cos(0.5 * theta), libm::sin(0.5 * theta));
    let (c3, s3) = (libm::cos(1.5 * theta), libm::sin(1.5 * theta));
    let (cosine, sine) = (libm::cos(theta), libm::sin(theta));
    let a = 1.0 / libm::sqrt(core::f64::consts::TAU * r);
    let first = [
        a * c * (1.0 - s * s3),
        a * c * s * c3,
        a * c * (1.0 + s * s3),
    ];
    let second = [
        -a * s * (2.0 + c * c3),
        a * c * (1.0 - s * s3),
        a * s * c * c3,
    ];
    // The displacement is b sqrt(r) g(theta) / sqrt(2 pi). Its derivative by x is
    // b (cos(theta) g / 2 - sin(theta) g') / sqrt(2 pi r).
    let kappa = (3.0 - poisson) / (1.0 + poisson);
    let b = a * (1.0 + poisson) / young;
    let derivative = |g: f64, slope: f64| b * (0.5 * cosine * g - sine * slope);
    let opening = [
        derivative(c * (kappa - cosine), -0.5 * s * (kappa - cosine) + c * sine),
        derivative(s * (kappa - cosine), 0.5 * c * (kappa - cosine) + s * sine),
    ];
    let sliding = [
        derivative(
            s * (kappa + 2.0 + cosine),
            0.5 * c * (kappa + 2.0 + cosine) - s * sine,
        ),
        derivative(
            -c * (kappa - 2.0 + cosine),
            0.5 * s * (kappa - 2.0 + cosine) + c * sine,
        ),
    ];
    [
        Known {
            stress: first,
            slope: opening,
        },
        Known {
            stress: second,
            slope: sliding,
        },
    ]
}

/// Weights of the corners at the three points of a triangle at which the known field is taken. They are inside, so none
/// lies on a face of the tear.
const POINTS: [[f64; 3]; 3] = [
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
];

/// Gauss's two points of an edge.
const HALVES: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

impl Patch {
    /// The known fields at `point` (m) of the triangle at `place`.
    fn known_at(&self, place: usize, point: [f64; 2]) -> [Known; 2] {
        let r = libm::hypot(point[0], point[1]);
        let (young, poisson) = (self.field.young, self.field.poisson);
        known(r, self.angle_of(place, point), young, poisson)
    }

    /// A vector of the plane of the patch in axes along and across the tear.
    fn by_tear(&self, v: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.along;
        [c * v[0] + s * v[1], c * v[1] - s * v[0]]
    }

    /// The stress intensities at the tip. [`Patch::measure`] comes before.
    pub fn intensity(&self) -> Intensity {
        let mut sums = [0.0; 2];
        for (place, (laid, state)) in self.triangles.iter().zip(&self.field.triangles).enumerate() {
            let [c, s] = self.along;
            let [xx, xy, yy] = state.strain;
            let strain = [
                c * c * xx + 2.0 * c * s * xy + s * s * yy,
                c * s * (yy - xx) + (c * c - s * s) * xy,
                s * s * xx - 2.0 * c * s * xy + c * c * yy,
            ];
            let slope_in_plane = self.slope(laid, &state.gradients);
            let displacement = self.by_tear(state.displacement(self.along));
            if slope_in_plane != [0.0; 2] {
                let traction = self.by_tear(state.traction(slope_in_plane));
                let slope = self.by_tear(slope_in_plane);
                for weights in POINTS {
                    let point =
                        [0, 1].map(|j| (0..3).map(|k| weights[k] * laid.shape[k][j]).sum::<f64>());
                    for (sum, known) in sums.iter_mut().zip(self.known_at(place, point)) {
                        let own = times(&known.stress, slope);
                        *sum += state.area / 3.0
                            * (dot(traction, known.slope) + dot(own, displacement)
                                - contract(&known.stress, &strain) * slope[0]);
                    }
                }
            }
            self.border_of(laid, |length, normal, q, [a, b]| {
                let normal = self.by_tear(normal);
                for half in HALVES {
                    let point = [0, 1].map(|j| a[j] + half * (b[j] - a[j]));
                    for (sum, known) in sums.iter_mut().zip(self.known_at(place, point)) {
                        let own = times(&known.stress, normal);
                        *sum += 0.5
                            * length
                            * q
                            * (contract(&known.stress, &strain) * normal[0]
                                - dot(own, displacement));
                    }
                }
            });
            // The known field has no value at the tip. The force on it takes part through the other corners alone.
            for (k, &corner) in laid.corners.iter().enumerate() {
                let node = self.field.nodes.get(corner as usize);
                if corner == 0 || node.is_none_or(|node| node.on_border) {
                    continue;
                }
                let g = state.gradients[k];
                let force = self.by_tear(state.traction(g)).map(|f| -state.area * f);
                for (sum, known) in sums.iter_mut().zip(self.known_at(place, laid.shape[k])) {
                    *sum += dot(force, known.slope);
                }
            }
        }
        let [k1, k2] = sums.map(|sum| 0.5 * self.field.young * sum);
        Intensity { k1, k2 }
    }
}
