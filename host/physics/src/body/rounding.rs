//! The uncertainty of positions, forces and energies that rounding causes.
//!
//! A coordinate `x` is stored with an error of `eps |x|`. Elements compute from differences of positions. The entries
//! of their deformation gradient are about one and have an error of `eps`, as if the nodes had an error of `eps` times
//! the length of their edges. The sum of both errors is the uncertainty of a node's place. The uncertainty of a force
//! is the matrix times that of the places; the uncertainty of an energy is the work of the forces over that of the
//! places. The distance of a body from the origin therefore enters exactly as it enters rounding. No body is so stiff
//! that its forces are taken for rounding because of the stiffness alone.

use super::Body;
use crate::Vec3;

/// A few times the unit of rounding, 1.1e-16: the sum of the errors over the entries of a gradient and over the
/// elements at a node.
const ROUNDING: f64 = 1e-15;
/// Energies are sums over elements, and each sum rounds.
const SUMS: f64 = 1e-13;

/// The lengths on which a body's rounding depends, for one topology.
#[derive(Clone, Debug)]
pub(crate) struct Rounding {
    /// By free place, the largest distance at rest to a node of the same element (m).
    reach: Vec<f64>,
}

/// The error by rounding of a change of energy (J).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lost {
    /// Twice the elastic energy of the uncertainty of all places.
    pub(crate) elastic: f64,
    /// The rounding error of the elements' energies at the present state. A law may be a difference of terms as large
    /// as its modulus, whatever the strain.
    pub(crate) elements: f64,
    /// Work of the other forces over the uncertainty of all places.
    pub(crate) work: f64,
}

/// The largest distance at rest from the node at a place to a node of the same element (m).
pub(crate) fn reach(body: &Body, place: usize) -> f64 {
    let (columns, _) = body.assembly.stiffness.row(place);
    let rest = |place: usize| body.model.rest[body.assembly.places.node(place)];
    let at = rest(place);
    let distance = |column: &u32| (rest(*column as usize) - at).amax();
    columns.iter().map(distance).fold(0.0, f64::max)
}

impl Rounding {
    pub(crate) fn new(body: &Body) -> Self {
        let free = 0..body.assembly.places.free();
        Self {
            reach: free.map(|place| reach(body, place)).collect(),
        }
    }

    /// Uncertainty of the position of the node at a free place (m).
    pub(crate) fn of_position(&self, body: &Body, place: usize) -> f64 {
        let x = &body.state.x[body.assembly.places.node(place)];
        ROUNDING * (x.amax() + self.reach[place])
    }

    /// The rounding error of the energy of the elements at the node at a free place, which has this stiffness (J).
    pub(crate) fn of_element(&self, place: usize, stiffness: f64) -> f64 {
        ROUNDING * stiffness * self.reach[place] * self.reach[place]
    }

    /// Norm of the residual that rounding may cause (N), for a matrix `mass M + stiffness K`.
    pub(crate) fn of_forces(&self, body: &Body, mass: f64, stiffness: f64) -> f64 {
        let square = |place: usize| {
            let matrix = body.assembly.stiffness.diagonal(place).amax() * stiffness
                + body.assembly.mass[place] * mass;
            // Neighbours are as uncertain as the node itself.
            let force = 2.0 * matrix * self.of_position(body, place);
            force * force
        };
        libm::sqrt((0..self.reach.len()).map(square).sum())
    }
}

impl Lost {
    /// The error by rounding of a change of energy from the elastic energy `elastic` (J). The work of the forces over a
    /// motion is at most twice the geometric mean of the body's energy and the motion's energy (Cauchy and Schwarz, for
    /// a quadratic energy).
    pub(crate) fn of_energy(self, elastic: f64) -> f64 {
        let elastic = elastic.abs();
        SUMS * elastic
            + libm::sqrt(2.0 * elastic * self.elastic)
            + self.elastic
            + self.elements
            + self.work
    }
}

impl Body {
    /// The largest displacement of a node from rest along an axis (m).
    pub(crate) fn moved(&self) -> f64 {
        let places = self.state.x.iter().zip(&self.model.rest);
        places
            .map(|(x, rest)| (x - rest).amax())
            .fold(0.0, f64::max)
    }

    /// Longest edge of the box around the body at rest (m).
    pub(crate) fn size(&self) -> f64 {
        let corner = |pick: fn(f64, f64) -> f64| {
            let first = self.model.rest.first().copied().unwrap_or_default();
            self.model
                .rest
                .iter()
                .fold(first, |corner: Vec3, x| corner.zip_map(x, pick))
        };
        (corner(f64::max) - corner(f64::min)).amax()
    }
}
