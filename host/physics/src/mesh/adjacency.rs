//! The adjacency of triangles: which triangles meet at which edge.
//!
//! The edges are in ascending order of their vertices, whatever the order of the triangles, so that sums
//! over edges repeat to the last bit. The list is made by sorting, not by hashing.

use super::MeshError;

/// The edges of a mesh, each once.
///
/// ```
/// use physics::mesh::{Adjacency, MeshError};
///
/// let adjacency = Adjacency::new(&[[0, 1, 2], [0, 2, 3]])?;
/// assert_eq!(adjacency.boundary.len(), 4);
/// assert_eq!(adjacency.interior[0].vertices, [0, 2]);
/// assert_eq!(adjacency.interior[0].opposite, [1, 3]);
/// # Ok::<(), MeshError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Adjacency {
    /// Edges between two triangles, ascending by vertices.
    pub interior: Vec<InteriorEdge>,
    /// Edges of one triangle only, ascending by vertices.
    pub boundary: Vec<BoundaryEdge>,
}

/// An edge where two triangles meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InteriorEdge {
    /// Its vertices, ascending.
    pub vertices: [u32; 2],
    /// Its triangles, ascending.
    pub triangles: [u32; 2],
    /// The third vertex of each of these triangles.
    pub opposite: [u32; 2],
}

/// An edge of one triangle only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoundaryEdge {
    /// Its vertices, ascending.
    pub vertices: [u32; 2],
    /// Its triangle.
    pub triangle: u32,
    /// The third vertex of that triangle.
    pub opposite: u32,
}

/// An edge as a side of one of its triangles. Sides are ordered by vertices, then by triangle, which is the
/// order of the result.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    vertices: [u32; 2],
    triangle: u32,
    opposite: u32,
}

impl Adjacency {
    /// Finds the edges of `triangles` in a time proportional to `n log n` for `n` triangles.
    ///
    /// Vertex indices are not checked. The three indices of a triangle must differ.
    ///
    /// # Errors
    /// [`MeshError::TooMany`] if the triangles cannot be numbered by `u32`, and
    /// [`MeshError::CrowdedEdge`] if more than two of them meet at an edge.
    pub fn new(triangles: &[[u32; 3]]) -> Result<Self, MeshError> {
        if triangles.len() > super::check::MAX_COUNT {
            return Err(MeshError::TooMany {
                entities: "triangles",
                found: triangles.len(),
            });
        }
        let mut sides: Vec<Side> = (0_u32..)
            .zip(triangles)
            .flat_map(|(triangle, &[a, b, c])| {
                [(a, b, c), (b, c, a), (c, a, b)].map(|(from, to, opposite)| Side {
                    vertices: [from.min(to), from.max(to)],
                    triangle,
                    opposite,
                })
            })
            .collect();
        sides.sort_unstable();

        let mut adjacency = Self::default();
        for edge in sides.chunk_by(|one, next| one.vertices == next.vertices) {
            match *edge {
                [only] => adjacency.boundary.push(BoundaryEdge {
                    vertices: only.vertices,
                    triangle: only.triangle,
                    opposite: only.opposite,
                }),
                [first, second] => adjacency.interior.push(InteriorEdge {
                    vertices: first.vertices,
                    triangles: [first.triangle, second.triangle],
                    opposite: [first.opposite, second.opposite],
                }),
                [first, second, third, ..] => {
                    let [a, b] = first.vertices;
                    let triangles = [first.triangle, second.triangle, third.triangle];
                    return Err(MeshError::CrowdedEdge { a, b, triangles });
                }
                [] => {} // `chunk_by` gives no empty chunk
            }
        }
        Ok(adjacency)
    }
}
