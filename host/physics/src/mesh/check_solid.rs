//! The checks of a tetrahedral mesh, made before any computation uses the mesh.
//!
//! They correspond to the checks of a sheet (see [`check`](super::check)). A mesh that fails a check would make
//! the physics divide by zero, read out of bounds, give a vertex no stiffness or take one body for two.

use super::check::{Location, MIN_EDGE_RATIO, check_coordinates, check_counts, unused};
use super::check_named::{check_fields, check_groups};
use super::check_neighbours::{check_faces, check_midsides};
use super::{Cells, MeshError, TetMesh};
use crate::{Mat3, Vec3};
use thiserror::Error;

/// The ratio of six times a cell's volume (the determinant of its Jacobian) to the cube of its longest edge. A
/// cell at or below this ratio counts as flat. (A regular tetrahedron has 0.71.)
pub const MIN_VOLUME_RATIO: f64 = 1e-9;

/// Why arrays of positions, tetrahedra, groups and fields are no valid mesh.
///
/// Vertices and cells are named by their index, from zero.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SolidError {
    /// An error that sheets have, too: in coordinates, coincident vertices, groups or fields.
    #[error(transparent)]
    Common(#[from] MeshError),
    /// There is no cell.
    #[error("the mesh has no tetrahedra; at least one is needed")]
    Empty,
    /// A cell names a vertex that does not exist.
    #[error(
        "cell {cell}: vertex {found} does not exist; the mesh has {vertices} vertices, counted from 0"
    )]
    Index {
        /// The cell.
        cell: u32,
        /// The vertex that it names.
        found: u32,
        /// The number of vertices of the mesh.
        vertices: usize,
    },
    /// A cell names a vertex more than once.
    #[error("cell {cell}: vertex {vertex} is named twice; all vertices of a cell must differ")]
    RepeatedVertex {
        /// The cell.
        cell: u32,
        /// The vertex that it names more than once.
        vertex: u32,
    },
    /// A cell has no volume, relative to its own size.
    #[error(
        "cell {cell} is flat: six times its volume is {found:.3e} of its longest edge cubed; \
         more than {MIN_VOLUME_RATIO:e} is needed"
    )]
    Flat {
        /// The cell.
        cell: u32,
        /// The ratio of six times its volume to the cube of its longest edge.
        found: f64,
    },
    /// A cell's corners are in the wrong order. (The readers of mesh files correct the order.)
    #[error(
        "cell {cell}: its volume is {found:.3e} m^3 and must be positive; exchange two corners, and the \
         midsides with these corners"
    )]
    Inverted {
        /// The cell.
        cell: u32,
        /// Its volume (m³).
        found: f64,
    },
    /// A cell is too small for the coordinates of the mesh to resolve it.
    #[error(
        "cell {cell}: its longest edge is {found:.3e} m; \
         in a mesh of this extent at least {least:.3e} m is needed"
    )]
    Tiny {
        /// The cell.
        cell: u32,
        /// Its longest edge (m).
        found: f64,
        /// The smallest length that is allowed (m).
        least: f64,
    },
    /// A cell folds because its midside vertices are far from the middles of its edges or in the wrong order.
    #[error(
        "cell {cell}: its midsides fold the cell; the least determinant of its Jacobian is {found:.3e} of the value \
         for straight edges; are the midsides in VTK's order?"
    )]
    Folded {
        /// The cell.
        cell: u32,
        /// The ratio of the least determinant at a quadrature point to that of the cell with straight edges.
        found: f64,
    },
    /// Two cells lie on the same side of a face, or have the same corners.
    #[error(
        "cell {cell} overlaps cell {first}: both cells lie on one side of the face {0}-{1}-{2}",
        face[0], face[1], face[2]
    )]
    Overlap {
        /// The later cell.
        cell: u32,
        /// The earlier cell.
        first: u32,
        /// The face's vertices, ascending.
        face: [u32; 3],
    },
    /// Two cells have different vertices at the middle of the edge between them.
    #[error(
        "cell {cell}: the edge {0}-{1} has its middle at vertex {2}, but at vertex {3} in cell {first}, so the \
         mesh is not connected there",
        ends[0], ends[1], middles[1], middles[0]
    )]
    TwoMiddles {
        /// The later cell.
        cell: u32,
        /// The earlier cell.
        first: u32,
        /// The edge's vertices, ascending.
        ends: [u32; 2],
        /// The middle in the earlier cell and the middle in the later cell.
        middles: [u32; 2],
    },
    /// A vertex is the middle of two edges.
    #[error(
        "cell {cell}: vertex {vertex} is the middle of the edge {0}-{1}, and of another edge in cell {first}",
        ends[0], ends[1]
    )]
    SharedMiddle {
        /// The later cell.
        cell: u32,
        /// The earlier cell.
        first: u32,
        /// The vertex.
        vertex: u32,
        /// The edge in the later cell, its vertices ascending.
        ends: [u32; 2],
    },
    /// A vertex is both the middle of an edge and a corner of a cell.
    #[error(
        "cell {cell}: vertex {vertex} is the middle of an edge, but a corner of cell {corner_of}"
    )]
    MiddleIsCorner {
        /// The cell in which the vertex is a middle.
        cell: u32,
        /// The vertex.
        vertex: u32,
        /// A cell in which the vertex is a corner.
        corner_of: u32,
    },
    /// A vertex belongs to no cell.
    #[error("vertex {vertex} belongs to no cell; remove this vertex")]
    Unused {
        /// The vertex.
        vertex: u32,
    },
}

