//! The elements of a body, linearized at a state of the body: forces, tangent and energy.

use super::RUN;
use super::correct::turned;
use super::places::Places;
use crate::Vec3;
use crate::body::Body;
use crate::element::parts::Divided;
use crate::element::precision::Precision;
use crate::lanes::{Node, to_node};
use crate::team::{self, Team};

/// The elements, with forces and tangent at a state of the body.
#[derive(Debug)]
pub(crate) struct Linearized<T> {
    pub(crate) sets: Vec<Divided<T>>,
    /// The state: positions (m) by node, and displacements from rest (m) by place.
    pub(crate) at: Vec<Vec3>,
    pub(crate) d: Vec<Node<T>>,
    /// Elastic forces by place (N).
    pub(crate) force: Vec<Node<T>>,
    /// Elastic energy (J).
    pub(super) energy: f64,
    /// Elastic energy (J) above which elements may be inverted.
    pub(super) turned: f64,
    /// Number of linearizations.
    pub(crate) count: u64,
}

impl<T: Precision> Linearized<T> {
    /// The elements `sets` of `body`, which are not linearized yet.
    pub(super) fn new(body: &Body, sets: Vec<Divided<T>>, places: &Places<T>) -> Self {
        let mut at = Vec::with_capacity(places.of.capacity());
        at.resize(places.of.len(), Vec3::repeat(f64::NAN));
        let zeros = vec![[T::ZERO; 4]; places.node.len()];
        Self {
            sets,
            at,
            d: zeros.clone(),
            force: zeros,
            energy: 0.0,
            turned: turned(body),
            count: 0,
        }
    }

    /// Computes forces, tangent and energy at the positions `at`.
    pub(super) fn linearize(&mut self, team: &dyn Team, places: &Places<T>) {
        let at = &self.at;
        let nodes = (&mut *self.d, &*places.rest, &*places.node);
        team::each_of(team, nodes, RUN, &|(d, rest, nodes)| {
            for ((d, rest), &node) in d.iter_mut().zip(rest).zip(nodes) {
                *d = to_node(&(at[node as usize] - rest));
            }
        });
        self.count += 1;
        self.linearize_here(team);
    }

    /// Computes forces, tangent and energy at the displacements `d`.
    pub(super) fn linearize_here(&mut self, team: &dyn Team) {
        self.force.fill([T::ZERO; 4]);
        self.energy = 0.0;
        for set in &mut self.sets {
            self.energy += set.linearize(team, &self.d, &mut self.force);
        }
    }

    /// Adds `factor` times the product of the tangent with `u` (m) to `y` (N).
    pub(crate) fn product(&mut self, team: &dyn Team, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        for set in &mut self.sets {
            set.product(team, factor, u, y);
        }
    }
}
