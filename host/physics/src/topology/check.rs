//! Which triangles form a surface, and the consistency of a surface.

use super::NONE;
use super::surface::{Shape, Surface, length, minus, twice_area};
use thiserror::Error;

/// The least ratio of a triangle's height to its longest edge at rest.
const MIN_HEIGHT_RATIO: f64 = 1e-6;

/// Why triangles form no surface that can be torn. Vertices and triangles are counted from zero.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum SurfaceError {
    /// The number of shapes is not the number of triangles.
    #[error(
        "{shapes} shapes are given for {triangles} triangles; every triangle needs a shape at rest"
    )]
    Shapes {
        /// The number of shapes.
        shapes: usize,
        /// The number of triangles.
        triangles: usize,
    },
    /// Vertices or triangles, with their reserve, are too many for their numbers.
    #[error("there are too many vertices or triangles; a surface holds less than {NONE} of each")]
    TooMany,
    /// A triangle names a vertex that does not exist, or a vertex twice.
    #[error("triangle {triangle} needs three different vertices below {vertices}")]
    Corners {
        /// The triangle.
        triangle: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// A triangle has no area at rest, or a coordinate that is not finite.
    #[error("triangle {triangle} has no area at rest")]
    Flat {
        /// The triangle.
        triangle: u32,
    },
    /// More than two triangles meet at an edge.
    #[error("more than two triangles meet at the edge between vertices {a} and {b}")]
    Edge {
        /// One end of the edge.
        a: u32,
        /// The other end.
        b: u32,
    },
    /// Two neighbours are wound in opposite directions.
    #[error(
        "triangles {first} and {second} are wound in opposite directions; give the vertices of both counterclockwise as \
         seen from one side of the surface"
    )]
    Winding {
        /// One triangle.
        first: u32,
        /// The other triangle.
        second: u32,
    },
    /// The triangles at a vertex form more than one fan.
    #[error(
        "parts of the surface touch at vertex {vertex} only; give each part a vertex of its own there"
    )]
    Fans {
        /// The vertex.
        vertex: u32,
    },
    /// Two triangles do not name each other as neighbours, or their common edge has other ends. No edit leads here.
    #[error("triangle {triangle} and its neighbour {neighbour} do not agree on their edge")]
    Neighbours {
        /// The triangle.
        triangle: u32,
        /// The triangle that it names.
        neighbour: u32,
    },
}

/// Whether a shape is finite and has an area.
fn has_area(shape: &Shape) -> bool {
    let [a, b, c] = *shape;
    let longest = length(minus(b, a))
        .max(length(minus(c, b)))
        .max(length(minus(a, c)));
    longest.is_finite() && twice_area(shape).abs() > MIN_HEIGHT_RATIO * longest * longest
}

/// The neighbours of each triangle, across the edge opposite to each corner.
pub(super) fn neighbours_of(
    vertices: usize,
    triangles: &[[u32; 3]],
    shapes: &[Shape],
) -> Result<Vec<[u32; 3]>, SurfaceError> {
    if shapes.len() != triangles.len() {
        return Err(SurfaceError::Shapes {
            shapes: shapes.len(),
            triangles: triangles.len(),
        });
    }
    if triangles.len() >= NONE as usize {
        return Err(SurfaceError::TooMany);
    }
    // The sides of the triangles: ascending ends, triangle, opposite corner, and whether the ends ascend in it.
    let mut sides = Vec::with_capacity(3 * triangles.len());
    for (triangle, (corners, shape)) in (0_u32..).zip(triangles.iter().zip(shapes)) {
        let [a, b, c] = *corners;
        if a == b || b == c || c == a || corners.iter().any(|&v| v as usize >= vertices) {
            return Err(SurfaceError::Corners { triangle, vertices });
        }
        if !has_area(shape) {
            return Err(SurfaceError::Flat { triangle });
        }
        for corner in 0..3 {
            let (from, to) = (corners[(corner + 1) % 3], corners[(corner + 2) % 3]);
            sides.push((from.min(to), from.max(to), triangle, corner, from < to));
        }
    }
    sides.sort_unstable();
    let mut neighbours = vec![[NONE; 3]; triangles.len()];
    for edge in sides.chunk_by(|one, other| (one.0, one.1) == (other.0, other.1)) {
        match *edge {
            [_] => {}
            [
                (_, _, first, at, ascends),
                (_, _, second, opposite, descends),
            ] => {
                if ascends == descends {
                    return Err(SurfaceError::Winding { first, second });
                }
                neighbours[first as usize][at] = second;
                neighbours[second as usize][opposite] = first;
            }
            _ => {
                let (a, b, ..) = edge[0];
                return Err(SurfaceError::Edge { a, b });
            }
        }
    }
    Ok(neighbours)
}

impl Surface {
    /// Checks the whole surface: corners, shapes, mutual neighbours, winding, and one fan a vertex. For tests and for
    /// construction: the check allocates, and takes a time proportional to the number of triangles.
    ///
    /// # Errors
    /// The first fault found.
    pub fn check(&self) -> Result<(), SurfaceError> {
        let vertices = self.vertex_count();
        let mut corners_at = vec![0_usize; vertices];
        for (triangle, corners) in (0_u32..).zip(&self.triangles) {
            let [a, b, c] = *corners;
            if a == b || b == c || c == a || corners.iter().any(|&v| v as usize >= vertices) {
                return Err(SurfaceError::Corners { triangle, vertices });
            }
            if !has_area(&self.shape(triangle)) {
                return Err(SurfaceError::Flat { triangle });
            }
            for corner in 0..3 {
                corners_at[corners[corner] as usize] += 1;
                let neighbour = self.neighbours[triangle as usize][corner];
                if neighbour != NONE && !self.agree(triangle, corner, neighbour) {
                    return Err(SurfaceError::Neighbours {
                        triangle,
                        neighbour,
                    });
                }
            }
        }
        for (vertex, &corners) in (0_u32..).zip(&corners_at) {
            // The fan is as long as the number of triangles at the vertex, and begins at the border if there is one.
            let passed = self.fan(vertex).take(corners + 1);
            let ends_at_border = passed.clone().any(|corner| self.before(corner) == NONE);
            if passed.count() != corners || ends_at_border != self.on_border(vertex) {
                return Err(SurfaceError::Fans { vertex });
            }
        }
        Ok(())
    }

    /// Whether the neighbour across the edge opposite to `corner` names `triangle` across the same edge, reversed.
    fn agree(&self, triangle: u32, corner: usize, neighbour: u32) -> bool {
        let corners = self.triangles[triangle as usize];
        let (from, to) = (corners[(corner + 1) % 3], corners[(corner + 2) % 3]);
        let Some(there) = self.triangles.get(neighbour as usize) else {
            return false;
        };
        (0..3).any(|k| {
            there[(k + 1) % 3] == to
                && there[(k + 2) % 3] == from
                && self.neighbours[neighbour as usize][k] == triangle
        })
    }
}
