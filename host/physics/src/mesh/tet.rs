//! Tetrahedral meshes: positions, linear or quadratic cells, named groups, and values per cell.
//!
//! The vertices of a cell have the order of VTK. The corners 0 to 3 of a linear tetrahedron are ordered so that
//! `(x1 - x0) x (x2 - x0) . (x3 - x0)` is positive. A quadratic tetrahedron has six more vertices, at the middles
//! of the edges 01, 12, 02, 03, 13 and 23. (Gmsh and Abaqus exchange some of these. The readers and writers
//! translate.)

use super::{Bounds, Field, Group};
use crate::Vec3;

/// The ends of the edges at whose middles the vertices 4 to 9 of a quadratic tetrahedron lie.
pub const MIDSIDE_ENDS: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];

/// The cells of a mesh, all of one kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cells {
    /// Tetrahedra with four vertices.
    Linear(Vec<[u32; 4]>),
    /// Tetrahedra with ten vertices, see [`MIDSIDE_ENDS`].
    Quadratic(Vec<[u32; 10]>),
}

impl Cells {
    /// Number of cells.
    pub fn len(&self) -> usize {
        match self {
            Self::Linear(cells) => cells.len(),
            Self::Quadratic(cells) => cells.len(),
        }
    }

    /// Whether there is no cell.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The vertices of each cell, corners first.
    pub fn vertices(&self) -> Box<dyn Iterator<Item = &[u32]> + '_> {
        match self {
            Self::Linear(cells) => Box::new(cells.iter().map(<[u32; 4]>::as_slice)),
            Self::Quadratic(cells) => Box::new(cells.iter().map(<[u32; 10]>::as_slice)),
        }
    }
}

/// A tetrahedral mesh with named groups, as a generator or a file gives it.
///
/// [`TetMesh::new`] checks the mesh. A mesh that was changed through its public fields is checked again by
/// [`TetMesh::validate`].
///
/// ```
/// use physics::Vec3;
/// use physics::mesh::{Cells, SolidError, TetMesh};
///
/// let positions = vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()];
/// let mesh = TetMesh::new(positions.clone(), Cells::Linear(vec![[0, 1, 2, 3]]))?;
/// let quadratic = mesh.quadratic();
/// assert_eq!(quadratic.positions.len(), 10);
/// quadratic.validate()?;
///
/// // Two corners exchanged make the volume negative.
/// let error = TetMesh::new(positions, Cells::Linear(vec![[0, 2, 1, 3]])).unwrap_err();
/// assert!(matches!(error, SolidError::Inverted { cell: 0, .. }));
/// # Ok::<(), SolidError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TetMesh {
    /// Rest positions (m), one per vertex.
    pub positions: Vec<Vec3>,
    /// The cells.
    pub cells: Cells,
    /// Named sets of vertices.
    pub vertex_groups: Vec<Group>,
    /// Named sets of cells.
    pub cell_groups: Vec<Group>,
    /// Named values, one per cell.
    pub cell_fields: Vec<Field>,
}

impl TetMesh {
    /// The group of vertices called `name`.
    pub fn group(&self, name: &str) -> Option<&Group> {
        self.vertex_groups.iter().find(|group| group.name == name)
    }

    /// The smallest axis-aligned box that contains the mesh at rest, or `None` for a mesh without vertices.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(&self.positions)
    }
}
