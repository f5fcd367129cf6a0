//! `body.mesh`: the source of a body's mesh.

use crate::check;
use physics::mesh::generate_plate::{HoledPlate, Rays};
use serde::Deserialize;

/// `body.mesh`: the mesh of a body.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "MeshFields")]
pub struct Mesh {
    /// A generator or a file.
    pub source: MeshSource,
    /// Files only: metres per unit of the file. Every coordinate is multiplied by this number.
    pub scale: Option<f64>,
    /// Files only: the distance within which doubled vertices are merged (m), after the scale.
    pub merge: Option<f64>,
    /// Whether linear tetrahedra become quadratic ones, with straight edges.
    pub quadratic: bool,
    /// The flat pattern out of which a sheet is cut, if it has one.
    pub flat_pattern: Option<FlatPattern>,
}

/// `body.mesh.flat_pattern`: the texture coordinates of an OBJ file are the flat rest shapes of its triangles.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlatPattern {
    /// The length of a unit of the texture coordinates (m).
    #[serde(deserialize_with = "check::positive")]
    pub texture_unit: f64,
}

/// The source of a mesh.
#[derive(Clone, Debug)]
pub enum MeshSource {
    /// Triangles: a rectangle in the xy-plane, centred at the origin. Its groups are its edges `left`, `right`,
    /// `bottom` and `top`.
    Sheet {
        /// Extent in x (m).
        length: f64,
        /// Extent in y (m).
        width: f64,
        /// Cells in x and y, two triangles each.
        cells: [u32; 2],
        /// The pattern by which cells are cut into triangles.
        pattern: PatternName,
    },
    /// Triangles: a rectangle in the xy-plane with a circular hole at its centre, the origin.
    Plate {
        /// The whole plate.
        plate: HoledPlate,
        /// Whether the mesh is only the quarter with positive x and y.
        quarter: bool,
    },
    /// Tetrahedra: a box centred at the origin. Its groups are its faces `left` and `right` (x), `front` and `back`
    /// (y), `bottom` and `top` (z).
    Box {
        /// Extents (m).
        size: [f64; 3],
        /// Cells along each axis, six tetrahedra each.
        cells: [u32; 3],
    },
    /// Lines: a straight thread along x, centred at the origin, its groups `left` and `right` the ends.
    Thread {
        /// Length (m).
        length: f64,
        /// Lines of equal length.
        segments: u32,
    },
    /// A mesh file, its path relative to the scene file (OBJ, STL, VTK legacy, VTK XML, or Gmsh 4.1 or
    /// 2.2).
    File(String),
}

/// `body.mesh.sheet.pattern`: the diagonals by which the cells of a sheet are cut into triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PatternName {
    /// All diagonals from the lower left to the upper right.
    #[default]
    Regular,
    /// Alternating diagonals. The sheet is equally stiff along both diagonals.
    Alternating,
}

/// `mesh` as the scene file has it: a table with one source.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshFields {
    #[serde(default, deserialize_with = "check::optional_table")]
    sheet: Option<SheetFields>,
    #[serde(default, rename = "box", deserialize_with = "check::optional_table")]
    in_box: Option<BoxFields>,
    #[serde(default, deserialize_with = "check::optional_table")]
    plate: Option<PlateFields>,
    #[serde(default, deserialize_with = "check::optional_table")]
    thread: Option<ThreadFields>,
    #[serde(default)]
    file: Option<String>,
    #[serde(default, deserialize_with = "check::optional_positive")]
    scale: Option<f64>,
    #[serde(default, deserialize_with = "check::optional_positive")]
    merge: Option<f64>,
    #[serde(default, deserialize_with = "check::order")]
    order: usize,
    #[serde(default, deserialize_with = "check::optional_table")]
    flat_pattern: Option<FlatPattern>,
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
    #[serde(default, deserialize_with = "check::word")]
    pattern: PatternName,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlateFields {
    #[serde(deserialize_with = "check::positive")]
    width: f64,
    #[serde(deserialize_with = "check::positive")]
    height: f64,
    #[serde(deserialize_with = "check::positive")]
    radius: f64,
    /// Number of cells along a quarter of the hole, and from the hole to the border.
    #[serde(deserialize_with = "check::cells")]
    cells: [u32; 2],
    #[serde(default = "mild", deserialize_with = "check::positive")]
    growth: f64,
    #[serde(default)]
    quarter: bool,
}

/// Ratio of the sizes of consecutive cells outwards, in the usual model of a plate with a hole.
fn mild() -> f64 {
    1.15
}

impl From<PlateFields> for MeshSource {
    fn from(fields: PlateFields) -> Self {
        let [around, outward] = fields.cells;
        Self::Plate {
            plate: HoledPlate {
                width: fields.width,
                height: fields.height,
                radius: fields.radius,
                around,
                outward,
                growth: fields.growth,
                rays: Rays::default(),
            },
            quarter: fields.quarter,
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxFields {
    #[serde(deserialize_with = "check::positive3")]
    size: [f64; 3],
    #[serde(deserialize_with = "check::cells3")]
    cells: [u32; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ThreadFields {
    #[serde(deserialize_with = "check::positive")]
    length: f64,
    #[serde(deserialize_with = "check::segments")]
    segments: u32,
}

impl TryFrom<MeshFields> for Mesh {
    type Error = &'static str;

    fn try_from(fields: MeshFields) -> Result<Self, Self::Error> {
        let MeshFields {
            sheet,
            in_box,
            plate,
            thread,
            file,
            scale,
            merge,
            order,
            flat_pattern,
        } = fields;
        let source = match (sheet, in_box, plate, thread, file) {
            (Some(sheet), None, None, None, None) => MeshSource::Sheet {
                length: sheet.length,
                width: sheet.width,
                cells: sheet.cells,
                pattern: sheet.pattern,
            },
            (None, Some(solid), None, None, None) => MeshSource::Box {
                size: solid.size,
                cells: solid.cells,
            },
            (None, None, Some(plate), None, None) => plate.into(),
            (None, None, None, Some(thread), None) => MeshSource::Thread {
                length: thread.length,
                segments: thread.segments,
            },
            (None, None, None, None, Some(file)) => MeshSource::File(file),
            // Worded as serde words a wrong value.
            _ => {
                return Err(
                    "invalid mesh, expected a table with exactly one of `sheet`, `box`, `plate`, `thread` and `file`",
                );
            }
        };
        Ok(Self {
            source,
            scale,
            merge,
            quadratic: order == 2,
            flat_pattern,
        })
    }
}
