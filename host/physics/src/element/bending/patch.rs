//! The patch of a triangle: the vertices on which its curvature depends, and their weights in the five vectors of the
//! curvature.
//!
//! Only the assembly of a matrix needs patches. They are gathered from the derivatives at the sides of the triangle for
//! each assembly, which takes a tenth of its time: stored patches would take more memory than all else about bending.

use super::curvature::VECTORS;
use super::scalar::ScalarMatrix;
use crate::lanes::Real;
use crate::linear::block_matrix::BlockMatrix;
use crate::{Mat3, Vec3};

/// Largest number of vertices of a patch: two triangles and two rings around each side.
const MOST: usize = 48;

/// Largest number of vertices of a patch with one ring around each side: almost all patches.
const USUAL: usize = 14;

/// The vertices of a patch in ascending order, and their weights in the derivatives across the three sides and in the
/// two sides.
struct Patch<const N: usize> {
    count: usize,
    vertices: [u32; N],
    weights: [[f64; VECTORS]; N],
}

impl<const N: usize> Patch<N> {
    /// The patch of the triangle with these corners and these rotations at its sides; `None` if it has more than `N`
    /// vertices.
    fn gather<T: Real>(
        rotations: &ScalarMatrix<T>,
        corners: [u32; 3],
        sides: [Option<u32>; 3],
    ) -> Option<Self> {
        let mut patch = Self {
            count: 0,
            vertices: [0; N],
            weights: [[0.0; VECTORS]; N],
        };
        for side in 0..2 {
            patch.add(corners[0], 3 + side, -1.0)?;
            patch.add(corners[1 + side], 3 + side, 1.0)?;
        }
        for (side, edge) in sides.into_iter().enumerate() {
            let Some(edge) = edge else { continue };
            for (vertex, weight) in rotations.row(edge as usize) {
                patch.add(vertex, side, weight.to_f64())?;
            }
        }
        Some(patch)
    }

    /// Adds to the weight of a vertex.
    fn add(&mut self, vertex: u32, vector: usize, weight: f64) -> Option<()> {
        let before = self.vertices[..self.count].iter().rev();
        let larger = before.take_while(|&&other| other > vertex).count();
        let at = self.count - larger;
        if at > 0 && self.vertices[at - 1] == vertex {
            self.weights[at - 1][vector] += weight;
            return Some(());
        }
        if self.count == N {
            return None;
        }
        self.vertices.copy_within(at..self.count, at + 1);
        self.weights.copy_within(at..self.count, at + 1);
        self.vertices[at] = vertex;
        self.weights[at] = [0.0; VECTORS];
        self.weights[at][vector] = weight;
        self.count += 1;
        Some(())
    }

    fn add_to(
        &self,
        derivatives: &[[Vec3; VECTORS]; 3],
        others: Option<&[[Mat3; VECTORS]; VECTORS]>,
        matrix: &mut BlockMatrix,
    ) {
        let (vertices, weights) = (&self.vertices[..self.count], &self.weights);
        let mut z = [[Vec3::zeros(); 3]; N];
        for (z, weights) in z.iter_mut().zip(&weights[..self.count]) {
            *z = derivatives.each_ref().map(|of| at_vertex(weights, of));
        }
        let outer = |j: usize, k: usize| {
            let ([a, b, c], [d, e, f]) = (&z[j], &z[k]);
            a * d.transpose() + b * e.transpose() + c * f.transpose()
        };
        let Some(others) = others else {
            matrix.add_symmetric::<N, _>(vertices, |j| j, |&j, k| outer(j, k));
            return;
        };
        let row = |j: usize| (j, others.each_ref().map(|of| weighted(&weights[j], of)));
        matrix.add_symmetric::<N, _>(vertices, row, |(j, row), k| {
            outer(*j, k) + weighted(&weights[k], row).transpose()
        });
    }
}

/// The vectors `of` the curvature's five vectors as a vector of the vertex with these weights.
fn at_vertex(weights: &[f64; VECTORS], of: &[Vec3; VECTORS]) -> Vec3 {
    let weights = weights.iter().zip(of);
    weights.map(|(&weight, v)| v * weight).sum()
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

/// A triangle with its rotations, each a row of `rotations`.
pub(super) struct Sided<'a, T> {
    pub(super) rotations: &'a ScalarMatrix<T>,
    pub(super) corners: [u32; 3],
    /// The rotation at each side; `None` on a border.
    pub(super) sides: [Option<u32>; 3],
}

impl<T: Real> Sided<'_, T> {
    /// Adds the stiffness to `matrix`: the Gauss-Newton part from the `derivatives` of the three components of the
    /// curvature by its five vectors, and the other part from the second derivatives of the energy by these vectors, if
    /// they are given.
    pub(super) fn add_to(
        &self,
        derivatives: &[[Vec3; VECTORS]; 3],
        others: Option<&[[Mat3; VECTORS]; VECTORS]>,
        matrix: &mut BlockMatrix,
    ) {
        // Working memory of the usual size is cleared in a fraction of the time.
        if let Some(patch) = Patch::<USUAL>::gather(self.rotations, self.corners, self.sides) {
            patch.add_to(derivatives, others, matrix);
        } else if let Some(patch) = Patch::<MOST>::gather(self.rotations, self.corners, self.sides)
        {
            patch.add_to(derivatives, others, matrix);
        }
    }

    /// Calls `add` with the blocks of the Gauss-Newton stiffness, by row and column.
    pub(super) fn visit(
        &self,
        derivatives: &[[Vec3; VECTORS]; 3],
        add: &mut dyn FnMut(u32, u32, &Mat3),
    ) {
        let patch = Patch::<MOST>::gather(self.rotations, self.corners, self.sides);
        let Some(patch) = patch else { return };
        let (vertices, weights) = (&patch.vertices[..patch.count], &patch.weights);
        let at = |j: usize| derivatives.each_ref().map(|of| at_vertex(&weights[j], of));
        for (j, &row) in vertices.iter().enumerate() {
            let z = at(j);
            for (k, &column) in vertices.iter().enumerate() {
                let blocks = z.iter().zip(at(k)).map(|(a, b)| a * b.transpose());
                add(row, column, &blocks.sum());
            }
        }
    }

    /// The vertices, in ascending order.
    pub(super) fn vertices(&self) -> Vec<u32> {
        let patch = Patch::<MOST>::gather(self.rotations, self.corners, self.sides);
        patch.map_or_else(Vec::new, |patch| patch.vertices[..patch.count].to_vec())
    }

    /// The trace of the Gauss-Newton stiffness.
    pub(super) fn trace(&self, derivatives: &[[Vec3; VECTORS]; 3]) -> f64 {
        let patch = Patch::<MOST>::gather(self.rotations, self.corners, self.sides);
        let squares = |weights: &[f64; VECTORS]| -> f64 {
            let parts = derivatives.iter();
            parts.map(|of| at_vertex(weights, of).norm_squared()).sum()
        };
        patch.map_or(0.0, |patch| {
            patch.weights[..patch.count].iter().map(squares).sum()
        })
    }
}
