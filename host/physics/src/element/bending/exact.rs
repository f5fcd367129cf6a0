//! Forces, energy and stiffness of the bending of a sheet, triangle by triangle.
//!
//! Each triangle has a patch: the vertices on which its curvature depends, in ascending order, and for each of them the
//! weights in the derivatives across its three sides.

use super::curvature::{Bent, Facet, VECTORS};
use crate::linear::block_matrix::BlockMatrix;
use crate::material::Tangent;
use crate::{Mat3, Vec3};

/// Largest number of vertices of a patch: two triangles and two rings around each side.
const MOST: usize = 48;

/// Largest number of vertices of a patch with one ring around each side: almost all patches.
const USUAL: usize = 14;

/// The derivatives of the position across the inner edges of a sheet: for each edge, vertices and their weights (1/m).
#[derive(Clone, Debug)]
pub(super) struct Rotations {
    start: Vec<u32>,
    vertices: Vec<u32>,
    weights: Vec<f64>,
}

impl Default for Rotations {
    fn default() -> Self {
        Self {
            start: vec![0],
            vertices: Vec::new(),
            weights: Vec::new(),
        }
    }
}

impl Rotations {
    /// Adds an edge.
    pub(super) fn push(&mut self, weights: impl Iterator<Item = (u32, f64)>) {
        for (vertex, weight) in weights {
            self.vertices.push(vertex);
            self.weights.push(weight);
        }
        self.start.push(self.vertices.len() as u32);
    }

    /// Number of edges.
    pub(super) fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// The vertices of an edge and their weights.
    pub(super) fn row(&self, edge: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
        let range = self.start[edge] as usize..self.start[edge + 1] as usize;
        let vertices = self.vertices[range.clone()].iter().copied();
        vertices.zip(self.weights[range].iter().copied())
    }

    fn bytes(&self) -> usize {
        size_of_val(self.start.as_slice())
            + size_of_val(self.vertices.as_slice())
            + size_of_val(self.weights.as_slice())
    }
}

/// A patch.
struct Patch<'a> {
    vertices: &'a [u32],
    weights: &'a [[f64; 3]],
    /// The indices of the corners of the triangle among the vertices.
    corners: [usize; 3],
}

/// The bending of a sheet over the rows of a matrix, or over vertices before there is a matrix.
#[derive(Clone, Debug)]
pub(crate) struct Bending {
    pub(super) rotations: Rotations,
    /// The rotations at the sides of each triangle. The weight of a side on a border is zero, and its number is that of
    /// another side.
    pub(super) sides: Vec<[u32; 3]>,
    pub(super) facets: Vec<Facet>,
    start: Vec<u32>,
    vertices: Vec<u32>,
    weights: Vec<[f64; 3]>,
    corners: Vec<[u8; 3]>,
}

impl Patch<'_> {
    /// The vertices of the corners.
    fn triangle(&self) -> [u32; 3] {
        self.corners.map(|corner| self.vertices[corner])
    }

    /// The weights of vertex `j` in the five vectors of the curvature: derivatives and sides.
    fn weights_of(&self, j: usize) -> [f64; VECTORS] {
        let [a, b, c] = self.weights[j];
        let is = |corner: usize| f64::from(u8::from(self.corners[corner] == j));
        [a, b, c, is(1) - is(0), is(2) - is(0)]
    }

    /// The derivatives and sides at the positions `x` of vertices.
    fn vectors<'a>(&self, x: impl Fn(u32) -> &'a Vec3) -> ([Vec3; 3], [Vec3; 2]) {
        let [x0, x1, x2] = self.triangle().map(&x);
        let mut theta = [Vec3::zeros(); 3];
        for (&vertex, weights) in self.vertices.iter().zip(self.weights) {
            // Differences keep the digits of a sheet far from the origin.
            let from = x(vertex) - x0;
            for (theta, &weight) in theta.iter_mut().zip(weights) {
                *theta += from * weight;
            }
        }
        (theta, [x1 - x0, x2 - x0])
    }

    /// The vectors `of` the curvature's five vectors as a vector of vertex `j`.
    fn at(&self, j: usize, of: &[Vec3; VECTORS]) -> Vec3 {
        let weights = self.weights_of(j).into_iter();
        weights.zip(of).map(|(weight, v)| v * weight).sum()
    }

    /// Adds the stiffness: the Gauss-Newton part from the derivatives of the curvature by its five vectors, and the other
    /// part from the second derivatives of the energy by these vectors, if they are given.
    fn add(
        &self,
        derivatives: &[[Vec3; VECTORS]; 3],
        others: Option<&[[Mat3; VECTORS]; VECTORS]>,
        matrix: &mut BlockMatrix,
    ) {
        // Working memory of the usual size is cleared in a fraction of the time.
        if self.vertices.len() <= USUAL {
            self.add_within::<USUAL>(derivatives, others, matrix);
        } else {
            self.add_within::<MOST>(derivatives, others, matrix);
        }
    }

    fn add_within<const N: usize>(
        &self,
        derivatives: &[[Vec3; VECTORS]; 3],
        others: Option<&[[Mat3; VECTORS]; VECTORS]>,
        matrix: &mut BlockMatrix,
    ) {
        let count = self.vertices.len();
        let mut z = [[Vec3::zeros(); 3]; N];
        for (j, z) in z[..count].iter_mut().enumerate() {
            *z = derivatives.each_ref().map(|of| self.at(j, of));
        }
        let outer = |j: usize, k: usize| {
            let ([a, b, c], [d, e, f]) = (&z[j], &z[k]);
            a * d.transpose() + b * e.transpose() + c * f.transpose()
        };
        let Some(others) = others else {
            matrix.add_symmetric::<N, _>(self.vertices, |j| j, |&j, k| outer(j, k));
            return;
        };
        let row = |j: usize| {
            let weights = self.weights_of(j);
            (j, others.each_ref().map(|of| weighted(&weights, of)))
        };
        matrix.add_symmetric::<N, _>(self.vertices, row, |(j, row), k| {
            outer(*j, k) + weighted(&self.weights_of(k), row).transpose()
        });
    }
}

