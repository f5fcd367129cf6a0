//! Forces, energy and stiffness of the bending of a sheet, triangle by triangle.

use super::NONE;
use super::curvature::{Bent, Facet};
use super::patch::Sided;
use super::scalar::ScalarMatrix;
use super::tear::Tear;
use crate::Vec3;
use crate::linear::block_matrix::BlockMatrix;
use crate::material::Tangent;

/// The bending of a sheet over the rows of a matrix, or over vertices before there is a matrix.
#[derive(Debug)]
pub(crate) struct Bending {
    /// The derivatives of the position across the inner edges of the sheet: for each edge, vertices and their weights
    /// (1/m).
    pub(super) rotations: ScalarMatrix<f64>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// The rotations at the sides of each triangle, or [`NONE`] on a border.
    pub(super) sides: Vec<[u32; 3]>,
    pub(super) facets: Vec<Facet>,
    /// The weighted curvature of each triangle at rest (sqrt(J)); empty if all are exactly zero.
    pub(super) rest: Vec<Vec3>,
    /// What is needed to follow the edits of a sheet that can tear.
    pub(super) tear: Option<Box<Tear>>,
}

impl Bending {
    /// The bending of no triangles, with these rotations.
    pub(super) fn new(rotations: ScalarMatrix<f64>) -> Self {
        Self {
            rotations,
            triangles: Vec::new(),
            sides: Vec::new(),
            facets: Vec::new(),
            rest: Vec::new(),
            tear: None,
        }
    }

    /// Adds a triangle, whose rotations are `sides`, with zero curvature at rest.
    pub(super) fn push(&mut self, triangle: [u32; 3], sides: [u32; 3], facet: Facet) {
        self.triangles.push(triangle);
        self.sides.push(sides);
        self.facets.push(facet);
        if !self.rest.is_empty() {
            self.rest.push(Vec3::zeros());
        }
    }

    /// Makes the curvature of a triangle with these derivatives and these sides (m) its curvature at rest. A triangle whose
    /// stiffness, the trace of its matrix, would be more than `stiffest` (N/m) is made softer.
    pub(super) fn rest(
        &mut self,
        triangle: usize,
        (theta, sides): ([Vec3; 3], [Vec3; 2]),
        stiffest: f64,
    ) {
        let bent = self.facets[triangle].bend(theta, sides, Vec3::zeros());
        let facet = &self.facets[triangle];
        let stiffness = self.sided(triangle).trace(&facet.derivatives(&bent));
        let mut curvature = bent.curvature;
        if stiffness > stiffest {
            let factor = (stiffest / stiffness).sqrt();
            let facet = &mut self.facets[triangle];
            facet.weights = facet.weights.map(|weight| weight * factor);
            curvature *= factor;
        }
        if curvature != Vec3::zeros() {
            self.rest.resize(self.facets.len(), Vec3::zeros());
        }
        if let Some(rest) = self.rest.get_mut(triangle) {
            *rest = curvature;
        }
    }

    /// Whether there is nothing that bends.
    pub(crate) fn is_empty(&self) -> bool {
        self.facets.is_empty()
    }

    /// The vertices on which the curvature of each triangle depends.
    pub(crate) fn patches(&self) -> Vec<Vec<u32>> {
        let triangles = 0..self.facets.len();
        triangles.map(|t| self.sided(t).vertices()).collect()
    }

    /// Replaces each vertex by its place.
    pub(crate) fn renumber(&mut self, place: &[u32]) {
        self.rotations.renumber(place);
        for vertex in self.triangles.iter_mut().flatten() {
            *vertex = place[*vertex as usize];
        }
    }

    /// The weighted curvature of a triangle at rest (sqrt(J)).
    pub(super) fn rest_curvature(&self, triangle: usize) -> Vec3 {
        self.rest.get(triangle).copied().unwrap_or_default()
    }

