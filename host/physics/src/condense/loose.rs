//! The pieces of a body that nothing holds, and their rigid motions.
//!
//! A loose piece goes on by its inertia. Its six rigid motions `R` about its centre of mass are taken with unit kinetic energy,
//! `R^T M R = I`. A force moves them by its component `R^T f` alone, whatever the elements are: the displacement of a piece under a force
//! is the sum of a rigid motion, which is known exactly, and of a deformation `u` with `R^T M u = 0`.

use crate::body::Body;
use crate::{Mat3, Vec3};

/// The number of rigid motions of a piece.
pub(super) const MOTIONS: usize = 6;
/// The least moment of inertia of a piece about an axis, as a fraction of its largest one, with which it can turn about this axis.
const LEAST_MOMENT: f64 = 1e-9;
/// No piece.
const NONE: u32 = u32::MAX;

/// The loose pieces of a body.
#[derive(Clone, Debug, Default)]
pub(super) struct Loose {
    /// The loose piece of each node, or [`NONE`].
    of: Vec<u32>,
    pieces: Vec<Piece>,
}

/// A loose piece at the present positions.
#[derive(Clone, Copy, Debug, Default)]
struct Piece {
    mass: f64,
    centre: Vec3,
    /// `I^(-1/2)`, with the moments of inertia `I` about the centre (kg^(-1/2)/m).
    root: Mat3,
}

impl Loose {
    /// Finds the pieces of a body without a node that a handle holds or a support guides.
    pub(super) fn find(&mut self, body: &Body, is_held: &dyn Fn(u32) -> bool) {
        let count = body.state.x.len();
        // Each node leads to another one of its piece, and at last to the first node of the piece.
        let mut first: Vec<u32> = (0..count as u32).collect();
        for set in body.elements() {
            for element in 0..set.count() {
                let nodes = set.nodes(element);
                for pair in nodes.windows(2) {
                    let [one, other] = [pair[0], pair[1]].map(|node| root(&mut first, node));
                    let [low, high] = [one.min(other), one.max(other)];
                    first[high as usize] = low;
                }
            }
        }
        let mut are_held = vec![false; count];
        for node in 0..count as u32 {
            let first = root(&mut first, node);
            are_held[first as usize] |= is_held(node);
        }
        self.of.clear();
        self.of.resize(count, NONE);
        self.pieces.clear();
        for node in 0..count as u32 {
            let first = root(&mut first, node);
            if are_held[first as usize] {
                continue;
            }
            if first == node {
                self.of[node as usize] = self.pieces.len() as u32;
                self.pieces.push(Piece::default());
            }
            self.of[node as usize] = self.of[first as usize];
        }
    }

    /// Takes the present positions of the nodes.
    pub(super) fn place(&mut self, body: &Body) {
        let (x, mass) = (&body.state.x, &body.model.mass);
        self.pieces.fill(Piece::default());
        for ((of, x), mass) in self.of.iter().zip(x).zip(mass) {
            if let Some(piece) = self.pieces.get_mut(*of as usize) {
                piece.mass += mass;
                piece.centre += x * *mass;
            }
        }
        let mut moments = vec![Mat3::zeros(); self.pieces.len()];
        for piece in &mut self.pieces {
            piece.centre /= piece.mass.max(f64::MIN_POSITIVE);
        }
        for ((of, x), mass) in self.of.iter().zip(x).zip(mass) {
            if let Some(piece) = self.pieces.get(*of as usize) {
                let arm = x - piece.centre;
                let turned =
                    Mat3::from_diagonal_element(arm.norm_squared()) - arm * arm.transpose();
                moments[*of as usize] += turned * *mass;
            }
        }
        for (piece, moments) in self.pieces.iter_mut().zip(&moments) {
            let parts = moments.symmetric_eigen();
            let least = LEAST_MOMENT * parts.eigenvalues.max();
            let each = parts.eigenvalues.iter();
            let each = each.zip(parts.eigenvectors.column_iter());
            let turns = each.filter(|(moment, _)| **moment > least);
            piece.root = turns
                .map(|(moment, axis)| axis * axis.transpose() / moment.sqrt())
                .sum();
        }
    }

    /// The number of pieces.
    pub(super) fn count(&self) -> usize {
        self.pieces.len()
    }

    /// The piece of a node.
    pub(super) fn of(&self, node: u32) -> Option<usize> {
        let of = self.of.get(node as usize).copied();
        of.filter(|of| *of != NONE).map(|of| of as usize)
    }

    /// Adds the components `R^T f` of a force on a node (N) to those of its piece (N/kg^(1/2)).
    pub(super) fn add_components(
        &self,
        x: &[Vec3],
        (node, force): (u32, &Vec3),
        components: &mut [[f64; MOTIONS]],
    ) {
        let Some(of) = self.of(node) else { return };
        let piece = &self.pieces[of];
        let along = force / piece.mass.max(f64::MIN_POSITIVE).sqrt();
        let about = piece.root * (x[node as usize] - piece.centre).cross(force);
        for (component, more) in components[of]
            .iter_mut()
            .zip(along.iter().chain(about.iter()))
        {
            *component += more;
        }
    }

    /// Adds the rigid motions with these components (m kg^(1/2)), by piece, to a displacement of all nodes.
    pub(super) fn add(&self, x: &[Vec3], components: &[[f64; MOTIONS]], shape: &mut [Vec3]) {
        let ways = self.pieces.iter().zip(components).map(|(piece, own)| {
            let [a, b, c, d, e, f] = *own;
            let along = Vec3::new(a, b, c) / piece.mass.max(f64::MIN_POSITIVE).sqrt();
            (along, piece.root * Vec3::new(d, e, f), piece.centre)
        });
        let ways: Vec<_> = ways.collect();
        for ((of, x), shape) in self.of.iter().zip(x).zip(shape) {
            if let Some((along, about, centre)) = ways.get(*of as usize) {
                *shape += along + about.cross(&(x - centre));
            }
        }
    }
}

/// The first node of the piece of a node. The ways of the nodes to it become shorter.
fn root(first: &mut [u32], node: u32) -> u32 {
    let mut at = node;
    while first[at as usize] != at {
        let next = first[first[at as usize] as usize];
        first[at as usize] = next;
        at = next;
    }
    at
}
