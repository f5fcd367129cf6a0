//! The check for vertices on edges to which they do not belong.
//!
//! Where a coarse element meets two finer ones, the middle vertex of the finer ones lies on the edge of the coarse one and
//! is not connected to it. The mesh then has an invisible slit. The lines of a thread may cross and touch.
//!
//! A tree of planes finds the vertices, each plane across the longest side of the vertices that it divides, in a time
//! proportional to `n log n`.

use super::check::MIN_HEIGHT_RATIO;
use super::{Adjacency, Cells, MeshError, TetMesh, TriMesh};
use crate::Vec3;
use std::collections::BTreeMap;
use std::ops::Range;

/// Checks that no vertex of a sheet lies on an edge of its border, other than the edge's ends.
///
/// # Errors
/// [`MeshError::Hanging`] with the first edge, and its first vertex.
pub fn check_hanging(mesh: &TriMesh) -> Result<(), MeshError> {
    let adjacency = Adjacency::new(&mesh.triangles)?;
    let edges: Vec<[u32; 2]> = adjacency
        .boundary
        .iter()
        .map(|edge| edge.vertices)
        .collect();
    let vertices = (0_u32..).take(mesh.positions.len()).collect();
    first_on_edge(&mesh.positions, vertices, &edges)
}

/// Checks that no vertex of a solid's surface lies on an edge of the surface, other than the edge's ends and the middle of
/// a quadratic edge.
///
/// # Errors
/// [`MeshError::Hanging`] with the first edge, and its first vertex.
pub fn check_hanging_solid(mesh: &TetMesh) -> Result<(), MeshError> {
    // The corners of each face, then the middles of the edges after each corner, as places in a cell.
    const FACES: [[usize; 6]; 4] = [
        [0, 1, 2, 4, 5, 6],
        [0, 1, 3, 4, 8, 7],
        [0, 2, 3, 6, 9, 7],
        [1, 2, 3, 5, 9, 8],
    ];
    let is_quadratic = matches!(mesh.cells, Cells::Quadratic(_));
    let mut faces: BTreeMap<[u32; 3], Option<[u32; 6]>> = BTreeMap::new();
    for cell in mesh.cells.vertices() {
        for places in FACES {
            let vertex = |place: usize| cell.get(place).copied().unwrap_or(u32::MAX);
            let all = places.map(vertex);
            let [a, b, c, ..] = all;
            let mut corners = [a, b, c];
            corners.sort_unstable();
            faces
                .entry(corners)
                .and_modify(|face| *face = None)
                .or_insert(Some(all));
        }
    }
    let mut edges = Vec::new();
    for [a, b, c, ab, bc, ca] in faces.into_values().flatten() {
        for (from, middle, to) in [(a, ab, b), (b, bc, c), (c, ca, a)] {
            let mut add = |from: u32, to: u32| edges.push([from.min(to), from.max(to)]);
            if is_quadratic {
                add(from, middle);
                add(middle, to);
            } else {
                add(from, to);
            }
        }
    }
    edges.sort_unstable();
    edges.dedup();
    let mut vertices: Vec<u32> = edges.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    first_on_edge(&mesh.positions, vertices, &edges)
}

/// The error for the first edge on which one of the vertices lies.
fn first_on_edge(
    positions: &[Vec3],
    vertices: Vec<u32>,
    edges: &[[u32; 2]],
) -> Result<(), MeshError> {
    if edges.is_empty() {
        return Ok(());
    }
    let tree = Tree::new(positions, vertices);
    for &[a, b] in edges {
        let Some(vertex) = tree.first_near([a, b]) else {
            continue;
        };
        return Err(MeshError::Hanging { vertex, a, b });
    }
    Ok(())
}

/// Vertices, divided by planes.
struct Tree<'a> {
    positions: &'a [Vec3],
    /// The middle vertex of each range lies on the plane that divides the others of the range.
    vertices: Vec<u32>,
    /// The axis across which each vertex's plane lies.
    axes: Vec<u8>,
}

/// An edge, as a point and a vector.
struct Segment {
    ends: [u32; 2],
    start: Vec3,
    along: Vec3,
    /// The largest distance of a vertex on the edge.
    near: f64,
}

impl<'a> Tree<'a> {
    fn new(positions: &'a [Vec3], vertices: Vec<u32>) -> Self {
        let axes = vec![0; vertices.len()];
        let mut tree = Self {
            positions,
            vertices,
            axes,
        };
        tree.divide(0..tree.vertices.len());
        tree
    }

    fn position(&self, vertex: u32) -> Vec3 {
        let position = self.positions.get(vertex as usize);
        position.copied().unwrap_or_default()
    }

