//! Pairs that may touch: a vertex and a triangle, or two edges; their distance and its feet.

use super::distance::{edge_edge, point_triangle};
use super::surface::Surfaces;
use crate::Vec3;

/// The fraction of the distance at rest at which the two sides of a sliver touch: a sheet at rest does not touch itself.
const NEARLY: f64 = 0.9;

/// The distance at rest (m) below which two things of one part are at the same place: rounding of coordinates, not an element.
const JOINED: f64 = 1e-12;

/// Two things that may touch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Pair {
    /// A vertex and a triangle, by their numbers.
    VertexTriangle(u32, u32),
    /// Two edges, by their numbers.
    EdgeEdge(u32, u32),
}

/// The shortest connection of a pair: `J u = sum w_i u_i` is the displacement of the first foot against the second one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The vertices: those of the first thing, then those of the second one.
    pub vertices: [u32; 4],
    /// Their weights. Those of the first thing sum to one, those of the second one to minus one.
    pub weights: [f64; 4],
    /// From the second foot to the first one (m).
    pub apart: Vec3,
}

impl Foot {
    /// The difference of the feet for vectors `of` vertices.
    pub fn difference(&self, of: impl Fn(u32) -> Vec3) -> Vec3 {
        let parts = self.vertices.into_iter().zip(self.weights);
        parts.map(|(vertex, weight)| of(vertex) * weight).sum()
    }

    /// By how much (m) a direction separates the first `split` vertices from the others, which are at some positions (m): the
    /// gap between the planes across the direction through the nearest vertices.
    pub fn gap(&self, split: usize, direction: &Vec3, at: impl Fn(u32) -> Vec3) -> f64 {
        let along = self.vertices.map(|vertex| direction.dot(&at(vertex)));
        let (first, second) = along.split_at(split);
        let least = first.iter().copied().fold(f64::INFINITY, f64::min);
        least - second.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }
}

impl Pair {
    /// The vertices of both things.
    pub fn vertices(self, surfaces: &Surfaces) -> [u32; 4] {
        match self {
            Self::VertexTriangle(vertex, triangle) => {
                let [a, b, c] = surfaces.triangles[triangle as usize];
                [vertex, a, b, c]
            }
            Self::EdgeEdge(one, other) => {
                let ([a, b], [c, d]) =
                    (surfaces.edges[one as usize], surfaces.edges[other as usize]);
                [a, b, c, d]
            }
        }
    }

    /// Number of vertices of the first thing.
    pub fn split(self) -> usize {
        match self {
            Self::VertexTriangle(..) => 1,
            Self::EdgeEdge(..) => 2,
        }
    }

    /// Whether the two things share a vertex. Such a pair never touches.
    pub fn is_joined(self, surfaces: &Surfaces) -> bool {
        let vertices = self.vertices(surfaces);
        let (first, second) = vertices.split_at(self.split());
        first.iter().any(|vertex| second.contains(vertex))
    }

    /// Whether the two things are at twins that are closed, or at the same place at rest without twins: a tear has cut an edge of one
    /// of its faces, and a vertex in the other face lies on this edge. Such a pair does not touch.
    pub(crate) fn is_closed(self, surfaces: &Surfaces) -> bool {
        let mut twins = self.twins(surfaces).peekable();
        if twins.peek().is_some() {
            twins.any(|are_open| !are_open)
        } else {
            self.near_at_rest(surfaces)
                .is_some_and(|near| near < JOINED)
        }
    }

    /// The distance at which the two things touch (m), if their parts do at `most`. Where tears have left slivers that are narrower
    /// than the thickness, it is nearly the distance at rest.
    pub(crate) fn thickness(self, surfaces: &Surfaces, most: f64) -> f64 {
        let near = self
            .near_at_rest(surfaces)
            .map_or(most, |near| (NEARLY * near).min(most));
        if near < most && self.twins(surfaces).next().is_none() {
            near
        } else {
            most
        }
    }

    /// The distance at rest (m) of two things of one part that tears, if it is not larger than the thickness.
    fn near_at_rest(self, surfaces: &Surfaces) -> Option<f64> {
        if surfaces.rest.is_empty() {
            return None;
        }
        let vertices = self.vertices(surfaces);
        let [one, other] = [vertices[0], vertices[3]].map(|vertex| surfaces.part_of(vertex));
        let part = &surfaces.parts[one];
        if one != other || !part.tears {
            return None;
        }
        let near = self.foot(surfaces, &surfaces.rest).apart.norm();
        (near <= part.thickness).then_some(near)
    }

    /// Of each vertex of the first thing that has a twin in the second one, whether the two are open.
    fn twins(self, surfaces: &Surfaces) -> impl Iterator<Item = bool> {
        let (vertices, split) = (self.vertices(surfaces), self.split());
        let each =
            (0..split).flat_map(move |a| (split..4).map(move |b| [vertices[a], vertices[b]]));
        each.filter_map(|[a, b]| surfaces.are_open(a, b))
    }

    /// The shortest connection at the positions `x` (m).
    pub fn foot(self, surfaces: &Surfaces, x: &[Vec3]) -> Foot {
        self.foot_at(surfaces, |vertex| x[vertex as usize])
    }

    /// The shortest connection, with the position (m) of each vertex.
    pub fn foot_at(self, surfaces: &Surfaces, at: impl Fn(u32) -> Vec3) -> Foot {
        let vertices = self.vertices(surfaces);
        let [a, b, c, d] = &vertices.map(at);
        match self {
            Self::VertexTriangle(..) => {
                let on = point_triangle(a, [b, c, d]);
                let [u, v, w] = on.weights;
                Foot {
                    vertices,
                    weights: [1.0, -u, -v, -w],
                    apart: on.apart,
                }
            }
            Self::EdgeEdge(..) => {
                let on = edge_edge([a, b], [c, d]);
                Foot {
                    vertices,
                    weights: [1.0 - on.s, on.s, on.t - 1.0, -on.t],
                    apart: on.apart,
                }
            }
        }
    }
}
