//! `body.mesh`: where elements come from.

use crate::scene::check;
use serde::Deserialize;

/// `body.mesh`.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "MeshFields")]
pub struct Mesh {
    /// A generator or a file.
    pub source: MeshSource,
    /// Whether linear tetrahedra become quadratic ones, with straight edges.
    pub quadratic: bool,
}

/// Where elements come from.
#[derive(Clone, Debug)]
pub enum MeshSource {
    /// Triangles: a rectangle in the xy-plane, centred at the origin, its groups `left`, `right`, `bottom`,
    /// `top` the edges.
    Sheet {
        /// Extent in x (m).
        length: f64,
        /// Extent in y (m).
        width: f64,
        /// Cells in x and y, two triangles each.
        cells: [u32; 2],
    },
    /// Tetrahedra: a box centred at the origin, its groups the faces `left`, `right`
    /// (x), `front`, `back` (y), `bottom`, `top` (z).
    Box {
        /// Extents (m).
        size: [f64; 3],
        /// Cells along each axis, six tetrahedra each.
        cells: [u32; 3],
    },
    /// A mesh file, its path relative to the scene file (`.obj`, legacy `.vtk`, `.vtu`, `.vtp`, or Gmsh 4.1
    /// ASCII, `.msh`).
    File(String),
}

/// `mesh` as it is written: a table with one source.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshFields {
    #[serde(default, deserialize_with = "check::optional_table")]
    sheet: Option<SheetFields>,
    #[serde(default, rename = "box", deserialize_with = "check::optional_table")]
    in_box: Option<BoxFields>,
    #[serde(default)]
    file: Option<String>,
    #[serde(default, deserialize_with = "check::order")]
    order: usize,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SheetFields {
    #[serde(deserialize_with = "check::positive")]
    length: f64,
    #[serde(deserialize_with = "check::positive")]
    width: f64,
    #[serde(deserialize_with = "check::cells")]
    cells: [u32; 2],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxFields {
    #[serde(deserialize_with = "check::positive3")]
    size: [f64; 3],
    #[serde(deserialize_with = "check::cells3")]
    cells: [u32; 3],
}

impl TryFrom<MeshFields> for Mesh {
    type Error = &'static str;

    fn try_from(fields: MeshFields) -> Result<Self, Self::Error> {
        let source = match (fields.sheet, fields.in_box, fields.file) {
            (Some(sheet), None, None) => MeshSource::Sheet {
                length: sheet.length,
                width: sheet.width,
                cells: sheet.cells,
            },
            (None, Some(solid), None) => MeshSource::Box {
                size: solid.size,
                cells: solid.cells,
            },
            (None, None, Some(file)) => MeshSource::File(file),
            // Worded as serde words a wrong value.
            _ => {
                return Err(
                    "invalid mesh, expected a table with exactly one of `sheet`, `box` and `file`",
                );
            }
        };
        Ok(Self {
            source,
            quadratic: fields.order == 2,
        })
    }
}
