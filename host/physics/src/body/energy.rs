//! Sums over a body: mass, momentum and energy.

use super::Body;
use crate::tear::Patch;
use crate::{Mat3, Vec3};

impl Body {
    /// Total mass (kg).
    pub fn total_mass(&self) -> f64 {
        let nodes = self.constraints.nodes();
        nodes.map(|node| self.model.mass[node]).sum()
    }

    /// Linear momentum (kg m/s).
    pub fn momentum(&self) -> Vec3 {
        let mut sum = Vec3::zeros();
        for node in self.constraints.nodes() {
            sum += self.state.v[node] * self.model.mass[node];
        }
        sum
    }

    /// Sum of gravity and the external forces, times the load factor (N).
    pub fn total_external_force(&self) -> Vec3 {
        let nodes = self.constraints.nodes();
        let external = nodes.map(|node| self.model.external[node]);
        external.sum::<Vec3>() * self.model.load_factor
    }

    /// Kinetic energy (J).
    pub fn kinetic_energy(&self) -> f64 {
        self.kinetic_energy_of(|node| self.state.v[node])
    }

    /// Kinetic energy (J) for the velocity `v` of each node (m/s).
    pub(crate) fn kinetic_energy_of(&self, v: impl Fn(usize) -> Vec3) -> f64 {
        let energy = |node: usize| 0.5 * self.model.mass[node] * v(node).norm_squared();
        self.constraints.nodes().map(energy).sum()
    }

    /// Elastic energy (J) at the present state, with bending.
    pub fn elastic_energy(&self) -> f64 {
        self.elastic_energy_at(&self.state.x)
    }

    /// Elastic energy (J) at positions `x` (m) by node, with bending.
    pub(crate) fn elastic_energy_at(&self, x: &[Vec3]) -> f64 {
        let bending = self.model.bending.as_ref();
        let bending = bending.map_or(0.0, |bending| {
            bending.energy(x, self.assembly.places.nodes())
        });
        self.model
            .elements
            .iter()
            .map(|set| set.energy(x))
            .sum::<f64>()
            + bending
    }

    /// Whether the body resists bending.
    pub fn bends(&self) -> bool {
        self.model.bending.is_some()
    }

    /// The stress (Pa) that bending adds at present to an element's [stress](crate::Elements::stress) on the face at the
    /// side of its normal, in world axes; zero for a body without bending. The other face has the opposite stress.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn bending_stress(&self, element: usize) -> Mat3 {
        match (&self.model.bent, &self.model.bending) {
            (Some(sheet), Some(bending)) => sheet.stress(
                element,
                bending,
                (&self.model.rest, &self.state.x),
                self.assembly.places.nodes(),
            ),
            _ => Mat3::zeros(),
        }
    }

    /// Bending energy (J) at the present state; 0 for a body without bending.
    pub fn bending_energy(&self) -> f64 {
        self.model.bending.as_ref().map_or(0.0, |bending| {
            bending.energy(&self.state.x, self.assembly.places.nodes())
        })
    }

    /// The bending energy that the sheet gives up for a unit of length by which the tear of `patch` grows (J/m); 0 for a
    /// body without bending.
    pub(crate) fn bending_release(&self, patch: &mut Patch) -> f64 {
        match (&self.model.bent, &self.model.bending) {
            (Some(sheet), Some(bending)) => {
                sheet.release(bending, patch, &self.state.x, self.assembly.places.nodes())
            }
            _ => 0.0,
        }
    }

    /// Potential energy (J) of gravity and the external forces at the present state, times the load factor: minus their
    /// work from the origin.
    pub fn load_potential(&self) -> f64 {
        self.load_potential_at(&self.state.x)
    }

    /// Potential energy (J) of the loads at positions `x` (m) by node.
    pub(crate) fn load_potential_at(&self, x: &[Vec3]) -> f64 {
        let work = |node: usize| self.model.external[node].dot(&x[node]);
        -self.model.load_factor * self.constraints.nodes().map(work).sum::<f64>()
    }

    /// Sum of kinetic energy, elastic energy and potential energy of the loads (J).
    pub fn total_energy(&self) -> f64 {
        self.kinetic_energy() + self.elastic_energy() + self.load_potential()
    }
}
