//! The sheet: its construction, its state and what can be read from it.
//!
//! Nodes are the vertices renumbered, free ones first in the mesh's order, then those of each handle.
//! Everything public counts vertices, in the mesh's order.

use super::bending::{self, Bending};
use super::block_matrix::{BlockMatrix, ElementSlots};
use super::error::SheetError;
use super::handle::{Handle, HandleReport, HandleSpec};
use super::material::Material;
use super::membrane::{Membrane, rest_frame};
use super::pcg::{Budget, Pcg};
use crate::Vec3;
use crate::mesh::TriMesh;

/// How a sheet moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetConfig {
    /// Acceleration of gravity (m/s^2), a vector.
    pub gravity: Vec3,
    /// Rayleigh damping by mass, alpha (1/s), not negative.
    pub mass_damping: f64,
    /// Rayleigh damping by stiffness, beta (s), not negative.
    pub stiffness_damping: f64,
    /// Factor on the bending rigidity `E t^3 / (12 (1 - nu^2))`; 0 leaves bending out and costs nothing.
    pub bending: f64,
    /// The solver stops at this share of the residual of its guess.
    pub tolerance: f64,
    /// The solver stops below this residual (N).
    pub absolute_tolerance: f64,
    /// The solver stops after this many iterations.
    pub max_iterations: usize,
}

