//! The bending stiffness of a sheet that is flat at rest: a constant matrix.
//!
//! For nearly isometric motion the second derivatives of the positions are the curvatures times the
//! normal, so a plate's energy is a quadratic function of the positions with a constant matrix (Bergou,
//! Wardetzky, Harmon, Zorin, Grinspun, "A quadratic bending model for inextensible surfaces", 2006).
//!
//! - `rotation`: the normal derivative at the middle of an edge, from nearby vertices.
//! - `patch`: the curvature of a triangle from the normal derivatives at its sides, and its energy by Kirchhoff's plate
//!   matrix, of rigidity `D = E t^3 / (12 (1 - nu^2))`.
//! - `scalar`: the matrix in the form for vector instructions.
//!
//! Deflections converge to those of the plate with the square of the size of the cells on any triangulation
//! (`palpate bench accuracy`).

mod cost;
mod patch;
mod rotation;
pub(crate) mod scalar;

pub(crate) use patch::Patch;

use super::kernel::Kernel;
use crate::Vec3;
use crate::error::BodyError;
use crate::lanes::Real;
use crate::linear::block_matrix::BlockMatrix;
use crate::material::Material;
use scalar::ScalarMatrix;

/// The largest fold (rad) of a sheet that counts as flat at rest. The rounding of a file in single precision stays
/// below it.
const FLAT: f64 = 1e-5;

/// Stands for the neighbour across a border. An `Option` would take twice the memory.
const NONE: u32 = u32::MAX;

/// A sheet that resists bending: the facts from which the patches follow, over vertices. A body keeps these facts rather
/// than the patches, which take ten times the memory and are needed only when a matrix is built.
#[derive(Clone, Debug)]
pub(crate) struct BentSheet {
    triangles: Vec<[u32; 3]>,
    /// By triangle, the neighbour across each side, or [`NONE`].
    neighbours: Vec<[u32; 3]>,
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

/// For each side of each triangle in turn, the triangle across it, or [`NONE`].
fn neighbours(x: &[Vec3], triangles: &[[u32; 3]]) -> Result<Vec<[u32; 3]>, BodyError> {
    let mut sides: Vec<(Side, usize)> = Vec::with_capacity(3 * triangles.len());
    for (triangle, vertices) in triangles.iter().enumerate() {
        for k in 0..3 {
            sides.push((side(vertices, triangle, k), k));
        }
    }
    sides.sort_unstable();
    let mut neighbours = vec![[NONE; 3]; triangles.len()];
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
                neighbours[p.triangle][*kp] = q.triangle as u32;
                neighbours[q.triangle][*kq] = p.triangle as u32;
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
    Ok(neighbours)
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
            neighbours: neighbours(x, triangles)?,
            materials: materials.to_vec(),
            scale,
        })
    }

    fn material(&self, triangle: usize) -> &Material {
        let one = self.materials.len() == 1;
        &self.materials[if one { 0 } else { triangle }]
    }

    /// One patch for every triangle with a neighbour, over vertices, which are at `x` (m) at rest. `is_rigid` says
    /// whether the motion of a triangle is prescribed.
    pub(crate) fn patches(&self, x: &[Vec3], is_rigid: impl Fn(&[u32; 3]) -> bool) -> Vec<Patch> {
        patch::patches(self, x, is_rigid)
    }

    /// Whether the motion of each triangle is prescribed.
    pub(crate) fn rigid(&self, is_rigid: impl Fn(&[u32; 3]) -> bool) -> Vec<bool> {
        self.triangles.iter().map(is_rigid).collect()
    }

    /// Memory that it holds beside itself (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.triangles.as_slice())
            + size_of_val(self.neighbours.as_slice())
            + size_of_val(self.materials.as_slice())
    }
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
                        weights[slot as usize] += patch.weights[i * patch.vertices.len() + j];
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
