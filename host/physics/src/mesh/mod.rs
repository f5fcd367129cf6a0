//! Meshes of lines ([`LineMesh`]), of triangles ([`TriMesh`]) and of tetrahedra ([`TetMesh`]): positions, cells, and
//! named groups of either.
//!
//! A mesh comes from a generator ([`generate`], [`generate_box`], [`generate_plate`], [`generate_thread`]) or from a
//! file, which the crate `meshio` reads. Every mesh of a file is built by
//! [`LineMesh::new`], [`TriMesh::new`] or [`TetMesh::new`], so the same checks hold for all meshes (see [`check`],
//! [`check_solid`], [`check_thread`]).

use crate::Vec3;

pub mod adjacency;
mod boundary;
pub mod check;
pub mod check_hanging;
mod check_named;
mod check_neighbours;
pub mod check_solid;
pub mod check_thread;
mod elevate;
pub mod flat_pattern;
pub mod generate;
pub mod generate_box;
pub mod generate_plate;
pub mod generate_thread;
pub mod line;
pub mod quality;
pub mod tet;

pub use adjacency::Adjacency;
pub use check::MeshError;
pub use check_solid::SolidError;
pub use check_thread::ThreadError;
pub use flat_pattern::{FlatPattern, PatternError};
pub use line::LineMesh;
pub use tet::{Cells, TetMesh};

/// A mesh of any kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Mesh {
    /// Lines only.
    Thread(LineMesh),
    /// Triangles only.
    Sheet(TriMesh),
    /// Tetrahedra.
    Solid(TetMesh),
}

/// A triangle mesh with named groups, as a generator or a file gives it.
///
/// [`TriMesh::new`] checks every index against the array that the index refers to. A mesh that was changed
/// through its public fields is checked again by [`TriMesh::validate`].
///
/// ```
/// use physics::Vec3;
/// use physics::mesh::{MeshError, TriMesh};
///
/// let positions = vec![
///     Vec3::new(0.0, 0.0, 0.0),
///     Vec3::new(0.2, 0.0, 0.0),
///     Vec3::new(0.2, 0.1, 0.0),
///     Vec3::new(0.0, 0.1, 0.0),
/// ];
/// let mesh = TriMesh::new(positions.clone(), vec![[0, 1, 2], [0, 2, 3]])?;
/// assert!((mesh.area() - 0.02).abs() < 1e-15);
///
/// let error = TriMesh::new(positions, vec![[0, 1, 2], [0, 2, 4]]).unwrap_err();
/// assert!(matches!(error, MeshError::Index { triangle: 1, found: 4, vertices: 4 }));
/// # Ok::<(), MeshError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Positions at the start (m), one per vertex. Without a flat pattern they are the shape at rest.
    pub positions: Vec<Vec3>,
    /// Vertex indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// The flat shapes of the triangles at rest, if they are not those of the positions.
    pub flat_pattern: Option<FlatPattern>,
    /// Named sets of vertices, in the order in which they were defined.
    pub vertex_groups: Vec<Group>,
    /// Named sets of triangles, in the order in which they were defined.
    pub triangle_groups: Vec<Group>,
    /// Named values, one per triangle.
    pub triangle_fields: Vec<Field>,
}

/// A named set of vertices, lines, triangles or cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// The name by which a scene refers to the set.
    pub name: String,
    /// Indices, ascending, each once.
    pub members: Vec<u32>,
}

/// Named values, one per line, triangle or cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// The name by which a scene refers to the values.
    pub name: String,
    /// The values, finite, in the unit that the name implies.
    pub values: Vec<f64>,
}

/// An axis-aligned box that contains a mesh (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The corner with the smallest coordinates (m).
    pub min: Vec3,
    /// The corner with the largest coordinates (m).
    pub max: Vec3,
}

impl Bounds {
    /// The smallest box that contains all `positions` (m), or `None` if there are none.
    pub fn of(positions: &[Vec3]) -> Option<Self> {
        let first = *positions.first()?;
        let whole = Self {
            min: first,
            max: first,
        };
        Some(positions.iter().fold(whole, |b, p| Self {
            min: b.min.inf(p),
            max: b.max.sup(p),
        }))
    }

    /// The edge lengths of the box (m).
    pub fn size(&self) -> Vec3 {
        self.max - self.min
    }
}

impl Mesh {
    /// The rest positions (m), one per vertex.
    pub fn positions(&self) -> &[Vec3] {
        match self {
            Self::Thread(mesh) => &mesh.positions,
            Self::Sheet(mesh) => &mesh.positions,
            Self::Solid(mesh) => &mesh.positions,
        }
    }

    /// The rest positions (m), one per vertex, to be changed.
    pub fn positions_mut(&mut self) -> &mut [Vec3] {
        match self {
            Self::Thread(mesh) => &mut mesh.positions,
            Self::Sheet(mesh) => &mut mesh.positions,
            Self::Solid(mesh) => &mut mesh.positions,
        }
    }

    /// Number of lines, triangles or cells.
    pub fn element_count(&self) -> usize {
        match self {
            Self::Thread(mesh) => mesh.lines.len(),
            Self::Sheet(mesh) => mesh.triangles.len(),
            Self::Solid(mesh) => mesh.cells.len(),
        }
    }

    /// The named sets of vertices.
    pub fn vertex_groups(&self) -> &[Group] {
        match self {
            Self::Thread(mesh) => &mesh.vertex_groups,
            Self::Sheet(mesh) => &mesh.vertex_groups,
            Self::Solid(mesh) => &mesh.vertex_groups,
        }
    }

    /// The named values per line, triangle or cell.
    pub fn fields(&self) -> &[Field] {
        match self {
            Self::Thread(mesh) => &mesh.line_fields,
            Self::Sheet(mesh) => &mesh.triangle_fields,
            Self::Solid(mesh) => &mesh.cell_fields,
        }
    }

    /// The named values per line, triangle or cell, to be changed.
    pub fn fields_mut(&mut self) -> &mut Vec<Field> {
        match self {
            Self::Thread(mesh) => &mut mesh.line_fields,
            Self::Sheet(mesh) => &mut mesh.triangle_fields,
            Self::Solid(mesh) => &mut mesh.cell_fields,
        }
    }
}

impl TriMesh {
    /// The group of vertices called `name`.
    ///
    /// A group of triangles that came from a file has a group of vertices of the same name.
    pub fn group(&self, name: &str) -> Option<&Group> {
        self.vertex_groups.iter().find(|group| group.name == name)
    }

    /// The positions of a triangle's vertices (m), or `None` if there is no such triangle.
    pub fn corners(&self, triangle: u32) -> Option<[Vec3; 3]> {
        let [a, b, c] = *self.triangles.get(triangle as usize)?;
        let at = |vertex: u32| self.positions.get(vertex as usize).copied();
        Some([at(a)?, at(b)?, at(c)?])
    }

    /// The rest area of one triangle (m²), or `None` if there is no such triangle.
    pub fn triangle_area(&self, triangle: u32) -> Option<f64> {
        let [a, b, c] = self.rest_corners(triangle)?;
        Some(0.5 * (b - a).cross(&(c - a)).norm())
    }

    /// The rest area of the whole mesh (m²).
    pub fn area(&self) -> f64 {
        (0_u32..)
            .map_while(|triangle| self.triangle_area(triangle))
            .sum()
    }

    /// The smallest axis-aligned box that contains the mesh at rest, or `None` for a mesh without vertices.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(&self.positions)
    }
}
