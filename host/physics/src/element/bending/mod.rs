//! The bending stiffness of a sheet that is flat at rest: a constant matrix.
//!
//! For nearly isometric motion the second derivatives of the positions are the curvatures times the
//! normal, so a plate's energy is a quadratic function of the positions with a constant matrix (Bergou,
//! Wardetzky, Harmon, Zorin, Grinspun, "A quadratic bending model for inextensible surfaces", 2006).
//! As in that paper, the fold across an interior edge is a four-vertex stencil of cotangents,
//!
//! ```text
//! (k_e x) = (cot b + cot b') x_a + (cot a + cot a') x_b - (cot a + cot b) x_c - (cot a' + cot b') x_c'
//! ```
//!
//! with the edge from `a` to `b`, the vertices `c` and `c'` across it, and the angles at `a` and `b` in either
//! triangle. The fold is the jump of the normal derivative times the edge's length.
//!
//! Unlike in that paper, the edges are not independent hinges. The energy of independent hinges,
//! `3 / (A + A') |k_e x|^2`, is that of the mean curvature for a sphere. For a cylinder on the usual meshes it is three
//! times too large and depends on the direction of the edges. The folds of a triangle are therefore taken together
//! (Grinspun, Gingold, Reisman, Zorin, "Computing discrete shape operators on general meshes", 2006, the quadratic
//! fit). A constant curvature `kappa` (xx, xy, yy in the triangle's rest frame) causes the folds `T kappa`. The
//! triangle's energy is the least energy of a curvature with the folds `s = (k_e x)` of the triangle,
//!
//! ```text
//! E = A / 2 min { kappa^T G kappa : T kappa = s } = A / 2 s^T (T G^-1 T^T)^-1 s
//! ```
//!
//! with Kirchhoff's plate matrix `G`, of rigidity `D = E t^3 / (12 (1 - nu^2))`. With three neighbours
//! this energy is exact for any constant curvature on any mesh. It vanishes only if every fold does. A border needs
//! no treatment: an edge with one triangle has no fold, which causes an error of the order of the triangle's size.
//!
//! These statements concern the energy of a given shape. The deflection under a load also depends on the pattern of
//! the mesh. If all diagonals are parallel, deflections converge to those of the plate, from above and linearly in the
//! size of the cells. They nearly do so if the vertices are moved. With alternating diagonals some shapes have too
//! little energy, and such a sheet bends by one and a half times too much or more, however fine the mesh
//! (`palpate bench accuracy`).

mod cost;
pub(crate) mod scalar;

use super::kernel::Kernel;
use super::triangle::frame::rest_frame;
use crate::error::BodyError;
use crate::lanes::Real;
use crate::linear::block_matrix::BlockMatrix;
use crate::material::Material;
use crate::{Mat3, Vec3};
use scalar::ScalarMatrix;

/// The largest fold (rad) of a sheet that counts as flat at rest. The rounding of a file in single precision stays
/// below it.
const FLAT: f64 = 1e-5;

/// If the six vertices of a patch lie near a common conic, `T` is nearly singular and one combination of folds would
/// lock. This fraction of the mean diagonal of `T G^-1 T^T` is added to the diagonal and bounds the stiffness.
const EASE: f64 = 1e-4;

/// Stands for the vertex beyond a border. An `Option` would take twice the memory.
const NONE: u32 = u32::MAX;

/// The contribution of one triangle and its neighbours, of which there are at most three.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    /// Vertices of the triangle, then the vertices across its interior edges.
    pub(crate) vertices: Vec<u32>,
    /// Weights between them, a symmetric scalar matrix (N/m).
    weights: Vec<Vec<f64>>,
}

/// A sheet that resists bending: the facts from which the patches follow, over vertices. A body keeps these facts rather
/// than the patches, which take ten times the memory and are needed only when a matrix is built.
#[derive(Clone, Debug)]
pub(crate) struct BentSheet {
    triangles: Vec<[u32; 3]>,
    /// By triangle, the vertex beyond each side, or [`NONE`].
    beyond: Vec<[u32; 3]>,
    /// One for all triangles or one for each.
    materials: Vec<Material>,
    /// Factor of the rigidity.
    scale: f64,
}

/// A side of a triangle: its vertices in ascending order, the triangle, and the vertex across.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    a: u32,
    b: u32,
    triangle: usize,
    across: u32,
}

fn cotangent(at: &Vec3, to: &Vec3, other: &Vec3) -> f64 {
    let (u, v) = (to - at, other - at);
    u.dot(&v) / u.cross(&v).norm()
}

/// The fold (rad) between the triangles (a, b, c) and (a, b, d), whatever their orientation. It is zero if both lie in
/// a plane, on either side of the edge.
fn fold(a: &Vec3, b: &Vec3, c: &Vec3, d: &Vec3) -> f64 {
    let edge = (b - a).normalize();
    let rise = |p: &Vec3| {
        let p = p - a;
        p - edge * edge.dot(&p)
    };
    let (u, v) = (rise(c), -rise(d));
    libm::atan2(u.cross(&v).norm(), u.dot(&v))
}

