//! The data of a surface.

use super::NONE;
use super::check::{SurfaceError, neighbours_of};
use super::journal::Journal;

/// The corners of a triangle at rest (m), in the order of its vertices.
///
/// Each triangle has a frame of its own. A divided triangle keeps its frame, so the warp of a woven material keeps its
/// direction. Only lengths and angles within a frame count where frames meet, so triangles may be mirrored in their
/// frames.
pub type Shape = [[f64; 2]; 3];

/// How many vertices and triangles edits may add to a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reserve {
    /// Vertices. An opened edge takes at most two, a cut at most three.
    pub vertices: usize,
    /// Triangles. A cut takes at most two.
    pub triangles: usize,
}

/// The origin of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// The surface was made with the vertex.
    Original,
    /// A copy of an older vertex, at the same place when it was made.
    Twin {
        /// The older vertex.
        of: u32,
    },
    /// A point of an edge that was divided: `(1 - weight) ends[0] + weight ends[1]`.
    Between {
        /// The ends of the edge. Both are older.
        ends: [u32; 2],
        /// The weight of the second end, between 0 and 1.
        weight: f64,
    },
}

/// A triangle surface that can be torn. The [module](super) describes it.
///
/// ```
/// use physics::topology::{Reserve, Surface, NONE};
///
/// // A square of two triangles.
/// let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
/// let surface = Surface::new(4, &[[0, 1, 2], [0, 2, 3]], &[[a, b, c], [a, c, d]], Reserve::default())?;
/// assert_eq!(surface.neighbours(), [[NONE, 1, NONE], [NONE, NONE, 0]]);
/// assert!((surface.area_of_vertex(0) - 1.0 / 3.0).abs() < 1e-15);
/// # Ok::<(), physics::topology::SurfaceError>(())
/// ```
#[derive(Debug)]
pub struct Surface {
    pub(super) triangles: Vec<[u32; 3]>,
    /// Across the edge opposite to each corner, or `NONE` at a border.
    pub(super) neighbours: Vec<[u32; 3]>,
    pub(super) shapes: Vec<Shape>,
    pub(super) parents: Vec<u32>,
    pub(super) origins: Vec<Origin>,
    /// A triangle at each vertex: the first one of the fan if the fan is open. `NONE` for a vertex of no triangle.
    pub(super) first: Vec<u32>,
    pub(super) journal: Journal,
    /// Vertices and triangles that the surface can hold.
    pub(super) limits: Reserve,
}

impl Clone for Surface {
    /// The copy has the whole reserve, too.
    fn clone(&self) -> Self {
        Self {
            triangles: copied(&self.triangles, self.limits.triangles),
            neighbours: copied(&self.neighbours, self.limits.triangles),
            shapes: copied(&self.shapes, self.limits.triangles),
            parents: copied(&self.parents, self.limits.triangles),
            origins: copied(&self.origins, self.limits.vertices),
            first: copied(&self.first, self.limits.vertices),
            journal: self.journal.clone(),
            limits: self.limits,
        }
    }
}

/// The values of `from`, with room for `capacity` values.
pub(super) fn copied<T: Clone>(from: &[T], capacity: usize) -> Vec<T> {
    let mut all = Vec::with_capacity(capacity.max(from.len()));
    all.extend_from_slice(from);
    all
}

impl Surface {
    /// A surface of `triangles` over `vertices` vertices, with one shape a triangle, and room for what edits add.
    ///
    /// # Errors
    /// [`SurfaceError`] if the triangles form no surface with one fan a vertex, all wound alike, or a shape has no area.
    pub fn new(
        vertices: usize,
        triangles: &[[u32; 3]],
        shapes: &[Shape],
        reserve: Reserve,
    ) -> Result<Self, SurfaceError> {
        let neighbours = neighbours_of(vertices, triangles, shapes)?;
        let limits = Reserve {
            vertices: vertices.saturating_add(reserve.vertices),
            triangles: triangles.len().saturating_add(reserve.triangles),
        };
        if limits.vertices >= NONE as usize || limits.triangles >= NONE as usize {
            return Err(SurfaceError::TooMany);
        }
        let parents: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut surface = Self {
            triangles: copied(triangles, limits.triangles),
            neighbours: copied(&neighbours, limits.triangles),
            shapes: copied(shapes, limits.triangles),
            parents: copied(&parents, limits.triangles),
            origins: copied(&vec![Origin::Original; vertices], limits.vertices),
            first: copied(&vec![NONE; vertices], limits.vertices),
            journal: Journal::new(limits),
            limits,
        };
        for triangle in 0..triangles.len() as u32 {
            for vertex in triangles[triangle as usize] {
                if surface.first[vertex as usize] == NONE {
                    surface.first[vertex as usize] = surface.first_from(vertex, triangle);
                }
            }
        }
        surface.check()?;
        Ok(surface)
    }

