//! A body: its state, and the quantities that can be read from it.
//!
//! The nodes are the vertices in the mesh's order, whatever handles and supports there are. Only the ghosts of clamped
//! borders come after them. State, model and constraints are by node.
//! Solvers order the rows of their matrices by [places](Places): free nodes first, then the nodes of each handle.
//!
//! - `topology`, `state`, `constraints`, `model`: the parts of a body. `assembly`: the data that solvers work with.
//! - `edit`: edits of a sheet that tears.
//! - `hold`: grab and release of handles, addition and lift of supports.
//! - [`border`]: hinged and clamped borders of sheets.
//! - [`handle`] and `support`: vertices that a hand holds, and vertices that are guided along some axes.
//! - `build`: the construction of a body at rest from a mesh, materials and handles. `exchange`: the replacement of a
//!   moving body by one of another material, with other handles and supports, or with another mesh.
//! - [`load`]: tractions as forces on vertices.
//! - `pieces`: sums over the pieces of a torn body.
//! - `energy`, `weight`, `memory`: sums over a body, and the memory that a body takes.
//! - `guard`: a bound on the energy at the end of a step.
//! - `rounding`: the uncertainty of positions, forces and energies that rounding causes.

mod assembly;
pub mod border;
mod build;
mod constraints;
mod edit;
#[cfg(test)]
mod edit_tests;
mod energy;
mod exchange;
pub(crate) mod guard;
pub mod handle;
mod hold;
pub mod load;
mod memory;
mod mesh;
mod model;
mod pieces;
pub(crate) mod rounding;
mod state;
pub(crate) mod support;
mod topology;
mod weight;

use assembly::Assembly;
use constraints::Constraints;
use model::Model;
use state::State;
use topology::Topology;

pub use build::{SheetLawName, SolidLaw};
pub use edit::BodyEdit;
pub use exchange::BodyMap;
pub use pieces::PieceSums;

use crate::Vec3;
use crate::body::handle::HandleReport;
use crate::element::elements::Elements;
use crate::error::BodyError;
use crate::linear::block_matrix::BlockMatrix;
use crate::linear::pcg::Budget;
use crate::linear::places::Places;
use crate::material::Tangent;

/// Gravity, damping and bending of a body, and the limits of its solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyConfig {
    /// Acceleration of gravity (m/s^2), a vector.
    pub gravity: Vec3,
    /// Rayleigh damping by mass, alpha (1/s), not negative.
    pub mass_damping: f64,
    /// Rayleigh damping by stiffness, beta (s), not negative.
    pub stiffness_damping: f64,
    /// Sheets: factor on the bending rigidity `E t^3 / (12 (1 - nu^2))`. Zero turns bending off, at no cost.
    pub bending: f64,
    /// The solver stops at this fraction of the residual of its initial guess.
    pub tolerance: f64,
    /// The solver stops below this residual (N).
    pub absolute_tolerance: f64,
    /// The solver stops after this many iterations.
    pub max_iterations: usize,
}

impl Default for BodyConfig {
    /// Earth's gravity along -z, no damping and no bending; the solver stops at 1e-6 of the residual of its guess.
    fn default() -> Self {
        Self {
            gravity: Vec3::new(0.0, 0.0, -9.81),
            mass_damping: 0.0,
            stiffness_damping: 0.0,
            bending: 0.0,
            tolerance: 1e-6,
            absolute_tolerance: 1e-12,
            max_iterations: 1000,
        }
    }
}

impl BodyConfig {
    pub(crate) fn check(&self) -> Result<(), BodyError> {
        let fields = [
            ("gravity", self.gravity.norm()),
            ("mass_damping", self.mass_damping),
            ("stiffness_damping", self.stiffness_damping),
            ("bending", self.bending),
            ("tolerance", self.tolerance),
            ("absolute_tolerance", self.absolute_tolerance),
        ];
        for (field, found) in fields {
            if !(found >= 0.0 && found.is_finite()) {
                let expected = "a finite number, not negative";
                return Err(BodyError::Config {
                    field,
                    found,
                    expected,
                });
            }
        }
        Ok(())
    }

    pub(crate) fn budget(&self) -> Budget {
        Budget {
            tolerance: self.tolerance,
            absolute_tolerance: self.absolute_tolerance,
            max_iterations: self.max_iterations,
        }
    }
}