    fn divide(&mut self, range: Range<usize>) {
        let middle = range.start + range.len() / 2;
        let positions = self.positions;
        let at = |vertex: u32, axis: usize| {
            positions
                .get(vertex as usize)
                .and_then(|position| position.get(axis))
                .copied()
                .unwrap_or_default()
        };
        let Some(vertices) = self.vertices.get_mut(range.clone()) else {
            return;
        };
        if vertices.len() < 2 {
            return;
        }
        let extent = |axis: usize| {
            let numbers = || vertices.iter().map(|&vertex| at(vertex, axis));
            numbers().fold(f64::MIN, f64::max) - numbers().fold(f64::MAX, f64::min)
        };
        let extents = [0, 1, 2].map(extent);
        let longest = (0..3).max_by(|&a, &b| extents[a].total_cmp(&extents[b]));
        let axis = longest.unwrap_or_default();
        vertices.select_nth_unstable_by(middle - range.start, |&a, &b| {
            at(a, axis).total_cmp(&at(b, axis)).then(a.cmp(&b))
        });
        if let Some(slot) = self.axes.get_mut(middle) {
            *slot = axis as u8;
        }
        self.divide(range.start..middle);
        self.divide(middle + 1..range.end);
    }

    /// The lowest vertex on an edge, other than its ends.
    fn first_near(&self, ends: [u32; 2]) -> Option<u32> {
        let [start, end] = ends.map(|vertex| self.position(vertex));
        let along = end - start;
        let segment = Segment {
            ends,
            start,
            along,
            // A triangle of the edge and the vertex would count as flat.
            near: MIN_HEIGHT_RATIO * along.norm(),
        };
        let mut first = None;
        self.search(0..self.vertices.len(), &segment, [0.0, 1.0], &mut first);
        first
    }

    /// Searches the vertices of a range for one on a part of a segment, `from` to `to` of its length.
    fn search(
        &self,
        range: Range<usize>,
        segment: &Segment,
        [from, to]: [f64; 2],
        first: &mut Option<u32>,
    ) {
        let middle = range.start + range.len() / 2;
        let (Some(&vertex), false) = (self.vertices.get(middle), range.is_empty()) else {
            return;
        };
        let position = self.position(vertex);
        if !segment.ends.contains(&vertex)
            && segment.is_near(&position)
            && first.is_none_or(|first| vertex < first)
        {
            *first = Some(vertex);
        }
        let axis = self.axes.get(middle).map_or(0, |&axis| usize::from(axis));
        let [start, along, plane] = [&segment.start, &segment.along, &position]
            .map(|vector| vector.get(axis).copied().unwrap_or_default());
        // The part of the segment on either side of the plane, and a little more.
        for (range, is_below) in [(range.start..middle, true), (middle + 1..range.end, false)] {
            let bound = plane
                + if is_below {
                    segment.near
                } else {
                    -segment.near
                };
            let cross = (bound - start) / along;
            let (mut from, mut to) = (from, to);
            if along == 0.0 || !cross.is_finite() {
                if (start > bound) == is_below && start != bound {
                    continue;
                }
            } else if (along > 0.0) == is_below {
                to = to.min(cross);
            } else {
                from = from.max(cross);
            }
            if from <= to {
                self.search(range, segment, [from, to], first);
            }
        }
    }
}

impl Segment {
    /// Whether a position lies on the segment, between its ends.
    fn is_near(&self, position: &Vec3) -> bool {
        let offset = position - self.start;
        let part = offset.dot(&self.along) / self.along.norm_squared();
        part > 0.0 && part < 1.0 && (offset - self.along * part).norm() <= self.near
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_finds_what_a_search_of_all_pairs_finds() {
        // Places on a coarse lattice, so that many lie on segments between others.
        let mut state = 1_u64;
        let mut next = |below: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) % below
        };
        let mut found = 0;
        for _ in 0..300 {
            let mut places = Vec::new();
            for _ in 0..12 {
                let place = [next(5), next(5), next(2)];
                if !places.contains(&place) {
                    places.push(place);
                }
            }
            let positions: Vec<Vec3> = places
                .iter()
                .map(|place| Vec3::from(place.map(|x| x as f64)))
                .collect();
            let count = positions.len() as u32;
            let tree = Tree::new(&positions, (0..count).collect());
            for a in 0..count {
                for b in a + 1..count {
                    let [start, end] = [a, b].map(|vertex| positions[vertex as usize]);
                    let along = end - start;
                    let on = |vertex: &u32| {
                        let offset = positions[*vertex as usize] - start;
                        let part = offset.dot(&along);
                        offset.cross(&along).norm() < 1e-9
                            && part > 0.0
                            && part < along.norm_squared()
                    };
                    let expected = (0..count).find(on);
                    assert_eq!(tree.first_near([a, b]), expected, "{positions:?} {a} {b}");
                    found += usize::from(expected.is_some());
                }
            }
        }
        assert!(
            found > 500,
            "only {found} of the cases have a vertex on an edge"
        );
    }
}