/// The stencil of the fold across a side, over the vertices a, b, `across` and `beyond`.
fn stencil(x: &[Vec3], side: Side, beyond: u32) -> [(u32, f64); 4] {
    let at = |vertex: u32| &x[vertex as usize];
    let (a, b, c, d) = (at(side.a), at(side.b), at(side.across), at(beyond));
    let near = [cotangent(a, b, c), cotangent(b, a, c)];
    let far = [cotangent(a, b, d), cotangent(b, a, d)];
    [
        (side.a, near[1] + far[1]),
        (side.b, near[0] + far[0]),
        (side.across, -near[0] - near[1]),
        (beyond, -far[0] - far[1]),
    ]
}

/// For each side of each triangle in turn, the vertex beyond it, or [`NONE`].
fn neighbours(x: &[Vec3], triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>, BodyError> {
    let mut sides: Vec<(Side, usize)> = Vec::with_capacity(3 * triangles.len());
    for (triangle, vertices) in triangles.iter().enumerate() {
        for k in 0..3 {
            sides.push((side(vertices, triangle, k), k));
        }
    }
    sides.sort_unstable();
    let mut beyond = vec![[NONE; 3]; triangles.len()];
    for group in sides.chunk_by(|p, q| (p.0.a, p.0.b) == (q.0.a, q.0.b)) {
        match group {
            [_] => {}
            [(p, kp), (q, kq)] => {
                let at = |vertex: u32| &x[vertex as usize];
                let angle = fold(at(p.a), at(p.b), at(p.across), at(q.across));
                if angle > FLAT || angle.is_nan() {
                    return Err(BodyError::Folded {
                        a: p.a,
                        b: p.b,
                        angle,
                    });
                }
                beyond[p.triangle][*kp] = q.across;
                beyond[q.triangle][*kq] = p.across;
            }
            _ => {
                let (a, b) = (group[0].0.a, group[0].0.b);
                return Err(BodyError::NonManifold {
                    a,
                    b,
                    count: group.len(),
                });
            }
        }
    }
    Ok(beyond)
}

/// The side of a triangle opposite its vertex `k`.
fn side(vertices: &[u32; 3], triangle: usize, k: usize) -> Side {
    let (p, q) = (vertices[(k + 1) % 3], vertices[(k + 2) % 3]);
    Side {
        a: p.min(q),
        b: p.max(q),
        triangle,
        across: vertices[k],
    }
}

/// The three quadratics of unit curvature xx, xy and yy in the rest frame of a triangle, at `p`.
fn quadratics(corners: [&Vec3; 3], p: &Vec3) -> Vec3 {
    let along = (corners[1] - corners[0]).normalize();
    let up = corners[2] - corners[0];
    let across = (up - along * along.dot(&up)).normalize();
    let p = p - corners[0];
    let (x, y) = (p.dot(&along), p.dot(&across));
    Vec3::new(0.5 * x * x, x * y, 0.5 * y * y)
}

/// `(T G^-1 T^T)^-1` for the first `count` rows of `t`.
fn coupling(t: &Mat3, count: usize, material: &Material) -> Mat3 {
    let nu = material.poisson;
    let direct = 1.0 / (1.0 - nu * nu);
    let twist = 0.5 / (1.0 - nu);
    let compliance = Mat3::new(
        direct,
        0.0,
        -nu * direct,
        0.0,
        twist,
        0.0,
        -nu * direct,
        0.0,
        direct,
    );
    let mut product = t * compliance * t.transpose();
    let mean = product.trace() / count.max(1) as f64;
    for i in 0..3 {
        product[(i, i)] += if i < count { EASE * mean } else { mean };
    }
    let rigidity = material.bending_rigidity();
    product
        .try_inverse()
        .map_or_else(Mat3::zeros, |inverse| inverse * rigidity)
}

impl BentSheet {
    /// A sheet of `triangles`, at rest with its vertices at `x` (m). `scale` multiplies the rigidity.
    ///
    /// # Errors
    /// [`BodyError::Folded`] and [`BodyError::NonManifold`].
    pub(crate) fn new(
        x: &[Vec3],
        triangles: &[[u32; 3]],
        materials: &[Material],
        scale: f64,
    ) -> Result<Self, BodyError> {
        Ok(Self {
            triangles: triangles.to_vec(),
            beyond: neighbours(x, triangles)?,
            materials: materials.to_vec(),
            scale,
        })
    }

    fn material(&self, triangle: usize) -> &Material {
        let one = self.materials.len() == 1;
        &self.materials[if one { 0 } else { triangle }]
    }

    /// One patch for every triangle with a neighbour, over vertices, which are at `x` (m) at rest.
    pub(crate) fn patches(&self, x: &[Vec3]) -> Vec<Patch> {
        patches(x, self)
    }

    /// Memory that it holds beside itself (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.triangles.as_slice())
            + size_of_val(self.beyond.as_slice())
            + size_of_val(self.materials.as_slice())
    }
}

