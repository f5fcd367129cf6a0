//! The data that solvers of the assembled equations work with, and the results of a step that the next step needs.

use super::guard::Guard;
use super::model::Model;
use super::topology::Topology;
use crate::Vec3;
use crate::element::bending::Bending;
use crate::linear::block_matrix::BlockMatrix;
use crate::linear::pcg::Pcg;

/// The assembled equations and the working memory of a step, by node, for one topology epoch.
#[derive(Clone, Debug)]
pub(crate) struct Assembly {
    pub(crate) stiffness: BlockMatrix,
    /// Elastic forces at the state in which `assemble` last ran (N).
    pub(crate) internal: Vec<Vec3>,
    /// Displacement over the step (m).
    pub(crate) displacement: Vec<Vec3>,
    pub(crate) pcg: Pcg,
    /// Force of the hand on each handle node, less the node's inertia, in the last step (N).
    pub(crate) grip: Vec<Vec3>,
    /// The elastic forces that the last step's linearization predicted for its end (N). `promised_over` is the length
    /// of that step (s), if the whole step was taken.
    pub(crate) promised: Vec<Vec3>,
    pub(crate) promised_over: Option<f64>,
    /// The rate of change of the forces along the motion that the tangent does not predict (N/s); zero where it is
    /// unknown.
    pub(crate) missed: Vec<Vec3>,
    pub(crate) guard: Guard,
    /// Positions at the end of the step, before the step is taken (m).
    pub(crate) ahead: Vec<Vec3>,
    /// Whether stiffness and internal forces are those of the present state.
    pub(crate) fresh: bool,
    /// Whether `assemble` has ever run.
    pub(crate) assembled: bool,
}

impl Assembly {
    /// Builds the matrix pattern of `model`'s elements, whose nodes are already those of `topology`. The `free` free
    /// nodes come before the nodes of handles. Binds the elements to their blocks, and builds the bending model.
    pub(crate) fn new(model: &mut Model, topology: &Topology, free: usize) -> Self {
        let count = topology.node_of_vertex.len();
        let rest: Vec<Vec3> = topology
            .node_of_vertex
            .iter()
            .map(|&node| model.rest[node as usize])
            .collect();
        let bent = model.bent.as_ref();
        let mut patches = bent.map_or_else(Vec::new, |sheet| sheet.patches(&rest));
        for vertex in patches.iter_mut().flat_map(|patch| &mut patch.vertices) {
            *vertex = topology.node_of_vertex[*vertex as usize];
        }
        let cliques = model
            .elements
            .iter()
            .flat_map(|set| (0..set.count()).map(|element| set.nodes(element)))
            .chain(patches.iter().map(|patch| patch.vertices.as_slice()));
        let stiffness = BlockMatrix::new(count, free, cliques);
        for set in &mut model.elements {
            set.bind(&stiffness);
        }
        model.bending = (!patches.is_empty()).then(|| Bending::new(&stiffness, &patches));
        let zeros = vec![Vec3::zeros(); count];
        Self {
            stiffness,
            internal: zeros.clone(),
            displacement: zeros.clone(),
            pcg: Pcg::new(free),
            grip: vec![Vec3::zeros(); count - free],
            promised: zeros.clone(),
            promised_over: None,
            missed: zeros.clone(),
            guard: Guard::default(),
            ahead: zeros,
            fresh: false,
            assembled: false,
        }
    }
}