    /// The number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.origins.len()
    }

    /// The number of triangles.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// The numbers of vertices and of triangles that the surface can hold in all.
    pub fn limits(&self) -> Reserve {
        self.limits
    }

    /// The vertices of each triangle, counterclockwise. Edits keep the order of the corners.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// For each corner of each triangle, the triangle across the opposite edge, or [`NONE`] at a border.
    pub fn neighbours(&self) -> &[[u32; 3]] {
        &self.neighbours
    }

    /// The corners of each triangle at rest (m), in the frame of its original triangle.
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// The corners of a triangle at rest (m), all zero if there is no such triangle.
    pub fn shape(&self, triangle: u32) -> Shape {
        self.shapes
            .get(triangle as usize)
            .copied()
            .unwrap_or_default()
    }

    /// The original triangle that each triangle is a part of. An original triangle is its own.
    pub fn parents(&self) -> &[u32] {
        &self.parents
    }

    /// The original triangle that a triangle is a part of, or [`NONE`] if there is no such triangle.
    pub fn parent(&self, triangle: u32) -> u32 {
        self.parents.get(triangle as usize).copied().unwrap_or(NONE)
    }

    /// Where each vertex comes from.
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    /// Where a vertex comes from. `Original` if there is no such vertex.
    pub fn origin(&self, vertex: u32) -> Origin {
        let found = self.origins.get(vertex as usize);
        found.copied().unwrap_or(Origin::Original)
    }

    /// The triangles that the latest edit changed (corners, shape or a neighbour), ascending, new ones included.
    ///
    /// A quantity that depends on the corners of neighbours, such as bending, changes for the neighbours of these
    /// triangles, too. An edit that was refused leaves the list empty.
    pub fn touched(&self) -> &[u32] {
        self.journal.touched()
    }

    /// For each edge that the latest edit divided, the two parts of its triangles: `[triangle, new triangle]`. The first
    /// number is that of the triangle before the edit.
    pub fn divided(&self) -> &[[u32; 2]] {
        self.journal.divided()
    }

    /// The area of a triangle at rest (m²).
    pub fn area(&self, triangle: u32) -> f64 {
        0.5 * twice_area(&self.shape(triangle)).abs()
    }

    /// A third of the area of the triangles at a vertex (m²).
    pub fn area_of_vertex(&self, vertex: u32) -> f64 {
        let areas = self.fan(vertex).map(|corner| self.area(corner.triangle));
        areas.sum::<f64>() / 3.0
    }

    /// The smallest angle of all triangles at rest (rad), π without triangles.
    pub fn smallest_angle(&self) -> f64 {
        let angles = self.shapes.iter().map(smallest_angle);
        angles.fold(core::f64::consts::PI, f64::min)
    }
}

/// Twice the signed area of a shape (m²): negative if the triangle is mirrored in its frame.
pub(super) fn twice_area(&[a, b, c]: &Shape) -> f64 {
    cross(minus(b, a), minus(c, a))
}

/// The smallest angle of a shape (rad).
pub(super) fn smallest_angle(shape: &Shape) -> f64 {
    let angles = [0, 1, 2].map(|corner| angle(shape, corner));
    angles[0].min(angles[1]).min(angles[2])
}

/// The angle of a shape at a corner (rad).
pub(super) fn angle(shape: &Shape, corner: usize) -> f64 {
    let at = shape[corner];
    let (a, b) = (
        minus(shape[(corner + 1) % 3], at),
        minus(shape[(corner + 2) % 3], at),
    );
    libm::atan2(cross(a, b).abs(), dot(a, b))
}

pub(super) fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// The point `(1 - weight) a + weight b`.
pub(super) fn between(a: [f64; 2], b: [f64; 2], weight: f64) -> [f64; 2] {
    [a[0] + weight * (b[0] - a[0]), a[1] + weight * (b[1] - a[1])]
}

pub(super) fn length(a: [f64; 2]) -> f64 {
    libm::hypot(a[0], a[1])
}
