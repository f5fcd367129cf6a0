//! Flat patterns: the rest shapes of the triangles of a sheet, cut out of flat cloth and sewn together.
//!
//! A garment is made of flat **panels**. Each triangle of its mesh has a flat shape at rest, which the positions of the
//! mesh do not show: the mesh is the sewn garment, in any shape. A flat pattern gives each triangle its three corners in
//! the plane of the cloth. A vertex on a seam has other coordinates in each of the panels that meet there. (Narain, Samii
//! and O'Brien, "Adaptive anisotropic remeshing for cloth simulation", 2012, call these coordinates the material space.)
//!
//! The two sides of a seam may differ in length: the cloth is eased or gathered there. Panels may overlap in the plane,
//! and may lie there with either face up, because only lengths and angles within triangles matter. Inside a panel,
//! however, a triangle that lies on its neighbour is a fault of the pattern.

use super::check::{MAX_COORDINATE, MIN_HEIGHT_RATIO};
use super::{Adjacency, TriMesh};
use crate::Vec3;
use thiserror::Error;

/// The flat rest shapes of the triangles of a mesh.
///
/// ```
/// use physics::Vec3;
/// use physics::mesh::{FlatPattern, TriMesh};
///
/// // A roof of two triangles that are flat in the pattern, which makes the first one 1 % longer.
/// let positions = vec![
///     Vec3::new(0.0, 0.0, 0.1),
///     Vec3::new(0.0, 1.0, 0.1),
///     Vec3::new(-1.0, 0.5, 0.0),
///     Vec3::new(1.0, 0.5, 0.0),
/// ];
/// let mut mesh = TriMesh::new(positions, vec![[0, 1, 2], [1, 0, 3]])?;
/// mesh.flat_pattern = Some(FlatPattern {
///     corners: vec![
///         [[0.0, 0.0], [0.0, 1.0], [-1.01, 0.5]],
///         [[0.0, 1.0], [0.0, 0.0], [1.0, 0.5]],
///     ],
/// });
/// mesh.validate()?;
/// assert!((mesh.area() - 1.005).abs() < 1e-12);
/// # Ok::<(), physics::mesh::MeshError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlatPattern {
    /// The corners of each triangle in the plane of the cloth (m), in the order of its vertices.
    pub corners: Vec<[[f64; 2]; 3]>,
}

/// Why corners are no flat pattern of a mesh. Triangles are counted from zero.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PatternError {
    /// The number of triangles of the pattern is not that of the mesh.
    #[error(
        "the flat pattern has {found} triangles, and the mesh has {triangles}; every triangle of the mesh needs a triangle \
         of the pattern"
    )]
    Count {
        /// The number of triangles of the pattern.
        found: usize,
        /// The number of triangles of the mesh.
        triangles: usize,
    },
    /// A coordinate is not a number, infinite or far too large.
    #[error(
        "triangle {triangle}: a coordinate of its flat pattern is {found:?} m; coordinates must be finite and within \
         ±{MAX_COORDINATE:e} m"
    )]
    Coordinate {
        /// The triangle.
        triangle: u32,
        /// The coordinate (m).
        found: f64,
    },
    /// A triangle has no area in the pattern, relative to its own size.
    #[error(
        "triangle {triangle} has no area in the flat pattern: its height is {found:.3e} of its longest edge; \
         at least {MIN_HEIGHT_RATIO:e} is needed"
    )]
    Flat {
        /// The triangle.
        triangle: u32,
        /// The ratio of its height to its longest edge.
        found: f64,
    },
    /// A triangle lies on its neighbour in the pattern.
    #[error(
        "triangle {triangle} is mirrored in the flat pattern and lies on triangle {neighbour}; unfold the pattern there, \
         or, if a seam joins the two triangles, move their panels apart in the pattern"
    )]
    Mirrored {
        /// The later triangle.
        triangle: u32,
        /// The earlier triangle.
        neighbour: u32,
    },
}

