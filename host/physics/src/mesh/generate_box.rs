//! Boxes, cut into tetrahedra.

use super::generate::MAX_VERTICES;
use super::{Cells, Group, TetMesh};
use crate::Vec3;
use thiserror::Error;

/// Why a box cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum BoxError {
    /// A size is zero, negative or not a number.
    #[error("box: its size along {axis} is {found:?} m, and must be positive and finite")]
    Size {
        /// "x", "y" or "z".
        axis: &'static str,
        /// The size (m).
        found: f64,
    },
    /// There are no cells along one axis.
    #[error("box: it has 0 cells along {axis}; at least one is needed")]
    NoCells {
        /// "x", "y" or "z".
        axis: &'static str,
    },
    /// There would be too many vertices.
    #[error("box: {cells:?} cells make {vertices} vertices; at most {MAX_VERTICES} are allowed")]
    TooMany {
        /// Cells along each axis.
        cells: [u32; 3],
        /// The vertices that they would make.
        vertices: u64,
    },
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// A box of `size` (m), centred at the origin, of `cells` grid cells along each axis. Each grid cell is cut into
/// six tetrahedra around the same diagonal (Kuhn's triangulation, which is conforming).
///
/// Vertices are numbered along x first, then y, then z. The vertex groups "left" and "right" contain the faces at
/// the two ends of x, "front" and "back" those of y, "bottom" and "top" those of z. A vertex on an edge of the
/// box is in two groups, a corner in three.
///
/// # Errors
/// [`BoxError`] for sizes that are not positive, no cells, or more than [`MAX_VERTICES`] vertices.
///
/// ```
/// use physics::mesh::generate_box::{BoxError, solid_box};
///
/// let mesh = solid_box([0.2, 0.1, 0.1], [4, 2, 2])?;
/// assert_eq!(mesh.positions.len(), 5 * 3 * 3);
/// assert_eq!(mesh.cells.len(), 6 * 4 * 2 * 2);
/// assert_eq!(mesh.group("left").map(|group| group.members.len()), Some(9));
///
/// let error = solid_box([0.2, 0.1, 0.1], [4, 0, 2]).unwrap_err();
/// assert_eq!(error, BoxError::NoCells { axis: "y" });
/// # Ok::<(), BoxError>(())
/// ```
pub fn solid_box(size: [f64; 3], cells: [u32; 3]) -> Result<TetMesh, BoxError> {
    for axis in 0..3 {
        if !(size[axis] > 0.0 && size[axis].is_finite()) {
            return Err(BoxError::Size {
                axis: AXES[axis],
                found: size[axis],
            });
        }
        if cells[axis] == 0 {
            return Err(BoxError::NoCells { axis: AXES[axis] });
        }
    }
    check_count(cells)?;
    // Exactly antisymmetric, so that a symmetric load stays symmetric.
    let across = |i: u32, n: u32| (2.0 * f64::from(i) - f64::from(n)) / (2.0 * f64::from(n));
    Ok(grid_box(cells, |axis, i| {
        size[axis] * across(i, cells[axis])
    }))
}

/// A box as [`solid_box`] makes it, with a grid plane at each of the `planes` (m) across each axis.
///
/// # Errors
/// [`BoxError`] for planes that do not ascend, fewer than two, or too many vertices.
pub fn graded_box(planes: [&[f64]; 3]) -> Result<TetMesh, BoxError> {
    for (axis, planes) in AXES.into_iter().zip(planes) {
        if planes.len() < 2 {
            return Err(BoxError::NoCells { axis });
        }
        let mut sizes = planes.windows(2).map(|pair| pair[1] - pair[0]);
        if let Some(found) = sizes.find(|size| !(*size > 0.0 && size.is_finite())) {
            return Err(BoxError::Size { axis, found });
        }
    }
    let cells = planes.map(|planes| u32::try_from(planes.len() - 1).unwrap_or(u32::MAX));
    check_count(cells)?;
    Ok(grid_box(cells, |axis, i| planes[axis][i as usize]))
}

fn check_count(cells: [u32; 3]) -> Result<(), BoxError> {
    let vertices = cells.iter().fold(1_u64, |product, &n| {
        product.saturating_mul(u64::from(n) + 1)
    });
    if vertices > MAX_VERTICES {
        return Err(BoxError::TooMany { cells, vertices });
    }
    Ok(())
}

/// A box of `cells`, with the grid planes `at_plane` (m) of an axis and a number.
fn grid_box(cells: [u32; 3], at_plane: impl Fn(usize, u32) -> f64) -> TetMesh {
    let [nx, ny, nz] = cells;
    let vertex = |at: [u32; 3]| (at[2] * (ny + 1) + at[1]) * (nx + 1) + at[0];
    let grid = |counts: [u32; 3]| {
        (0..counts[2]).flat_map(move |k| {
            (0..counts[1]).flat_map(move |j| (0..counts[0]).map(move |i| [i, j, k]))
        })
    };
    let positions: Vec<Vec3> = grid(cells.map(|n| n + 1))
        .map(|at| Vec3::from_fn(|axis, _| at_plane(axis, at[axis])))
        .collect();
    let tetrahedra = grid(cells)
        .flat_map(|at| kuhn(at).map(|cell| cell.map(vertex)))
        .collect();
    let faces = [
        ("left", 0, 0),
        ("right", 0, nx),
        ("front", 1, 0),
        ("back", 1, ny),
        ("bottom", 2, 0),
        ("top", 2, nz),
    ];
    let vertex_groups = faces
        .map(|(name, axis, at): (&str, usize, u32)| Group {
            name: name.to_owned(),
            members: grid(cells.map(|n| n + 1))
                .filter(|point| point[axis] == at)
                .map(vertex)
                .collect(),
        })
        .to_vec();
    TetMesh {
        positions,
        cells: Cells::Linear(tetrahedra),
        vertex_groups,
        cell_groups: Vec::new(),
        cell_fields: Vec::new(),
    }
}

/// The six tetrahedra of a grid cell. Each has the vertices of a path along three edges of the grid cell, from one
/// end of the diagonal to the other.
fn kuhn(at: [u32; 3]) -> [[[u32; 3]; 4]; 6] {
    // The last three paths have the opposite orientation. Two of their vertices are exchanged, so that all volumes
    // are positive.
    let paths = [
        [0, 1, 2],
        [1, 2, 0],
        [2, 0, 1],
        [1, 0, 2],
        [0, 2, 1],
        [2, 1, 0],
    ];
    core::array::from_fn(|number| {
        let mut corner = at;
        let mut cell = [at; 4];
        for (slot, axis) in paths[number].into_iter().enumerate() {
            corner[axis] += 1;
            cell[slot + 1] = corner;
        }
        if number >= 3 {
            cell.swap(1, 2);
        }
        cell
    })
}
