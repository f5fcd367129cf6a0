//! The vertices near an edge of a sheet, unfolded into the plane.
//!
//! The two triangles at the edge come first. The triangles around them follow, ring by ring, each turned about the side
//! that it has in common with a triangle before it. No length within a triangle changes. On a sheet that is flat at rest
//! these are the places at rest.
//!
//! In a flat pattern the two sides of a seam may differ in length. The edge then has their mean, and along it a triangle
//! is stretched to fit. The height of each triangle over the edge is its own, so that its gradient across the edge is.

use super::few::Few;
use super::{BentSheet, NONE};
use crate::Vec3;

/// The nearby vertices of an edge in the frame of the edge: the origin in its middle, x along it, y along the normal,
/// in units of its length.
#[derive(Clone, Debug, Default)]
pub(super) struct Nearby {
    /// The vertices. The first two are the ends of the edge, at x = -1/2 and 1/2. The third and the fourth are those
    /// across it, at y < 0 and y > 0.
    pub(super) vertices: Few<u32>,
    /// Their places.
    pub(super) at: Few<[f64; 2]>,
}

impl Nearby {
    fn place(&self, vertex: u32) -> Option<[f64; 2]> {
        let found = self.vertices.iter().position(|&v| v == vertex)?;
        self.at.get(found).copied()
    }

    /// Places `vertex`, which lies across the side with the ends `sides` from the vertex `other`, by the shape
    /// `[p, q, apex]` (m) of its triangle. Distances are in units of `unit` (m). The side of a seam that is eased is as
    /// long as its place.
    fn unfold(&mut self, vertex: u32, sides: [u32; 2], other: u32, shape: &Shape, unit: f64) {
        let (Some(p), Some(q), Some(r)) = (
            self.place(sides[0]),
            self.place(sides[1]),
            self.place(other),
        ) else {
            return;
        };
        let [xp, xq, apex] = &shape.corners;
        let (mut along, height) = coordinates(xp, xq, apex);
        let side = [q[0] - p[0], q[1] - p[1]];
        let length = libm::hypot(side[0], side[1]);
        let u = side.map(|c| c / length);
        if shape.may_differ {
            along *= length * unit / (xq - xp).norm();
        }
        let mut n = [-u[1], u[0]];
        if (r[0] - p[0]) * n[0] + (r[1] - p[1]) * n[1] > 0.0 {
            n = n.map(|c| -c);
        }
        let place = [0, 1].map(|i| p[i] + (u[i] * along + n[i] * height) / unit);
        self.vertices.push(vertex);
        self.at.push(place);
    }
}

/// A triangle at rest: the ends of a side and the corner across it (m).
struct Shape {
    corners: [Vec3; 3],
    /// Whether the side may have another length in the triangle beyond.
    may_differ: bool,
}

/// The coordinate of `apex` along the side from `p` to `q`, from `p` on, and its distance from the side (m).
fn coordinates(p: &Vec3, q: &Vec3, apex: &Vec3) -> (f64, f64) {
    let along = (q - p).normalize();
    let to = apex - p;
    let coordinate = to.dot(&along);
    (coordinate, (to - along * coordinate).norm())
}

/// The vertices near the edge opposite vertex `k` of `triangle`, up to `rings` triangles away. The curvature jumps at a
/// rigid triangle, so the rings end there.
pub(super) fn nearby(
    sheet: &BentSheet,
    x: &[Vec3],
    rigid: &[bool],
    (triangle, k): (usize, usize),
    rings: usize,
) -> Nearby {
    let beyond = sheet.neighbours[triangle][k] as usize;
    let vertices = &sheet.triangles[triangle];
    let [a, b, c] = [1, 2, 0].map(|i| vertices[(k + i) % 3]);
    let length = sheet.length((triangle, k), x);
    let mut near = Nearby {
        vertices: [a, b].into_iter().collect(),
        at: [[-0.5, 0.0], [0.5, 0.0]].into_iter().collect(),
    };
    let opposite = |triangle: usize, ends: [u32; 2]| {
        let mut vertices = sheet.triangles[triangle].into_iter();
        vertices.rfind(|v| !ends.contains(v))
    };
    let across = opposite(beyond, [a, b]).unwrap_or(c);
    for (of, vertex, sign) in [(triangle, c, -1.0), (beyond, across, 1.0)] {
        let [xa, xb, apex] = sheet.places(of, [a, b, vertex], x);
        let (along, height) = coordinates(&xa, &xb, &apex);
        let own = (xb - xa).norm();
        near.vertices.push(vertex);
        near.at.push([along / own - 0.5, sign * height / length]);
    }
    let mut triangles: Few<usize> = [triangle, beyond].into_iter().collect();
    let mut first = 0;
    for _ in 0..rings {
        let last = triangles.len();
        for index in first..last {
            let from = triangles[index];
            for side in 0..3 {
                let next = sheet.neighbours[from][side];
                if next == NONE || rigid[next as usize] || triangles.contains(&(next as usize)) {
                    continue;
                }
                triangles.push(next as usize);
                let vertices = &sheet.triangles[from];
                let ends = [1, 2].map(|i| vertices[(side + i) % 3]);
                if let Some(vertex) = opposite(next as usize, ends)
                    && !near.vertices.contains(&vertex)
                {
                    let shape = Shape {
                        corners: sheet.places(next as usize, [ends[0], ends[1], vertex], x),
                        may_differ: sheet.is_cut(),
                    };
                    near.unfold(vertex, ends, vertices[side], &shape, length);
                }
            }
        }
        first = last;
    }
    near
}
