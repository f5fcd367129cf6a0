//! The assembled equations of a body, and the data that their solvers work with.

use super::constraints::Constraints;
use super::model::Model;
use crate::Vec3;
use crate::element::bending::Bending;
use crate::linear::block_matrix::BlockMatrix;
use crate::linear::pcg::{Budget, Pcg, SolveReport};
use crate::linear::places::Places;
use crate::linear::step_matrix::StepMatrix;

/// The assembled equations and the working memory of a step, for one topology epoch. `stiffness`,
/// `mass`, `mask` and `pcg` are by place; the other vectors are by node.
#[derive(Clone, Debug)]
pub(crate) struct Assembly {
    pub(crate) places: Places,
    pub(crate) stiffness: BlockMatrix,
    /// Lumped mass by place (kg).
    pub(crate) mass: Vec<f64>,
    /// By free place and axis: 1 if the axis is free, 0 if a support guides it. The mask is empty without
    /// supports.
    mask: Vec<Vec3>,
    /// Elastic forces at the state in which `assemble` last ran (N).
    pub(crate) internal: Vec<Vec3>,
    pub(crate) pcg: Pcg,
    /// The elastic forces that the last step's linearization predicted for its end (N). `promised_over` is the length
    /// of that step (s), if the whole step was taken.
    pub(crate) promised: Vec<Vec3>,
    pub(crate) promised_over: Option<f64>,
    /// The rate of change of the forces along the motion that the tangent does not predict (N/s); zero if it is
    /// unknown.
    pub(crate) missed: Vec<Vec3>,
    /// Positions at the end of the step, before the step is taken (m). During a solve, the displacement by place.
    pub(crate) ahead: Vec<Vec3>,
    /// The number of motions of the body at which `assemble` last ran, or `None` before.
    pub(crate) at: Option<u64>,
}

impl Assembly {
    /// Builds the matrix pattern of `model`'s elements for the present `constraints`. Binds the elements to their
    /// blocks, and builds the bending model.
    pub(crate) fn new(model: &mut Model, constraints: &Constraints) -> Self {
        let places = constraints.places();
        let (count, free) = (model.rest.len(), places.free());
        let bent = model.bent.as_ref();
        let ghosts = constraints.clamps().map(|clamp| (clamp.side, clamp.ghost));
        let bending = bent.map(|sheet| {
            sheet.bending(&model.rest, ghosts, |nodes| {
                constraints.prescribe_all(nodes)
            })
        });
        let mut bending = bending.filter(|bending| !bending.is_empty());
        let patches = bending.as_ref().map(Bending::patches).unwrap_or_default();
        let cliques = model
            .elements
            .iter()
            .flat_map(|set| (0..set.count()).map(|element| set.nodes(element)))
            .chain(patches.iter().map(Vec::as_slice));
        let stiffness = BlockMatrix::with_places(&places, cliques);
        let place = places.of_nodes();
        for set in &mut model.elements {
            set.bind(&stiffness, place);
        }
        if let Some(bending) = &mut bending {
            bending.renumber(place);
        }
        model.bending = bending;
        let zeros = vec![Vec3::zeros(); count];
        let mut assembly = Self {
            mass: places.gather(&model.mass),
            mask: Vec::new(),
            places,
            stiffness,
            internal: zeros.clone(),
            pcg: Pcg::new(free),
            promised: zeros.clone(),
            promised_over: None,
            missed: zeros.clone(),
            ahead: zeros,
            at: None,
        };
        assembly.guide(constraints);
        assembly
    }

    /// Takes the mask of the present supports.
    pub(crate) fn guide(&mut self, constraints: &Constraints) {
        self.mask = constraints.supports.mask().map_or_else(Vec::new, |mask| {
            let free = self.places.free_nodes();
            free.map(|node| mask[node]).collect()
        });
    }

    /// By free place and axis: 1 if it is free, 0 if it is guided; `None` without supports.
    pub(crate) fn mask(&self) -> Option<&[Vec3]> {
        (!self.mask.is_empty()).then_some(&self.mask)
    }

    /// The row of the stiffness at a node times `x`, which is by node.
    #[inline]
    pub(crate) fn row_product(&self, node: usize, x: &[Vec3]) -> Vec3 {
        let nodes = self.places.nodes();
        self.stiffness
            .row_product_of(self.places.of(node), |place| &x[nodes[place] as usize])
    }

    /// Improves the `displacement` of the free nodes by conjugate gradients. The residual in `pcg` is that of
    /// `displacement`. The factors are those of mass and stiffness in the matrix.
    pub(crate) fn solve(
        &mut self,
        displacement: &mut [Vec3],
        factors: (f64, f64),
        budget: &Budget,
    ) -> SolveReport {
        let (mass_factor, stiffness_factor) = factors;
        let u = &mut self.ahead[..self.places.free()];
        for (u, node) in u.iter_mut().zip(self.places.free_nodes()) {
            *u = displacement[node];
        }
        let matrix = StepMatrix {
            stiffness: &self.stiffness,
            mass: &self.mass,
            stiffness_factor,
            mass_factor,
            mask: (!self.mask.is_empty()).then_some(&self.mask),
        };
        let report = self.pcg.solve(&matrix, u, budget);
        for (u, node) in u.iter().zip(self.places.free_nodes()) {
            displacement[node] = *u;
        }
        report
    }

    /// Memory of the assembly (bytes).
    pub(crate) fn bytes(&self) -> usize {
        let vectors = [
            &self.mask,
            &self.internal,
            &self.promised,
            &self.missed,
            &self.ahead,
        ];
        let vectors: usize = vectors.iter().map(|v| size_of_val(v.as_slice())).sum();
        self.places.bytes()
            + self.stiffness.bytes()
            + size_of_val(self.mass.as_slice())
            + vectors
            + self.pcg.bytes()
    }
}