impl Default for SheetConfig {
    /// Earth's gravity along -z, no damping, no bending; residual down to 1e-6 of the guess's.
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

impl SheetConfig {
    fn check(&self) -> Result<(), SheetError> {
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
                return Err(SheetError::Config {
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

/// A deformable sheet with handles.
///
/// A step is [`assemble`](Self::assemble), then [`solve`](Self::solve). Neither allocates.
#[derive(Clone, Debug)]
pub struct Sheet {
    pub(crate) config: SheetConfig,
    node_of_vertex: Vec<u32>,
    membrane: Membrane,
    bending: Option<Bending>,
    slots: Vec<ElementSlots>,
    pub(crate) stiffness: BlockMatrix,
    pub(crate) handles: Vec<Handle>,

    // State and constants by node.
    pub(crate) x: Vec<Vec3>,
    pub(crate) v: Vec<Vec3>,
    pub(crate) mass: Vec<f64>,
    /// Gravity and what the host adds (N).
    pub(crate) external: Vec<Vec3>,
    /// Elastic forces where `assemble` last ran (N).
    pub(crate) internal: Vec<Vec3>,

    // What a step writes.
    pub(crate) displacement: Vec<Vec3>,
    pub(crate) pcg: Pcg,
    /// Force of the hand on each handle node less the node's inertia, in the last step (N).
    pub(crate) grip: Vec<Vec3>,
    /// Whether stiffness and internal forces are those of the present state.
    pub(crate) fresh: bool,
    /// Whether `assemble` has ever run.
    pub(crate) assembled: bool,
}

impl Sheet {
    /// A sheet at rest in the shape of `mesh`.
    ///
    /// `materials` holds one for all triangles or one for each. `handles` may be empty: a free sheet.
    ///
    /// # Errors
    ///
    /// [`SheetError`], for a mesh, material, configuration or handle that cannot be simulated; it says
    /// which and why.
    pub fn new(
        mesh: &TriMesh,
        materials: &[Material],
        config: SheetConfig,
        handles: &[HandleSpec],
    ) -> Result<Self, SheetError> {
        config.check()?;
        check_mesh(mesh, materials)?;
        let material = |triangle: usize| materials[if materials.len() == 1 { 0 } else { triangle }];
        let count = mesh.positions.len();
        let (node_of_vertex, free) = number_nodes(count, handles)?;
        let node = |vertex: u32| node_of_vertex[vertex as usize];

        let mut membrane = Membrane::with_capacity(mesh.triangles.len());
        let mut mass = vec![0.0; count];
        for (triangle, vertices) in mesh.triangles.iter().enumerate() {
            let corners = vertices.map(|vertex| &mesh.positions[vertex as usize]);
            let Some((gradients, area)) = rest_frame(corners) else {
                return Err(degenerate(triangle, corners));
            };
            let material = material(triangle);
            membrane.push(vertices.map(node), gradients, area, &material);
            for &vertex in vertices {
                mass[node(vertex) as usize] += material.density * material.thickness * area / 3.0;
            }
        }
        if let Some(vertex) = (0..count).find(|&vertex| mass[node(vertex as u32) as usize] == 0.0) {
            return Err(SheetError::Unreferenced { vertex });
        }

        let mut patches = Vec::new();
        if config.bending > 0.0 {
            patches = bending::patches(&mesh.positions, &mesh.triangles, material, config.bending)?;
            for patch in &mut patches {
                for vertex in &mut patch.vertices {
                    *vertex = node(*vertex);
                }
            }
        }
        let cliques = membrane.nodes().iter().map(<[u32; 3]>::as_slice);
        let cliques = cliques.chain(patches.iter().map(|patch| patch.vertices.as_slice()));
        let stiffness = BlockMatrix::new(count, free, cliques);
        let slots = membrane
            .nodes()
            .iter()
            .filter_map(|&nodes| stiffness.element_slots(nodes))
            .collect();
        let bending = (config.bending > 0.0).then(|| Bending::new(&stiffness, &patches));

        let mut x = vec![Vec3::zeros(); count];
        for (vertex, &position) in mesh.positions.iter().enumerate() {
            x[node(vertex as u32) as usize] = position;
        }
        let mut first = free;
        let handles: Vec<Handle> = handles
            .iter()
            .map(|spec| {
                let offset = |&vertex: &u32| mesh.positions[vertex as usize] - spec.origin;
                let handle = Handle::new(first, spec.vertices.iter().map(offset).collect(), spec);
                first += spec.vertices.len();
                handle
            })
            .collect();
        Ok(Self {
            config,
            node_of_vertex,
            membrane,
            bending,
            slots,
            stiffness,
            handles,
            x,
            v: vec![Vec3::zeros(); count],
            external: mass.iter().map(|&mass| config.gravity * mass).collect(),
            mass,
            internal: vec![Vec3::zeros(); count],
            displacement: vec![Vec3::zeros(); count],
            pcg: Pcg::new(free),
            grip: vec![Vec3::zeros(); count - free],
            fresh: false,
            assembled: false,
        })
    }

    /// Computes elastic forces and stiffness at the present state.
    pub fn assemble(&mut self) {
        self.internal.fill(Vec3::zeros());
        if let Some(bending) = &self.bending {
            self.stiffness.load_scalar(bending.weights());
            bending.add_force(&self.stiffness, &self.x, &mut self.internal);
        } else {
            self.stiffness.clear();
        }
        self.membrane.assemble(
            &self.x,
            &self.slots,
            &mut self.internal,
            &mut self.stiffness,
        );
        self.fresh = true;
        self.assembled = true;
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.x.len()
    }

    /// Number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.membrane.len()
    }

    /// Number of handles.
    pub fn handle_count(&self) -> usize {
        self.handles.len()
    }

    /// What the last step did at a handle, or `None` past the last. Before any step: the rest pose and
    /// no forces.
    pub fn handle_report(&self, handle: usize) -> Option<&HandleReport> {
        self.handles.get(handle).map(|handle| &handle.report)
    }

    /// The configuration.
    pub fn config(&self) -> &SheetConfig {
        &self.config
    }

    /// Replaces what stops the solver.
    ///
    /// # Errors
    ///
    /// [`SheetError::Config`] for a tolerance that is negative or not finite.
    pub fn set_budget(&mut self, budget: Budget) -> Result<(), SheetError> {
        let config = SheetConfig {
            tolerance: budget.tolerance,
            absolute_tolerance: budget.absolute_tolerance,
            max_iterations: budget.max_iterations,
            ..self.config
        };
        config.check()?;
        self.config = config;
        Ok(())
    }

    /// The triangles, for energies, stretches and tangents over [node positions](Self::node_positions).
    pub fn membrane(&self) -> &Membrane {
        &self.membrane
    }

    /// The stiffness as last assembled, by node.
    pub fn stiffness(&self) -> &BlockMatrix {
        &self.stiffness
    }

    /// The node that a vertex became, or `None` past the last vertex.
    pub fn node(&self, vertex: usize) -> Option<usize> {
        self.node_of_vertex.get(vertex).map(|&node| node as usize)
    }

    /// Positions (m) by node.
    pub fn node_positions(&self) -> &[Vec3] {
        &self.x
    }

    /// Masses (kg) by node.
    pub fn node_masses(&self) -> &[f64] {
        &self.mass
    }

    fn by_vertex<'a>(&'a self, values: &'a [Vec3]) -> impl ExactSizeIterator<Item = Vec3> + 'a {
        self.node_of_vertex
            .iter()
            .map(|&node| values[node as usize])
    }

    /// Positions of the vertices (m).
    pub fn positions(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        self.by_vertex(&self.x)
    }

    /// Velocities of the vertices (m/s).
    pub fn velocities(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        self.by_vertex(&self.v)
    }

    /// Elastic forces on the vertices where [`assemble`](Self::assemble) last ran (N).
    pub fn internal_forces(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        self.by_vertex(&self.internal)
    }

    /// Replaces positions (m), one per vertex. Vertices of a handle return to its pose in the next step.
    ///
    /// # Errors
    ///
    /// [`SheetError::Length`] or [`SheetError::NotFinite`]; nothing is changed then.
    pub fn set_positions(&mut self, positions: &[Vec3]) -> Result<(), SheetError> {
        check_vectors("positions", positions, self.x.len())?;
        scatter(&self.node_of_vertex, positions, &mut self.x);
        self.fresh = false;
        Ok(())
    }

    /// Replaces velocities (m/s), one per vertex.
    ///
    /// # Errors
    ///
    /// [`SheetError::Length`] or [`SheetError::NotFinite`]; nothing is changed then.
    pub fn set_velocities(&mut self, velocities: &[Vec3]) -> Result<(), SheetError> {
        check_vectors("velocities", velocities, self.x.len())?;
        scatter(&self.node_of_vertex, velocities, &mut self.v);
        Ok(())
    }

    /// Sets a constant force (N) on each vertex, beside gravity.
    ///
    /// # Errors
    ///
    /// [`SheetError::Length`] or [`SheetError::NotFinite`]; nothing is changed then.
    pub fn set_external_forces(&mut self, forces: &[Vec3]) -> Result<(), SheetError> {
        check_vectors("external forces", forces, self.x.len())?;
        scatter(&self.node_of_vertex, forces, &mut self.external);
        for (external, &mass) in self.external.iter_mut().zip(&self.mass) {
            *external += self.config.gravity * mass;
        }
        Ok(())
    }

    /// Total mass (kg).
    pub fn total_mass(&self) -> f64 {
        self.mass.iter().sum()
    }

    /// Linear momentum (kg m/s).
    pub fn momentum(&self) -> Vec3 {
        let mut sum = Vec3::zeros();
        for (v, &mass) in self.v.iter().zip(&self.mass) {
            sum += v * mass;
        }
        sum
    }

    /// Gravity and the host's forces together (N).
    pub fn total_external_force(&self) -> Vec3 {
        self.external.iter().sum()
    }

    /// Kinetic energy (J).
    pub fn kinetic_energy(&self) -> f64 {
        self.v
            .iter()
            .zip(&self.mass)
            .map(|(v, &mass)| 0.5 * mass * v.norm_squared())
            .sum()
    }

    /// Stretching and bending energy (J) at the present state.
    pub fn elastic_energy(&self) -> f64 {
        self.membrane.energy(&self.x) + self.bending_energy()
    }

    /// Bending energy (J) at the present state; 0 without bending.
    pub fn bending_energy(&self) -> f64 {
        self.bending
            .as_ref()
            .map_or(0.0, |bending| bending.energy(&self.stiffness, &self.x))
    }

    /// Principal stretches of a triangle at the present state, the larger first; `None` past the last.
    pub fn principal_stretches(&self, triangle: usize) -> Option<[f64; 2]> {
        (triangle < self.membrane.len())
            .then(|| self.membrane.principal_stretches(triangle, &self.x))
    }
}

fn scatter(node_of_vertex: &[u32], values: &[Vec3], nodes: &mut [Vec3]) {
    for (&node, value) in node_of_vertex.iter().zip(values) {
        nodes[node as usize] = *value;
    }
}

fn check_vectors(what: &'static str, values: &[Vec3], expected: usize) -> Result<(), SheetError> {
    if values.len() != expected {
        return Err(SheetError::Length {
            what,
            found: values.len(),
            expected,
        });
    }
    match values
        .iter()
        .position(|value| !value.iter().all(|c| c.is_finite()))
    {
        Some(vertex) => Err(SheetError::NotFinite { what, vertex }),
        None => Ok(()),
    }
}

fn check_mesh(mesh: &TriMesh, materials: &[Material]) -> Result<(), SheetError> {
    let count = mesh.positions.len();
    let triangles = mesh.triangles.len();
    if triangles == 0 {
        return Err(SheetError::Empty);
    }
    if materials.len() != 1 && materials.len() != triangles {
        return Err(SheetError::MaterialCount {
            found: materials.len(),
            triangles,
        });
    }
    for (triangle, material) in materials.iter().enumerate() {
        material.check(triangle)?;
    }
    if let Some(vertex) = mesh
        .positions
        .iter()
        .position(|position| !position.iter().all(|c| c.is_finite()))
    {
        return Err(SheetError::Position { vertex });
    }
    for (triangle, vertices) in mesh.triangles.iter().enumerate() {
        if let Some(&vertex) = vertices.iter().find(|&&vertex| vertex as usize >= count) {
            return Err(SheetError::TriangleVertex {
                triangle,
                vertex,
                count,
            });
        }
    }
    Ok(())
}

fn degenerate(triangle: usize, x: [&Vec3; 3]) -> SheetError {
    let (e1, e2) = (x[1] - x[0], x[2] - x[0]);
    SheetError::Degenerate {
        triangle,
        area: 0.5 * e1.cross(&e2).norm(),
        edge: e1.norm().max(e2.norm()).max((e2 - e1).norm()),
    }
}

/// The node of each vertex, and how many nodes are free.
fn number_nodes(count: usize, handles: &[HandleSpec]) -> Result<(Vec<u32>, usize), SheetError> {
    let mut holder = vec![None; count];
    let mut held = 0;
    for (handle, spec) in handles.iter().enumerate() {
        if spec.vertices.is_empty() {
            return Err(SheetError::EmptyHandle { handle });
        }
        if !spec.origin.iter().all(|c| c.is_finite()) {
            return Err(SheetError::HandleOrigin { handle });
        }
        for &vertex in &spec.vertices {
            let Some(entry) = holder.get_mut(vertex as usize) else {
                return Err(SheetError::HandleVertex {
                    handle,
                    vertex,
                    count,
                });
            };
            if let Some(first) = entry.replace(handle) {
                return Err(SheetError::SharedVertex {
                    vertex,
                    first,
                    second: handle,
                });
            }
            held += 1;
        }
    }
    let free = count - held;
    let mut nodes = vec![0; count];
    let unheld = (0..count as u32).filter(|&vertex| holder[vertex as usize].is_none());
    let in_handles = handles
        .iter()
        .flat_map(|spec| spec.vertices.iter().copied());
    for (node, vertex) in unheld.chain(in_handles).enumerate() {
        nodes[vertex as usize] = node as u32;
    }
    Ok((nodes, free))
}