/// The weighted sum. Most weights are zero.
fn weighted(weights: &[f64; VECTORS], of: &[Mat3; VECTORS]) -> Mat3 {
    let mut sum = Mat3::zeros();
    for (&weight, m) in weights.iter().zip(of) {
        if weight != 0.0 {
            sum += m * weight;
        }
    }
    sum
}

impl Bending {
    /// The bending of no triangles, with these rotations.
    pub(super) fn new(rotations: Rotations) -> Self {
        Self {
            rotations,
            sides: Vec::new(),
            facets: Vec::new(),
            start: vec![0],
            vertices: Vec::new(),
            weights: Vec::new(),
            corners: Vec::new(),
        }
    }

    /// Adds a triangle, whose rotations are `sides`.
    pub(super) fn push(&mut self, triangle: [u32; 3], sides: [u32; 3], facet: Facet) {
        let mut patch: Vec<(u32, [f64; 3])> = triangle.map(|vertex| (vertex, [0.0; 3])).to_vec();
        for (side, &edge) in sides.iter().enumerate() {
            if facet.weights[side] == Vec3::zeros() {
                continue;
            }
            for (vertex, weight) in self.rotations.row(edge as usize) {
                if let Some((_, weights)) = patch.iter_mut().find(|(v, _)| *v == vertex) {
                    weights[side] = weight;
                } else {
                    let mut weights = [0.0; 3];
                    weights[side] = weight;
                    patch.push((vertex, weights));
                }
            }
        }
        for (vertex, weights) in patch {
            self.vertices.push(vertex);
            self.weights.push(weights);
        }
        self.corners.push([0, 1, 2]);
        self.start.push(self.vertices.len() as u32);
        self.sides.push(sides);
        self.facets.push(facet);
    }

    /// Makes the curvature of the last triangle with these derivatives and these sides (m) its curvature at rest. A
    /// triangle whose stiffness, the trace of its matrix, would be more than `stiffest` (N/m) is made softer.
    pub(super) fn rest(&mut self, (theta, sides): ([Vec3; 3], [Vec3; 2]), stiffest: f64) {
        let last = self.facets.len() - 1;
        let bent = self.facets[last].bend(theta, sides);
        let (patch, facet) = (self.patch(last), &self.facets[last]);
        let derivatives = facet.derivatives(&bent);
        let vertices = 0..patch.vertices.len();
        let squares = |j| derivatives.iter().map(move |of| (j, of));
        let stiffness: f64 = vertices
            .flat_map(squares)
            .map(|(j, of)| patch.at(j, of).norm_squared())
            .sum();
        let facet = &mut self.facets[last];
        facet.rest = bent.curvature;
        if stiffness > stiffest {
            let factor = (stiffest / stiffness).sqrt();
            facet.rest *= factor;
            facet.weights = facet.weights.map(|weight| weight * factor);
        }
    }

