//! From two triangles to their vertex-triangle and edge-edge pairs.
//!
//! Each vertex and each edge belongs to one triangle, so that every pair of things is of one pair of triangles.

use super::NEED;
use physics::Vec3;
use physics::contact::aabb::Aabb;
use physics::contact::{Pair, Surfaces};
use std::collections::BTreeMap;

/// The surfaces, and what belongs to each triangle.
pub(crate) struct Things<'a> {
    pub(crate) surfaces: &'a Surfaces,
    /// The part of each triangle.
    pub(crate) part: Vec<usize>,
    vertices: Vec<Vec<u32>>,
    edges: Vec<Vec<u32>>,
}

impl<'a> Things<'a> {
    pub(crate) fn new(surfaces: &'a Surfaces) -> Self {
        let mut edges: BTreeMap<[u32; 2], u32> = surfaces.edges.iter().copied().zip(0..).collect();
        let mut is_homeless = vec![true; surfaces.vertices];
        let triangles = &surfaces.triangles;
        let own_vertices = triangles.iter().map(|corners| {
            let mut homeless = |v: &u32| core::mem::take(&mut is_homeless[*v as usize]);
            corners.iter().copied().filter(|v| homeless(v)).collect()
        });
        let own_edges = triangles.iter().map(|[a, b, c]| {
            let sides = [[a, b], [b, c], [c, a]];
            let own = sides.map(|[a, b]| edges.remove(&[*a.min(b), *a.max(b)]));
            own.into_iter().flatten().collect()
        });
        Self {
            part: triangles
                .iter()
                .map(|corners| surfaces.part_of(corners[0]))
                .collect(),
            vertices: own_vertices.collect(),
            edges: own_edges.collect(),
            surfaces,
        }
    }

    /// Adds the pairs of two triangles that are nearer than [`NEED`]. Returns the number of distances that were computed.
    pub(crate) fn narrow(&self, x: &[Vec3], a: u32, b: u32, found: &mut Vec<Pair>) -> usize {
        let (triangles, all_edges) = (&self.surfaces.triangles, &self.surfaces.edges);
        let bounds = |vertices: &[u32]| Aabb::of(vertices.iter().map(|v| &x[*v as usize]));
        let mut distances = 0;
        let mut try_pair = |pair: Pair| {
            if !pair.is_joined(self.surfaces) {
                distances += 1;
                if pair.foot(self.surfaces, x).apart.norm() <= NEED {
                    found.push(pair);
                }
            }
        };
        for (one, other) in [(a, b), (b, a)] {
            let of_triangle = bounds(&triangles[other as usize]);
            for vertex in &self.vertices[one as usize] {
                if bounds(&[*vertex]).is_within(&of_triangle, NEED) {
                    try_pair(Pair::VertexTriangle(*vertex, other));
                }
            }
        }
        for one in &self.edges[a as usize] {
            let of_edge = bounds(&all_edges[*one as usize]);
            for other in &self.edges[b as usize] {
                if of_edge.is_within(&bounds(&all_edges[*other as usize]), NEED) {
                    try_pair(Pair::EdgeEdge(*one.min(other), *one.max(other)));
                }
            }
        }
        distances
    }

    /// Whether two triangles may touch, of which the first one has the smaller number.
    pub(crate) fn may_touch(&self, a: u32, b: u32) -> bool {
        a < b
            && self
                .surfaces
                .may_touch(self.part[a as usize], self.part[b as usize])
    }
}
