//! `body.mesh`: where elements come from.

use crate::scene::check;
use physics::mesh::generate_plate::{HoledPlate, Rays};
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
        /// How the cells are cut.
        pattern: PatternName,
    },
    /// Triangles: a rectangle in the xy-plane with a round hole in its middle, at the origin.
    Plate {
        /// The whole plate.
        plate: HoledPlate,
        /// Whether only the quarter with positive x and y is made.
        quarter: bool,
    },
    /// Tetrahedra: a box centred at the origin, its groups the faces `left`, `right`
    /// (x), `front`, `back` (y), `bottom`, `top` (z).
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
    /// A mesh file, its path relative to the scene file (`.obj`, legacy `.vtk`, `.vtu`, `.vtp`, or Gmsh 4.1
    /// ASCII, `.msh`).
    File(String),
}

/// `body.mesh.sheet.pattern`: how the cells of a sheet are cut in two.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PatternName {
    /// All alike, from the lower left to the upper right: bends as a thin plate does.
    #[default]
    Regular,
    /// In turn: equally stiff along both diagonals, but too soft against bending by half or more.
    Alternating,
}

/// `mesh` as it is written: a table with one source.
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
    /// Along a quarter of the hole, and from there to the border.
    #[serde(deserialize_with = "check::cells")]
    cells: [u32; 2],
    #[serde(default = "mild", deserialize_with = "check::positive")]
    growth: f64,
    #[serde(default)]
    quarter: bool,
}

/// Growth of cells in the usual model of a plate with a hole.
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
            ..
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
            quadratic: fields.order == 2,
        })
    }
}
