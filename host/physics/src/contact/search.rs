//! All pairs of two clusters that are nearer than a distance.

use super::aabb::Aabb;
use super::hierarchy::{Hierarchy, LEAF, Leaf};
use super::pair::Pair;
use super::surface::Surfaces;
use crate::Vec3;

/// Most edges of a leaf: each of its elements brings three at most.
const EDGES: usize = 3 * LEAF;

/// Where and how far a search goes.
pub(super) struct Search<'a> {
    pub surfaces: &'a Surfaces,
    pub hierarchy: &'a Hierarchy,
    /// Positions of the vertices (m).
    pub x: &'a [Vec3],
    /// The largest distance of a pair (m).
    pub radius: f64,
}

/// The boxes of the things of a leaf.
struct Boxes<const N: usize> {
    all: [Aabb; N],
}

impl<const N: usize> Boxes<N> {
    fn new<'a>(things: impl Iterator<Item = &'a [u32]>, x: &[Vec3]) -> Self {
        let mut all = [Aabb::EMPTY; N];
        for (bounds, vertices) in all.iter_mut().zip(things) {
            *bounds = Aabb::of(vertices.iter().map(|vertex| &x[*vertex as usize]));
        }
        Self { all }
    }
}

impl Search<'_> {
    /// Calls `found` for each pair of the clusters `a` and `b` within the radius, with its distance (m). Returns the number
    /// of distances that were computed.
    pub(super) fn clusters(&self, a: usize, b: usize, found: &mut dyn FnMut(Pair, f64)) -> usize {
        let leaves = |cluster: usize| {
            let range = self.hierarchy.clusters()[cluster].leaves.clone();
            &self.hierarchy.leaves[range]
        };
        let mut computed = 0;
        for (i, one) in leaves(a).iter().enumerate() {
            let others = if a == b { &leaves(b)[i..] } else { leaves(b) };
            for (j, other) in others.iter().enumerate() {
                if one.bounds.is_within(&other.bounds, self.radius) {
                    let is_same = a == b && j == 0;
                    computed += self.leaves(one, other, is_same, found);
                }
            }
        }
        computed
    }

    fn leaves(
        &self,
        one: &Leaf,
        other: &Leaf,
        is_same: bool,
        found: &mut dyn FnMut(Pair, f64),
    ) -> usize {
        let mut computed = self.vertices_and_triangles(one, other, found);
        if !is_same {
            computed += self.vertices_and_triangles(other, one, found);
        }
        computed + self.edges(one, other, is_same, found)
    }

    fn vertices_and_triangles(
        &self,
        of_vertices: &Leaf,
        of_triangles: &Leaf,
        found: &mut dyn FnMut(Pair, f64),
    ) -> usize {
        let (surfaces, x) = (self.surfaces, self.x);
        let triangles = &self.hierarchy.triangles[of_triangles.triangles.clone()];
        if triangles.is_empty() {
            return 0;
        }
        let corners = triangles
            .iter()
            .map(|t| surfaces.triangles[*t as usize].as_slice());
        let boxes = Boxes::<LEAF>::new(corners, x);
        let mut computed = 0;
        for vertex in &self.hierarchy.vertices[of_vertices.vertices.clone()] {
            let at = Aabb::of([&x[*vertex as usize]]);
            if !at.is_within(&of_triangles.bounds, self.radius) {
                continue;
            }
            for (triangle, bounds) in triangles.iter().zip(&boxes.all) {
                if at.is_within(bounds, self.radius) {
                    computed += self.try_pair(Pair::VertexTriangle(*vertex, *triangle), found);
                }
            }
        }
        computed
    }

    fn edges(
        &self,
        one: &Leaf,
        other: &Leaf,
        is_same: bool,
        found: &mut dyn FnMut(Pair, f64),
    ) -> usize {
        let (surfaces, x) = (self.surfaces, self.x);
        let firsts = &self.hierarchy.edges[one.edges.clone()];
        let seconds = &self.hierarchy.edges[other.edges.clone()];
        let ends = seconds
            .iter()
            .map(|e| surfaces.edges[*e as usize].as_slice());
        let boxes = Boxes::<EDGES>::new(ends, x);
        let mut computed = 0;
        for (i, first) in firsts.iter().enumerate() {
            let ends = surfaces.edges[*first as usize];
            let at = Aabb::of(ends.iter().map(|vertex| &x[*vertex as usize]));
            if !at.is_within(&other.bounds, self.radius) {
                continue;
            }
            let from = if is_same { i + 1 } else { 0 };
            for (second, bounds) in seconds.iter().zip(&boxes.all).skip(from) {
                if at.is_within(bounds, self.radius) {
                    computed += self.try_pair(Pair::EdgeEdge(*first, *second), found);
                }
            }
        }
        computed
    }

    fn try_pair(&self, pair: Pair, found: &mut dyn FnMut(Pair, f64)) -> usize {
        if pair.is_joined(self.surfaces) || pair.is_closed(self.surfaces) {
            return 0;
        }
        let distance = pair.foot(self.surfaces, self.x).apart.norm();
        if distance <= self.radius {
            found(pair, distance);
        }
        1
    }
}
