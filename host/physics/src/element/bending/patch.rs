//! The energy of a triangle's curvature, as a quadratic form of nearby vertices.
//!
//! By the divergence theorem the mean of the second derivatives over a triangle of area `A` is a sum over its sides,
//!
//! ```text
//! H = 1/A sum_e (l_e w,n n + (w_b - w_a) t) (x) n_e
//! ```
//!
//! with the normal derivative `w,n` in the middle of each side, its length, its outward normal `n_e` and the difference
//! along its tangent `t`. This is the curvature of L. S. D. Morley's triangle ("The constant-moment plate-bending
//! element", 1971), whose unknowns are the vertices and the normal derivatives. Here the normal derivatives are those of
//! `rotation`, so that only vertices remain. Two triangles use the same derivative on their common
//! side. Hence a constant moment is in equilibrium, and a constant curvature has its exact energy, on any mesh (the patch
//! test). The energy is never below the least energy of Morley's triangles over all normal derivatives, which vanishes
//! for rigid motions alone; so no other motion is free.
//!
//! A triangle whose vertices a handle or supports prescribe is rigid, and its gradient is that of the sheet at its sides:
//! it clamps the triangles beside it.
//!
//! On a border nothing resists the rotation of the sheet. The normal derivative there is the one of least energy, which
//! is eliminated in the triangle: the moment about a free or a hinged border is zero.

use super::rotation::{Across, Nearby, rotation};
use super::{BentSheet, NONE};
use crate::element::triangle::frame::rest_frame;
use crate::material::Material;
use crate::{Mat3, Vec3};

/// Largest stiffness of a patch, the trace of its matrix, as a multiple of the rigidity over the square of the triangle's
/// longest side. A well-shaped triangle has some hundred, and a needle the third power of its aspect ratio. A needle of
/// more than a hundred bends too easily instead, because no solver would resolve its stiffness.
const STIFFEST: f64 = 1e6;

/// The contribution of one triangle.
#[derive(Clone, Debug)]
pub(crate) struct Patch {
    /// Vertices of the triangle, then other vertices of its curvature.
    pub(crate) vertices: Vec<u32>,
    /// Weights between them, a symmetric scalar matrix (N/m), row by row.
    pub(super) weights: Vec<f64>,
}

/// Kirchhoff's plate matrix of a material (N m), between moments and curvatures (xx, yy, 2 xy).
fn plate(material: &Material) -> Mat3 {
    let nu = material.poisson;
    let matrix = Mat3::new(1.0, nu, 0.0, nu, 1.0, 0.0, 0.0, 0.0, 0.5 * (1.0 - nu));
    matrix * material.bending_rigidity()
}

/// The normal derivative on an interior edge.
struct Rotation {
    /// The triangle from which its normal leads outward.
    left: usize,
    /// Weights of the derivative times the length of the edge, by vertex.
    weights: Vec<(u32, f64)>,
}

/// The vertices near the edge opposite vertex `k` of `triangle`, up to `rings` triangles away, in the edge's frame.
fn nearby(sheet: &BentSheet, x: &[Vec3], triangle: usize, k: usize, rings: usize) -> Nearby {
    let vertices = &sheet.triangles[triangle];
    let beyond = sheet.neighbours[triangle][k] as usize;
    let [a, b, c] = [0, 1, 2].map(|i| vertices[(k + 1 + i) % 3]);
    let ends = [a, b];
    let mut near = Nearby {
        vertices: vec![a, b, c],
        at: Vec::new(),
    };
    let mut triangles = vec![triangle, beyond];
    let mut first = 0;
    for ring in 0..=rings {
        let last = triangles.len();
        for index in first..last {
            let vertices = &sheet.triangles[triangles[index]];
            // The vertex beyond the edge comes fourth: the first triangle adds none.
            for &vertex in vertices.iter().filter(|vertex| !ends.contains(vertex)) {
                if !near.vertices.contains(&vertex) {
                    near.vertices.push(vertex);
                }
            }
            for &next in &sheet.neighbours[triangles[index]] {
                if ring < rings && next != NONE && !triangles.contains(&(next as usize)) {
                    triangles.push(next as usize);
                }
            }
        }
        first = last;
    }
    let at = |vertex: u32| &x[vertex as usize];
    let (middle, along) = ((at(a) + at(b)) * 0.5, at(b) - at(a));
    let length = along.norm();
    let along = along / length;
    let inward = at(c) - middle;
    let outward = -(inward - along * along.dot(&inward)).normalize();
    let frame = |&vertex: &u32| {
        let p = (at(vertex) - middle) / length;
        [p.dot(&along), p.dot(&outward)]
    };
    near.at = near.vertices.iter().map(frame).collect();
    near
}