/// A deformable body: a thread, a sheet or a solid, with handles and supports.
///
/// A step consists of [`assemble`](Self::assemble) and [`solve`](Self::solve). Neither allocates memory.
#[derive(Clone, Debug)]
pub struct Body {
    pub(crate) topology: Topology,
    pub(crate) state: State,
    pub(crate) constraints: Constraints,
    pub(crate) model: Model,
    pub(crate) assembly: Assembly,
    /// The surface of a sheet that can tear.
    sheet: Option<Box<edit::Sheet>>,
}

impl Body {
    /// Computes elastic forces and stiffness at the present state. The stiffness is clipped.
    pub fn assemble(&mut self) {
        self.assemble_with(Tangent::Clipped);
    }

    /// Computes elastic forces and stiffness at the present state, with the tangent of the given kind.
    pub fn assemble_with(&mut self, tangent: Tangent) {
        self.reassemble();
        self.assembly.internal.fill(Vec3::zeros());
        self.assembly.stiffness.clear();
        if let Some(bending) = &self.model.bending {
            bending.assemble(
                (&self.state.x, self.assembly.places.nodes()),
                tangent,
                &mut self.assembly.internal,
                &mut self.assembly.stiffness,
            );
        }
        for elements in &self.model.elements {
            elements.assemble(
                &self.state.x,
                tangent,
                &mut self.assembly.internal,
                &mut self.assembly.stiffness,
            );
        }
        self.assembly.at = Some(self.state.motions);
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.topology.vertex_count
    }

    /// Number of scalar unknowns of a solve: three per vertex, less those that handles and supports prescribe.
    pub fn unknown_count(&self) -> usize {
        let free = 3 * self.assembly.places.free();
        let mask = self.constraints.supports.mask().unwrap_or_default();
        let guided = mask.iter().flat_map(Vec3::iter).filter(|m| **m == 0.0);
        free - guided.count()
    }

    /// Number of elements, of all kinds together.
    pub fn element_count(&self) -> usize {
        self.model
            .elements
            .iter()
            .map(|elements| elements.count())
            .sum()
    }

    /// The elements, one set per kind, over [node positions](Self::node_positions).
    pub fn elements(&self) -> &[Box<dyn Elements>] {
        &self.model.elements
    }

    /// Number of elements that are inverted at present.
    pub fn inverted_count(&self) -> usize {
        self.model
            .elements
            .iter()
            .map(|set| set.inverted(&self.state.x))
            .sum()
    }

    /// Number of handles.
    pub fn handle_count(&self) -> usize {
        self.constraints.handles.len()
    }

    /// The report of the last step on a handle, or `None` past the last handle. Before the first step, the report holds
    /// the rest pose and no forces.
    pub fn handle_report(&self, handle: usize) -> Option<&HandleReport> {
        self.constraints
            .handles
            .get(handle)
            .map(|handle| &handle.report)
    }

    /// The configuration of the body.
    pub fn config(&self) -> &BodyConfig {
        &self.model.config
    }

    /// Replaces the limits of the solver.
    ///
    /// # Errors
    ///
    /// [`BodyError::Config`] for a tolerance that is negative or not finite.
    pub fn set_budget(&mut self, budget: Budget) -> Result<(), BodyError> {
        let config = BodyConfig {
            tolerance: budget.tolerance,
            absolute_tolerance: budget.absolute_tolerance,
            max_iterations: budget.max_iterations,
            ..self.model.config
        };
        config.check()?;
        self.model.config = config;
        Ok(())
    }

    /// The stiffness that was assembled last, by [place](Self::places).
    pub fn stiffness(&self) -> &BlockMatrix {
        &self.assembly.stiffness
    }

    /// The places of the nodes in the [stiffness](Self::stiffness).
    pub fn places(&self) -> &Places {
        &self.assembly.places
    }

    /// Positions (m) by node: the vertices, then the ghosts of clamped [borders](border).
    pub fn node_positions(&self) -> &[Vec3] {
        &self.state.x
    }

    /// Masses (kg) by node. A ghost of a clamped border has none.
    pub fn node_masses(&self) -> &[f64] {
        &self.model.mass
    }

    /// Positions of the vertices (m).
    pub fn positions(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        self.of_vertices(&self.state.x)
    }

    /// Velocities of the vertices (m/s).
    pub fn velocities(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        self.of_vertices(&self.state.v)
    }

