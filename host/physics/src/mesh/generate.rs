//! Rectangular sheets, cut into triangles.

use super::{Group, MeshError, TriMesh};
use crate::Vec3;
use thiserror::Error;

/// The largest number of vertices that a generator makes. A larger number would take gigabytes of memory and is
/// probably a typing error.
pub const MAX_VERTICES: u64 = 5_000_000;

/// How the rectangles of a sheet are cut into triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pattern {
    /// The diagonals change direction from cell to cell. The sheet is equally stiff along both diagonals.
    #[default]
    Alternating,
    /// All diagonals run from the lower left to the upper right. The sheet is stiffer along one diagonal than
    /// along the other.
    Regular,
}

/// Why a sheet cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SheetError {
    /// A size is zero, negative or not a number.
    #[error("sheet: its {dimension} is {found:?} m, and must be positive and finite")]
    Size {
        /// "length" or "width".
        dimension: &'static str,
        /// The size (m).
        found: f64,
    },
    /// There are no cells along one side.
    #[error("sheet: it has 0 cells along its {along}; at least one is needed")]
    NoCells {
        /// "length" or "width".
        along: &'static str,
    },
    /// There would be too many vertices.
    #[error(
        "sheet: {nx} x {ny} cells make {vertices} vertices; at most {MAX_VERTICES} are allowed"
    )]
    TooMany {
        /// Cells along the length.
        nx: u32,
        /// Cells along the width.
        ny: u32,
        /// The vertices that they would make.
        vertices: u64,
    },
    /// The result is no valid mesh: cells are far too narrow, or the sheet is far too large.
    #[error("sheet: {0}")]
    Mesh(#[from] MeshError),
}

/// A rectangular sheet in the xy-plane, centred at the origin, of `nx` times `ny` cells of two triangles each.
/// Its length (m) is along x, its width (m) along y.
///
/// Vertices are numbered along x first. Every triangle is wound counter-clockwise as seen from +z. The vertex
/// groups "left" and "right" contain the ends (x = ∓length/2), "bottom" and "top" the sides (y = ∓width/2). A
/// corner is in two groups.
///
/// # Errors
/// [`SheetError`] for sizes that are not positive, no cells, more than [`MAX_VERTICES`] vertices, or cells
/// so narrow that their triangles count as flat.
///
/// ```
/// use physics::mesh::generate::{Pattern, SheetError, sheet};
///
/// let mesh = sheet(0.3, 0.2, 6, 4, Pattern::Alternating)?;
/// assert_eq!(mesh.positions.len(), 7 * 5);
/// assert_eq!(mesh.triangles.len(), 2 * 6 * 4);
/// assert_eq!(mesh.group("left").map(|group| group.members.len()), Some(5));
/// assert!((mesh.area() - 0.06).abs() < 1e-15);
///
/// let error = sheet(0.3, 0.2, 0, 4, Pattern::Alternating).unwrap_err();
/// assert_eq!(error, SheetError::NoCells { along: "length" });
/// # Ok::<(), SheetError>(())
/// ```
pub fn sheet(
    length: f64,
    width: f64,
    nx: u32,
    ny: u32,
    pattern: Pattern,
) -> Result<TriMesh, SheetError> {
    for (dimension, found) in [("length", length), ("width", width)] {
        if !(found > 0.0 && found.is_finite()) {
            return Err(SheetError::Size { dimension, found });
        }
    }
    for (along, cells) in [("length", nx), ("width", ny)] {
        if cells == 0 {
            return Err(SheetError::NoCells { along });
        }
    }
    let vertices = (u64::from(nx) + 1).saturating_mul(u64::from(ny) + 1);
    if vertices > MAX_VERTICES {
        return Err(SheetError::TooMany { nx, ny, vertices });
    }

    let positions = (0..=ny)
        .flat_map(|j| (0..=nx).map(move |i| (i, j)))
        .map(|(i, j)| Vec3::new(length * across(i, nx), width * across(j, ny), 0.0))
        .collect();

    let vertex = |i: u32, j: u32| j * (nx + 1) + i;
    let triangles = (0..ny)
        .flat_map(|j| (0..nx).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b] = [vertex(i, j), vertex(i + 1, j)];
            let [d, c] = [vertex(i, j + 1), vertex(i + 1, j + 1)];
            let rising = pattern == Pattern::Regular || (i + j).is_multiple_of(2);
            if rising {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            }
        })
        .collect();

    let mut mesh = TriMesh::new(positions, triangles)?;
    let mut group = |name: &str, members: Vec<u32>| {
        mesh.vertex_groups.push(Group {
            name: name.to_owned(),
            members,
        });
    };
    group("left", (0..=ny).map(|j| vertex(0, j)).collect());
    group("right", (0..=ny).map(|j| vertex(nx, j)).collect());
    group("bottom", (0..=nx).map(|i| vertex(i, 0)).collect());
    group("top", (0..=nx).map(|i| vertex(i, ny)).collect());
    Ok(mesh)
}

/// Where grid line `i` of `n` cells lies, from -0.5 to 0.5: exact at the ends, and exactly antisymmetric,
/// so that a symmetric load on a sheet stays symmetric.
pub(super) fn across(i: u32, n: u32) -> f64 {
    (2.0 * f64::from(i) - f64::from(n)) / (2.0 * f64::from(n))
}