/// For each side of each triangle, the number of its rotation, or [`NONE`] on a border; and the rotations.
fn rotations(
    sheet: &BentSheet,
    x: &[Vec3],
    is_rigid: impl Fn(&[u32; 3]) -> bool,
) -> (Vec<[u32; 3]>, Vec<Rotation>) {
    let rigid: Vec<bool> = sheet.triangles.iter().map(is_rigid).collect();
    let mut numbers = vec![[NONE; 3]; sheet.triangles.len()];
    let mut rotations = Vec::with_capacity(3 * sheet.triangles.len() / 2);
    for triangle in 0..sheet.triangles.len() {
        for k in 0..3 {
            let beyond = sheet.neighbours[triangle][k];
            if beyond == NONE || (beyond as usize) < triangle {
                continue;
            }
            let near = nearby(sheet, x, triangle, k, 1);
            let weights = match [triangle, beyond as usize].map(|t| rigid[t]) {
                [true, false] => near.gradient(Across::Before),
                [false, true] => near.gradient(Across::Beyond),
                _ => rotation(near, || nearby(sheet, x, triangle, k, 2)),
            };
            let number = rotations.len() as u32;
            numbers[triangle][k] = number;
            let back = &sheet.neighbours[beyond as usize];
            // Two triangles may have several sides in common, so the side is found by its vertices.
            let vertices = &sheet.triangles[triangle];
            let across = |j: usize| {
                let vertex = sheet.triangles[beyond as usize][j];
                vertex != vertices[(k + 1) % 3] && vertex != vertices[(k + 2) % 3]
            };
            if let Some(j) = (0..3).find(|&j| back[j] == triangle as u32 && across(j)) {
                numbers[beyond as usize][j] = number;
            }
            rotations.push(Rotation {
                left: triangle,
                weights,
            });
        }
    }
    (numbers, rotations)
}

/// The patch of every triangle with a neighbour, over vertices, which are at `x` (m) at rest. `is_rigid` says whether the
/// motion of a triangle is prescribed.
pub(super) fn patches(
    sheet: &BentSheet,
    x: &[Vec3],
    is_rigid: impl Fn(&[u32; 3]) -> bool,
) -> Vec<Patch> {
    let (numbers, rotations) = rotations(sheet, x, is_rigid);
    let mut patches = Vec::with_capacity(sheet.triangles.len());
    for (triangle, vertices) in sheet.triangles.iter().enumerate() {
        let corners = vertices.map(|vertex| &x[vertex as usize]);
        let Some((_, area)) = rest_frame(corners) else {
            continue;
        };
        if numbers[triangle] == [NONE; 3] {
            continue;
        }
        let along = (corners[1] - corners[0]).normalize();
        let up = corners[2] - corners[0];
        let across = (up - along * along.dot(&up)).normalize();
        let material = sheet.material(triangle);
        let mut plate = plate(material) * (sheet.scale * area);
        let sides = [0, 1, 2].map(|k| (corners[(k + 1) % 3] - corners[k]).norm_squared());
        let longest = sides.into_iter().fold(0.0, f64::max);
        let stiffest = STIFFEST * material.bending_rigidity() * sheet.scale / longest;
        let mut patch: Vec<u32> = vertices.to_vec();
        let mut curvature = vec![Vec3::zeros(); 3];
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let side = corners[j] - corners[i];
            let length = side.norm();
            let [tx, ty] = [&along, &across].map(|axis| axis.dot(&side) / length);
            let (nx, ny) = (ty, -tx);
            let twist = Vec3::new(tx * nx, ty * ny, tx * ny + ty * nx) / area;
            curvature[j] += twist;
            curvature[i] -= twist;
            let bend = Vec3::new(nx * nx, ny * ny, 2.0 * nx * ny) / area;
            let Some(rotation) = rotations.get(numbers[triangle][k] as usize) else {
                let moment = plate * bend;
                plate -= moment * moment.transpose() / bend.dot(&moment);
                continue;
            };
            let outward = if rotation.left == triangle { 1.0 } else { -1.0 };
            for &(vertex, weight) in &rotation.weights {
                let found = patch.iter().position(|&v| v == vertex);
                let at = found.unwrap_or_else(|| {
                    patch.push(vertex);
                    curvature.push(Vec3::zeros());
                    patch.len() - 1
                });
                curvature[at] += bend * (outward * weight);
            }
        }
        let stiffness: f64 = curvature.iter().map(|a| (plate * a).dot(a)).sum();
        if stiffness > stiffest {
            plate *= stiffest / stiffness;
        }
        let mut weights = Vec::with_capacity(patch.len() * patch.len());
        for a in &curvature {
            let moment = plate * a;
            weights.extend(curvature.iter().map(|b| moment.dot(b)));
        }
        patches.push(Patch {
            vertices: patch,
            weights,
        });
    }
    patches
}