    pub(super) fn sided(&self, triangle: usize) -> Sided<'_, f64> {
        Sided {
            rotations: &self.rotations,
            corners: self.triangles[triangle],
            sides: self.sides[triangle].map(|edge| (edge != NONE).then_some(edge)),
        }
    }

    /// The derivatives across the sides of a triangle and its sides, at the positions `x` of vertices (m).
    pub(super) fn vectors(
        &self,
        triangle: usize,
        x: impl Fn(u32) -> Vec3,
    ) -> ([Vec3; 3], [Vec3; 2]) {
        let [x0, x1, x2] = self.triangles[triangle].map(&x);
        let theta = self.sides[triangle].map(|edge| {
            if edge == NONE {
                return Vec3::zeros();
            }
            let row = self.rotations.row(edge as usize);
            // Differences keep the digits of a sheet far from the origin.
            row.map(|(vertex, weight)| (x(vertex) - x0) * weight).sum()
        });
        (theta, [x1 - x0, x2 - x0])
    }

    pub(super) fn bent(&self, triangle: usize, x: impl Fn(u32) -> Vec3) -> Bent {
        let (theta, sides) = self.vectors(triangle, x);
        self.facets[triangle].bend(theta, sides, self.rest_curvature(triangle))
    }

    /// Adds the bending force (N) at node positions `x` (m) to `force`, and the tangent (N/m) to `stiffness`. `nodes` is
    /// the node of each row of the matrix. A clipped tangent is that of Gauss and Newton.
    pub(crate) fn assemble(
        &self,
        (x, nodes): (&[Vec3], &[u32]),
        tangent: Tangent,
        force: &mut [Vec3],
        stiffness: &mut BlockMatrix,
    ) {
        let node = |vertex: u32| nodes[vertex as usize] as usize;
        for (triangle, facet) in self.facets.iter().enumerate() {
            let bent = self.bent(triangle, |vertex| x[node(vertex)]);
            let gradient = facet.gradient(&bent);
            for (&edge, gradient) in self.sides[triangle].iter().zip(&gradient) {
                if edge != NONE {
                    for (vertex, weight) in self.rotations.row(edge as usize) {
                        force[node(vertex)] -= gradient * weight;
                    }
                }
            }
            let [n0, n1, n2] = self.triangles[triangle].map(node);
            force[n0] += gradient[3] + gradient[4];
            force[n1] -= gradient[3];
            force[n2] -= gradient[4];
            let others = (tangent == Tangent::Exact).then(|| facet.geometric(&bent));
            let derivatives = facet.derivatives(&bent);
            self.sided(triangle)
                .add_to(&derivatives, others.as_ref(), stiffness);
        }
    }

    /// The moments (N m) that outward slopes at the sides of a triangle feel, at node positions `x`.
    pub(super) fn moments(&self, triangle: usize, x: &[Vec3], nodes: &[u32]) -> [f64; 3] {
        let bent = self.bent(triangle, |vertex| x[nodes[vertex as usize] as usize]);
        self.facets[triangle].outward_moments(&bent)
    }

    /// Bending energy (J) at node positions `x`.
    pub(crate) fn energy(&self, x: &[Vec3], nodes: &[u32]) -> f64 {
        let bent = |triangle| self.bent(triangle, |vertex| x[nodes[vertex as usize] as usize]);
        let squares = (0..self.facets.len()).map(|t| bent(t).curvature.norm_squared());
        0.5 * squares.sum::<f64>()
    }

    /// Number of triangles.
    pub(crate) fn count(&self) -> usize {
        self.facets.len()
    }

    /// Bending energy (J) of a triangle at node positions `x`.
    pub(crate) fn energy_of(&self, triangle: usize, x: &[Vec3], nodes: &[u32]) -> f64 {
        let bent = self.bent(triangle, |vertex| x[nodes[vertex as usize] as usize]);
        0.5 * bent.curvature.norm_squared()
    }

    /// Memory that it holds beside itself (bytes).
    pub(crate) fn bytes(&self) -> usize {
        self.rotations.bytes()
            + size_of_val(self.triangles.as_slice())
            + size_of_val(self.sides.as_slice())
            + size_of_val(self.facets.as_slice())
            + size_of_val(self.rest.as_slice())
            + self.tear.as_ref().map_or(0, |tear| tear.bytes())
    }
}