impl PatternError {
    /// The triangle at fault, if it is one.
    pub fn triangle(&self) -> Option<u32> {
        match *self {
            Self::Count { .. } => None,
            Self::Coordinate { triangle, .. }
            | Self::Flat { triangle, .. }
            | Self::Mirrored { triangle, .. } => Some(triangle),
        }
    }
}

/// Twice the signed area of a triangle (m²).
fn twice_area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

impl FlatPattern {
    /// Checks that this is a pattern of `triangles`. The edges of the mesh are those of `adjacency`.
    ///
    /// # Errors
    /// The first [`PatternError`] found.
    pub fn check(&self, triangles: &[[u32; 3]], adjacency: &Adjacency) -> Result<(), PatternError> {
        if self.corners.len() != triangles.len() {
            return Err(PatternError::Count {
                found: self.corners.len(),
                triangles: triangles.len(),
            });
        }
        for (triangle, corners) in (0_u32..).zip(&self.corners) {
            check_shape(triangle, *corners)?;
        }
        for edge in &adjacency.interior {
            let [first, second] = edge.triangles.map(|triangle| triangle as usize);
            // The corner of a triangle at a vertex. Both exist, because the edges are those of the triangles.
            let at = |triangle: usize, vertex: u32| {
                let found = triangles[triangle].iter().position(|&v| v == vertex);
                self.corners[triangle][found.unwrap_or_default()]
            };
            let [p, q] = edge.vertices;
            if at(first, p) != at(second, p) || at(first, q) != at(second, q) {
                continue;
            }
            let side = |triangle, vertex| {
                twice_area([at(triangle, p), at(triangle, q), at(triangle, vertex)])
            };
            let [own, other] = edge.opposite;
            if (side(first, own) > 0.0) == (side(second, other) > 0.0) {
                return Err(PatternError::Mirrored {
                    triangle: edge.triangles[1],
                    neighbour: edge.triangles[0],
                });
            }
        }
        Ok(())
    }

    /// The corners of a triangle as points of the plane z = 0 (m), or `None` if there is no such triangle.
    pub fn corners_of(&self, triangle: usize) -> Option<[Vec3; 3]> {
        let corners = self.corners.get(triangle)?;
        Some(corners.map(|[u, v]| Vec3::new(u, v, 0.0)))
    }
}

fn check_shape(triangle: u32, corners: [[f64; 2]; 3]) -> Result<(), PatternError> {
    let far = |c: &&f64| !(-MAX_COORDINATE..=MAX_COORDINATE).contains(*c);
    if let Some(&found) = corners.iter().flatten().find(far) {
        return Err(PatternError::Coordinate { triangle, found });
    }
    let [a, b, c] = corners;
    let length = |p: [f64; 2], q: [f64; 2]| libm::hypot(q[0] - p[0], q[1] - p[1]);
    let longest = length(a, b).max(length(b, c)).max(length(c, a));
    let height = twice_area(corners).abs() / longest;
    // The height of a point is no number, and so fails every comparison.
    if height > MIN_HEIGHT_RATIO * longest {
        return Ok(());
    }
    let found = if longest > 0.0 { height / longest } else { 0.0 };
    Err(PatternError::Flat { triangle, found })
}

impl TriMesh {
    /// Checks the flat pattern, if there is one.
    ///
    /// # Errors
    /// The first [`PatternError`] found.
    pub fn check_pattern(&self) -> Result<(), PatternError> {
        let Some(pattern) = &self.flat_pattern else {
            return Ok(());
        };
        // If more than two triangles meet at an edge, which no mesh of a file has, none of them counts as mirrored.
        let adjacency = Adjacency::new(&self.triangles).unwrap_or_default();
        pattern.check(&self.triangles, &adjacency)
    }

    /// The corners of a triangle at rest (m): those of the flat pattern, in the plane z = 0, or else its positions.
    /// `None` if there is no such triangle.
    pub fn rest_corners(&self, triangle: u32) -> Option<[Vec3; 3]> {
        match &self.flat_pattern {
            Some(pattern) => pattern.corners_of(triangle as usize),
            None => self.corners(triangle),
        }
    }
}
