//! The energy release rate at a tip: the energy that the sheet gives up for a unit of torn area.
//!
//! ```text
//! G = sum A e . (F^T P - W I) grad q                 the domain
//!   + sum q_i (F e)_i . f_i / t                      the vertices
//!   + sum L q W (e . n)                              the border
//! ```
//!
//! `A` is the area at rest, `e` the direction of the tear at rest, `F^T P - W I` minus Eshelby's tensor (Eshelby, "The
//! force on an elastic singularity", 1951; Rice, "A path independent integral", 1968; over a domain: Shih, Moran and
//! Nakamura, "Energy release rate along a three-dimensional crack front", 1986). `t` times the first sum is minus the
//! derivative of the elastic energy of the triangles as the vertices at rest move by `q e` and those in space stay,
//! exactly. `F` has three rows, so a sheet that is pulled out of its plane counts in full.
//!
//! **Vertices.** `f_i` is the force of the membrane on vertex `i` and `(F e)_i` the mean of the triangles at it. In
//! equilibrium without loads `f_i` is zero. Otherwise minus `f_i` is the sum of gravity, inertia, damping, bending and the
//! pairs that let go. The sum subtracts their work on the shift of the material, so `G` does not depend on the ring.
//!
//! **Border.** `n` is the outer normal at rest of an edge of length `L` that has no neighbour. The faces of a straight
//! tear are parallel to `e` and give nothing. A kink behind the tip or a border of the sheet within the rings does. The two
//! edges at the tip do not count: on the faces of a crack `W` has no part that grows towards the tip, but the triangles
//! there have one. If the path turns at the tip, it would add 3 to 5 % to `G`.
//!
//! The energy of bending is not in `W`; the sum over the vertices takes its forces as given loads. The share of bending is
//! in [`element::bending`](crate::element::bending), and is added when a tip moves on.

use super::fields::times;
use super::rings::{Laid, Patch};
use crate::topology::NONE;

/// The energy release rate of a tip (J/m^2), by its three sums.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Driving {
    /// The sum over triangles.
    pub domain: f64,
    /// The sum over vertices.
    pub vertices: f64,
    /// The sum over edges on a border.
    pub border: f64,
}

impl Driving {
    /// The energy release rate `G` (J/m^2).
    pub fn rate(&self) -> f64 {
        self.domain + self.vertices + self.border
    }
}

pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl Patch {
    /// The gradient of `q` in a triangle (1/m).
    pub(super) fn slope(&self, laid: &Laid, gradients: &[[f64; 2]; 3]) -> [f64; 2] {
        let mut slope = [0.0; 2];
        for (&place, g) in laid.corners.iter().zip(gradients) {
            let q = self.q(place);
            slope[0] += q * g[0];
            slope[1] += q * g[1];
        }
        slope
    }

    /// The energy release rate for a tear that grows along the direction of the tip. [`Patch::measure`] comes before.
    pub fn driving(&self) -> Driving {
        let e = self.along;
        let mut sums = Driving::default();
        for (laid, state) in self.triangles.iter().zip(&self.field.triangles) {
            // The stretch and the stress have the same axes, so F^T P = U S.
            let slope = self.slope(laid, &state.gradients);
            let s = times(&state.stress, slope);
            let strained = times(&state.strain, s);
            sums.domain +=
                state.area * (dot(e, s) + dot(e, strained) - state.density * dot(e, slope));
            self.border_of(laid, |length, normal, q, _| {
                sums.border += length * q * state.density * dot(e, normal);
            });
        }
        for node in &self.field.nodes {
            let fe = node.f[0] * e[0] + node.f[1] * e[1];
            sums.vertices += fe.dot(&node.force) / node.area;
        }
        sums
    }

    /// The elastic energy of the membrane in the triangles of the patch, over the thickness (J/m).
    /// [`Patch::measure`] comes before.
    pub(crate) fn energy(&self) -> f64 {
        let energies = self.field.triangles.iter();
        energies.map(|state| state.area * state.density).sum()
    }

    /// Calls `visit` with length (m), outer normal, mean of `q` and ends (m) of each edge of a triangle on a border, but for
    /// the two edges at the tip.
    pub(super) fn border_of(
        &self,
        laid: &Laid,
        mut visit: impl FnMut(f64, [f64; 2], f64, [[f64; 2]; 2]),
    ) {
        for side in 0..3 {
            let (from, to) = ((side + 1) % 3, (side + 2) % 3);
            let q = 0.5 * (self.q(laid.corners[from]) + self.q(laid.corners[to]));
            let at_tip = laid.corners[from] == 0 || laid.corners[to] == 0;
            if laid.neighbours[side] != NONE || q == 0.0 || at_tip {
                continue;
            }
            let (a, b) = (laid.shape[from], laid.shape[to]);
            let edge = [b[0] - a[0], b[1] - a[1]];
            let length = libm::hypot(edge[0], edge[1]);
            visit(length, [edge[1] / length, -edge[0] / length], q, [a, b]);
        }
    }
}