    /// Elastic forces on the vertices at the state in which [`assemble`](Self::assemble) last ran (N).
    pub fn internal_forces(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        self.of_vertices(&self.assembly.internal)
    }

    /// Those of `values` by node that belong to vertices.
    fn of_vertices<'a>(&self, values: &'a [Vec3]) -> impl ExactSizeIterator<Item = Vec3> + 'a {
        values[..self.topology.vertex_count].iter().copied()
    }

    /// Replaces the positions (m), one per vertex. The vertices of a handle return to its pose in the next step.
    ///
    /// # Errors
    ///
    /// [`BodyError::Length`] or [`BodyError::NotFinite`]; nothing has changed then.
    pub fn set_positions(&mut self, positions: &[Vec3]) -> Result<(), BodyError> {
        check_vectors("positions", positions, self.topology.vertex_count)?;
        self.state.x[..positions.len()].copy_from_slice(positions);
        self.forget_promise();
        self.state.revision += 1;
        self.state.motions += 1;
        Ok(())
    }

    /// Replaces the velocities (m/s), one per vertex.
    ///
    /// # Errors
    ///
    /// [`BodyError::Length`] or [`BodyError::NotFinite`]; nothing has changed then.
    pub fn set_velocities(&mut self, velocities: &[Vec3]) -> Result<(), BodyError> {
        check_vectors("velocities", velocities, self.topology.vertex_count)?;
        self.state.v[..velocities.len()].copy_from_slice(velocities);
        self.forget_promise();
        self.state.revision += 1;
        Ok(())
    }

    /// Sets a constant force (N) on each vertex, in addition to gravity.
    ///
    /// # Errors
    ///
    /// [`BodyError::Length`] or [`BodyError::NotFinite`]; nothing has changed then.
    pub fn set_external_forces(&mut self, forces: &[Vec3]) -> Result<(), BodyError> {
        check_vectors("external forces", forces, self.topology.vertex_count)?;
        self.model.external[..forces.len()].copy_from_slice(forces);
        self.state.revision += 1;
        for (external, &load) in self.model.external.iter_mut().zip(&self.model.load) {
            *external += self.model.config.gravity * load;
        }
        Ok(())
    }

    /// Sets the fraction of gravity and of the external forces that acts. The fraction is 1 at first; load steps raise
    /// it from 0.
    ///
    /// # Errors
    ///
    /// [`BodyError::Config`] for a fraction that is not finite.
    pub fn set_load_factor(&mut self, factor: f64) -> Result<(), BodyError> {
        if !factor.is_finite() {
            return Err(BodyError::Config {
                field: "load_factor",
                found: factor,
                expected: "a finite number",
            });
        }
        self.model.load_factor = factor;
        self.state.revision += 1;
        Ok(())
    }

    /// Displaces a support by `displacement` (m) from the place at which it was added. The next solve moves its
    /// vertices there. Components along axes that the support does not guide have no effect.
    ///
    /// # Errors
    ///
    /// [`BodyError::Support`] for a support that does not exist or a displacement that is not finite.
    pub fn set_support(&mut self, support: usize, displacement: Vec3) -> Result<(), BodyError> {
        let fail = |found| Err(BodyError::Support { support, found });
        if !displacement.iter().all(|c| c.is_finite()) {
            return fail("its displacement is not finite");
        }
        match self.constraints.supports.list.get_mut(support) {
            Some(entry) => {
                entry.displacement = displacement;
                self.state.revision += 1;
            }
            None => return fail("it does not exist"),
        }
        Ok(())
    }

    /// Number of supports.
    pub fn support_count(&self) -> usize {
        self.constraints.supports.list.len()
    }

    /// Force of a support on the body along the guided axes in the last solve (N), or `None` past the last support.
    pub fn support_reaction(&self, support: usize) -> Option<Vec3> {
        self.constraints
            .supports
            .list
            .get(support)
            .map(|s| s.reaction)
    }
}

fn check_vectors(
    quantity: &'static str,
    values: &[Vec3],
    expected: usize,
) -> Result<(), BodyError> {
    if values.len() != expected {
        return Err(BodyError::Length {
            quantity,
            found: values.len(),
            expected,
        });
    }
    match values
        .iter()
        .position(|value| !value.iter().all(|c| c.is_finite()))
    {
        Some(vertex) => Err(BodyError::NotFinite { quantity, vertex }),
        None => Ok(()),
    }
}