impl SolidError {
    /// The part of the mesh that is at fault. Of several cells or vertices it is the last.
    pub fn location(&self) -> Location {
        match *self {
            Self::Common(ref error) => error.location(),
            Self::Unused { vertex } => Location::Vertex(vertex),
            Self::Index { cell, .. }
            | Self::RepeatedVertex { cell, .. }
            | Self::Flat { cell, .. }
            | Self::Inverted { cell, .. }
            | Self::Tiny { cell, .. }
            | Self::Folded { cell, .. }
            | Self::Overlap { cell, .. }
            | Self::TwoMiddles { cell, .. }
            | Self::SharedMiddle { cell, .. }
            | Self::MiddleIsCorner { cell, .. } => Location::Cell(cell),
            Self::Empty => Location::Mesh,
        }
    }
}

impl TetMesh {
    /// A mesh without groups and fields from rest positions (m) and cells.
    ///
    /// # Errors
    /// The first [`SolidError`] found.
    pub fn new(positions: Vec<Vec3>, cells: Cells) -> Result<Self, SolidError> {
        let mesh = Self {
            positions,
            cells,
            vertex_groups: Vec::new(),
            cell_groups: Vec::new(),
            cell_fields: Vec::new(),
        };
        mesh.validate()?;
        Ok(mesh)
    }

    /// Checks the whole mesh, groups and fields included.
    ///
    /// [`TetMesh::new`] calls this function. Call it again after a change of the public fields.
    ///
    /// # Errors
    /// The first [`SolidError`] found.
    pub fn validate(&self) -> Result<(), SolidError> {
        let vertices = self.positions.len();
        check_counts(vertices, ("cells", self.cells.len()))?;
        if self.cells.is_empty() {
            return Err(SolidError::Empty);
        }
        check_coordinates(&self.positions)?;
        check_indices(self)?;
        check_shapes(self)?;
        check_faces(&self.cells)?;
        if let Cells::Quadratic(cells) = &self.cells {
            check_midsides(cells, vertices)?;
        }
        if let Some(vertex) = unused(vertices, self.cells.vertices().flatten()) {
            return Err(SolidError::Unused { vertex });
        }
        check_groups(&self.vertex_groups, vertices)?;
        check_groups(&self.cell_groups, self.cells.len())?;
        Ok(check_fields(&self.cell_fields, self.cells.len())?)
    }
}