    /// Whether there is nothing that bends.
    pub(crate) fn is_empty(&self) -> bool {
        self.facets.is_empty()
    }

    /// The vertices of each patch.
    pub(crate) fn patches(&self) -> impl Iterator<Item = &[u32]> {
        (0..self.facets.len()).map(|triangle| self.patch(triangle).vertices)
    }

    /// The vertices of the corners of each triangle.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        (0..self.facets.len()).map(|triangle| self.patch(triangle).triangle())
    }

    /// Replaces each vertex by its place.
    pub(crate) fn renumber(&mut self, place: &[u32]) {
        for vertex in &mut self.rotations.vertices {
            *vertex = place[*vertex as usize];
        }
        for (triangle, corners) in self.corners.iter_mut().enumerate() {
            let range = self.start[triangle] as usize..self.start[triangle + 1] as usize;
            let (vertices, weights) = (&mut self.vertices[range.clone()], &mut self.weights[range]);
            for vertex in vertices.iter_mut() {
                *vertex = place[*vertex as usize];
            }
            let ends = corners.map(|corner| vertices[corner as usize]);
            // A patch is short, and few of its vertices are out of order.
            for end in 1..vertices.len() {
                for at in (1..=end).rev() {
                    if vertices[at - 1] <= vertices[at] {
                        break;
                    }
                    vertices.swap(at - 1, at);
                    weights.swap(at - 1, at);
                }
            }
            let found = ends.map(|end| vertices.iter().position(|&vertex| vertex == end));
            *corners = found.map(|at| at.unwrap_or_default() as u8);
        }
    }

    fn patch(&self, triangle: usize) -> Patch<'_> {
        let range = self.start[triangle] as usize..self.start[triangle + 1] as usize;
        Patch {
            vertices: &self.vertices[range.clone()],
            weights: &self.weights[range],
            corners: self.corners[triangle].map(usize::from),
        }
    }

    fn bent<'a>(&self, triangle: usize, x: impl Fn(u32) -> &'a Vec3) -> Bent {
        let (theta, sides) = self.patch(triangle).vectors(x);
        self.facets[triangle].bend(theta, sides)
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
            let bent = self.bent(triangle, |vertex| &x[node(vertex)]);
            let patch = self.patch(triangle);
            let gradient = facet.gradient(&bent);
            for (j, &vertex) in patch.vertices.iter().enumerate() {
                force[node(vertex)] -= patch.at(j, &gradient);
            }
            let others = (tangent == Tangent::Exact).then(|| facet.geometric(&bent));
            patch.add(&facet.derivatives(&bent), others.as_ref(), stiffness);
        }
    }

    /// Adds the Gauss-Newton stiffness of a triangle from the derivatives of its curvature.
    pub(super) fn add_to(
        &self,
        triangle: usize,
        derivatives: &[[Vec3; VECTORS]; 3],
        matrix: &mut BlockMatrix,
    ) {
        self.patch(triangle).add(derivatives, None, matrix);
    }

    /// The derivatives across the sides of a triangle and its sides, at vertex positions `x` (m).
    pub(super) fn vectors(&self, triangle: usize, x: &[Vec3]) -> ([Vec3; 3], [Vec3; 2]) {
        self.patch(triangle).vectors(|vertex| &x[vertex as usize])
    }

    /// The moments (N m) that outward slopes at the sides of a triangle feel, at node positions `x`.
    pub(super) fn moments(&self, triangle: usize, x: &[Vec3], nodes: &[u32]) -> [f64; 3] {
        let bent = self.bent(triangle, |vertex| &x[nodes[vertex as usize] as usize]);
        self.facets[triangle].outward_moments(&bent)
    }

    /// Bending energy (J) at node positions `x`.
    pub(crate) fn energy(&self, x: &[Vec3], nodes: &[u32]) -> f64 {
        let bent = |triangle| self.bent(triangle, |vertex| &x[nodes[vertex as usize] as usize]);
        let squares = (0..self.facets.len()).map(|t| bent(t).curvature.norm_squared());
        0.5 * squares.sum::<f64>()
    }

    /// Memory that it holds beside itself (bytes).
    pub(crate) fn bytes(&self) -> usize {
        self.rotations.bytes()
            + size_of_val(self.sides.as_slice())
            + size_of_val(self.facets.as_slice())
            + size_of_val(self.start.as_slice())
            + size_of_val(self.vertices.as_slice())
            + size_of_val(self.weights.as_slice())
            + size_of_val(self.corners.as_slice())
    }
}