fn patches(x: &[Vec3], sheet: &BentSheet) -> Vec<Patch> {
    let BentSheet {
        triangles, beyond, ..
    } = sheet;
    let mut patches = Vec::with_capacity(triangles.len());
    for (triangle, vertices) in triangles.iter().enumerate() {
        let corners = vertices.map(|vertex| &x[vertex as usize]);
        let Some((_, area)) = rest_frame(corners) else {
            continue;
        };
        let mut patch_vertices = vertices.to_vec();
        for vertex in beyond[triangle].into_iter().filter(|&v| v != NONE) {
            if !patch_vertices.contains(&vertex) {
                patch_vertices.push(vertex);
            }
        }
        let count = patch_vertices.len();
        let quadratics: Vec<Vec3> = patch_vertices
            .iter()
            .map(|&v| quadratics(corners, &x[v as usize]))
            .collect();
        let mut folds: Vec<Vec<f64>> = Vec::with_capacity(3);
        let mut t = Mat3::zeros();
        for k in 0..3 {
            let beyond = beyond[triangle][k];
            if beyond == NONE {
                continue;
            }
            let mut row = vec![0.0; count];
            for (vertex, weight) in stencil(x, side(vertices, triangle, k), beyond) {
                if let Some(i) = patch_vertices.iter().position(|&v| v == vertex) {
                    row[i] += weight;
                }
            }
            let fold: Vec3 = row.iter().zip(&quadratics).map(|(&w, q)| q * w).sum();
            t.set_row(folds.len(), &fold.transpose());
            folds.push(row);
        }
        let coupling = coupling(&t, folds.len(), sheet.material(triangle)) * (sheet.scale * area);
        let mut weights = vec![vec![0.0; count]; count];
        for (e, row) in folds.iter().enumerate() {
            for (f, column) in folds.iter().enumerate() {
                for i in 0..count {
                    for j in 0..count {
                        weights[i][j] += coupling[(e, f)] * row[i] * column[j];
                    }
                }
            }
        }
        if !folds.is_empty() {
            patches.push(Patch {
                vertices: patch_vertices,
                weights,
            });
        }
    }
    patches
}

/// The bending matrix `W`, scalar weights over the blocks of a [`BlockMatrix`]: each block is its weight
/// times the identity. The energy is `x^T W x / 2`. `nodes` is the node of each row of the matrix.
#[derive(Clone, Debug)]
pub struct Bending {
    weights: Vec<f64>,
}

impl Bending {
    /// Sums `patches`, given over the rows of `matrix`, on its pattern.
    pub(crate) fn new(matrix: &BlockMatrix, patches: &[Patch]) -> Self {
        let mut weights = vec![0.0; matrix.block_count()];
        for patch in patches {
            for (i, &row) in patch.vertices.iter().enumerate() {
                for (j, &column) in patch.vertices.iter().enumerate() {
                    // The upper triangle alone is summed and then mirrored, so that both are equal
                    // to the last bit and forces cancel in pairs.
                    if row < column
                        && let (Some(slot), Some(mirror)) =
                            (matrix.slot(row, column), matrix.slot(column, row))
                    {
                        weights[slot as usize] += patch.weights[i][j];
                        weights[mirror as usize] = weights[slot as usize];
                    }
                }
            }
        }
        // A translation causes no bending force.
        for row in 0..matrix.nodes() {
            let (columns, start) = matrix.row(row);
            let sum: f64 = weights[start..start + columns.len()].iter().sum();
            if let Some(slot) = matrix.slot(row as u32, row as u32) {
                weights[slot as usize] = -sum;
            }
        }
        Self { weights }
    }

    /// The weight of every block (N/m).
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The kernel of the bending in the order of `place`. The weights are by slot of `stiffness`, and `matrix` is
    /// `stiffness` in that order.
    pub(crate) fn kernel<T: Real>(
        &self,
        stiffness: &BlockMatrix,
        place: &[u32],
        matrix: &BlockMatrix,
    ) -> Box<dyn Kernel<T>> {
        let weights = stiffness.renumbered_weights(&self.weights, place, matrix);
        Box::new(ScalarMatrix::new(matrix, &weights))
    }

    /// Adds the bending force (N) at node positions `x` to `force`.
    pub fn add_force(&self, matrix: &BlockMatrix, nodes: &[u32], x: &[Vec3], force: &mut [Vec3]) {
        for (row, &node) in nodes.iter().enumerate() {
            let (columns, start) = matrix.row(row);
            let at = x[node as usize];
            let mut sum = Vec3::zeros();
            // Differences keep the digits of a sheet far from the origin.
            for (&column, &weight) in columns.iter().zip(&self.weights[start..]) {
                sum += (at - x[nodes[column as usize] as usize]) * weight;
            }
            force[node as usize] += sum;
        }
    }

    /// Bending energy (J) at node positions `x`.
    pub fn energy(&self, matrix: &BlockMatrix, nodes: &[u32], x: &[Vec3]) -> f64 {
        let mut energy = 0.0;
        for (row, &node) in nodes.iter().enumerate() {
            let (columns, start) = matrix.row(row);
            let at = x[node as usize];
            for (&column, &weight) in columns.iter().zip(&self.weights[start..]) {
                let other = x[nodes[column as usize] as usize];
                energy -= 0.25 * weight * (at - other).norm_squared();
            }
        }
        energy
    }
}