fn check_indices(mesh: &TetMesh) -> Result<(), SolidError> {
    let vertices = mesh.positions.len();
    for (cell, all) in (0_u32..).zip(mesh.cells.vertices()) {
        for (k, &vertex) in all.iter().enumerate() {
            if vertex as usize >= vertices {
                return Err(SolidError::Index {
                    cell,
                    found: vertex,
                    vertices,
                });
            }
            if all.iter().take(k).any(|&other| other == vertex) {
                return Err(SolidError::RepeatedVertex { cell, vertex });
            }
        }
    }
    Ok(())
}

/// Six times the signed volume of a cell with straight edges (m³), and its longest edge (m).
///
/// The corners are the first four vertices of `cell`.
///
/// # Panics
/// If `cell` has fewer than four vertices, or a corner is not among `positions`.
pub fn size(positions: &[Vec3], cell: &[u32]) -> (f64, f64) {
    let at = |k: usize| positions[cell[k] as usize];
    let edges = Mat3::from_columns(&[at(1) - at(0), at(2) - at(0), at(3) - at(0)]);
    let longest = (0..4)
        .flat_map(|a| (0..a).map(move |b| (a, b)))
        .map(|(a, b)| (at(a) - at(b)).norm())
        .fold(0.0, f64::max);
    (edges.determinant(), longest)
}

fn check_shapes(mesh: &TetMesh) -> Result<(), SolidError> {
    let diagonal = mesh.bounds().map_or(0.0, |bounds| bounds.size().norm());
    let least = MIN_EDGE_RATIO * diagonal;
    for (cell, all) in (0_u32..).zip(mesh.cells.vertices()) {
        let (volume, longest) = size(&mesh.positions, all);
        let smallest = MIN_VOLUME_RATIO * longest.powi(3);
        if volume.abs() <= smallest {
            let found = if longest > 0.0 {
                volume.abs() / longest.powi(3)
            } else {
                0.0
            };
            return Err(SolidError::Flat { cell, found });
        }
        if volume < 0.0 {
            let found = volume / 6.0;
            return Err(SolidError::Inverted { cell, found });
        }
        if longest < least {
            return Err(SolidError::Tiny {
                cell,
                found: longest,
                least,
            });
        }
        if all.len() == 10 {
            let determinant = least_determinant(&mesh.positions, all);
            if determinant <= smallest {
                let found = determinant / volume;
                return Err(SolidError::Folded { cell, found });
            }
        }
    }
    Ok(())
}

/// The least determinant of a quadratic cell's Jacobian at the four quadrature points of the physics.
///
/// The Jacobian is linear in the barycentric coordinates, so its values at the corners determine it. At corner
/// `a`, the derivative along the edge to `b` with the middle `m` is `4 m - 3 a - b`.
fn least_determinant(positions: &[Vec3], cell: &[u32]) -> f64 {
    // The points of the quadrature rule of degree two: three barycentric coordinates are (5 - sqrt 5) / 20, and
    // the fourth completes the sum of one.
    const NEAR: f64 = 0.138_196_601_125_010_5;
    const MIDDLE: [[usize; 4]; 4] = [[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3]];
    let at = |k: usize| positions[cell[k] as usize];
    let corners: [Mat3; 4] = core::array::from_fn(|a| {
        let along = |b: usize| {
            if a == b {
                return Vec3::zeros();
            }
            // Differences from the corner lose no digits far from the origin.
            (at(MIDDLE[a][b]) - at(a)) * 4.0 - (at(b) - at(a))
        };
        Mat3::from_columns(&[1, 2, 3].map(|b| along(b) - along(0)))
    });
    let sum: Mat3 = corners.iter().sum();
    let determinants =
        corners.map(|corner| (sum * NEAR + corner * (1.0 - 4.0 * NEAR)).determinant());
    determinants.into_iter().fold(f64::INFINITY, f64::min)
}
