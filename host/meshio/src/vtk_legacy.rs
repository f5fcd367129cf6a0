//! Reads meshes in VTK's legacy format, text or binary, from the bytes of a file.
//!
//! Source: "VTK File Formats" in the VTK documentation, section "Simple Legacy Formats", versions 2.0 to
//! 5.1. The reader supports the data sets `POLYDATA` and `UNSTRUCTURED_GRID`. The format has no units: coordinates
//! are taken as metres.
//!
//! Triangles become the triangles of a sheet, and tetrahedra (linear or quadratic) the cells of a solid, if the caller asks
//! for one. If lines are the cells of highest dimension, they become the lines of a thread. Points, lines in a file with other
//! cells, and triangles in the file of a solid are skipped. Any other cell is an error, because a mesh without it would have
//! holes. An entry of `CELL_DATA` with one component, in `SCALARS` or in a `FIELD`, becomes a field if its values are finite
//! numbers. Other attributes and `POINT_DATA` are skipped. The file makes no groups.

mod attributes;
mod cursor;

use crate::error::{FilePosition, MeshFileError};
use crate::lines::Fields;
use crate::text::quoted;
use crate::vtk_array::{Array, Scalar};
use crate::vtk_cells::{Cells, POLYGON};
use crate::vtk_fields;
use attributes::CellArray;
use cursor::Cursor;
use physics::mesh::Mesh;

/// The part of a data set that has been read so far.
#[derive(Default)]
struct Sections<'a> {
    points: Option<Array<'a>>,
    cells: Option<Connectivity<'a>>,
    types: Option<Array<'a>>,
    /// The number of points and lines of a `POLYDATA` file, in addition to its polygons.
    others: usize,
    cell_data: Vec<CellArray<'a>>,
}

/// The section that names the points of each cell.
struct Connectivity<'a> {
    /// The position where the section begins.
    position: FilePosition,
    cells: usize,
    /// From version 5 on: the start of each cell, and the end of the last cell.
    offsets: Option<Array<'a>>,
    numbers: Array<'a>,
}

/// Reads a mesh from the bytes of a legacy VTK file: a solid if there is a tetrahedron in the file, a sheet if there is a
/// triangle, a thread if there are cells of two points (`VTK_LINE`). Coordinates are taken as metres. With a distance,
/// vertices within it are merged.
///
/// # Errors
/// The first [`MeshFileError`] found.
pub(crate) fn parse(bytes: &[u8], merge: Option<f64>) -> Result<Mesh, MeshFileError> {
    let mut cursor = Cursor::new(bytes);
    let version_5 = header(&mut cursor)?;
    let mut line = cursor.expect("DATASET")?;
    let is_grid = match (line.word("DATASET")?, line.word("a data set")?) {
        (word, _) if !word.eq_ignore_ascii_case("DATASET") => {
            return Err(line.unexpected("DATASET").into());
        }
        (_, kind) if kind.eq_ignore_ascii_case("POLYDATA") => false,
        (_, kind) if kind.eq_ignore_ascii_case("UNSTRUCTURED_GRID") => true,
        (_, kind) => {
            let expected = "DATASET POLYDATA or DATASET UNSTRUCTURED_GRID (make one of them first, as \
                            ParaView's filters Extract Surface and Tetrahedralize do)";
            let found = format!("DATASET {}", quoted(kind));
            return Err(MeshFileError::syntax(line.position(), expected, found));
        }
    };
    let sections = sections(&mut cursor, is_grid, version_5)?;
    let end = cursor.position();
    let missing = |section: &str| MeshFileError::syntax(end, section, "the end of the data set");
    let points = sections.points.ok_or_else(|| missing("POINTS"))?;
    let name = if is_grid { "CELLS" } else { "POLYGONS" };
    let connectivity = sections.cells.ok_or_else(|| missing(name))?;
    let cells = Cells::new(points, sections.others)?;
    let (mut mesh, count, kept) = if is_grid {
        let types = sections.types.ok_or_else(|| missing("CELL_TYPES"))?;
        if types.len() != connectivity.cells {
            let expected = format!("{} cells, as CELL_TYPES has", types.len());
            return Err(MeshFileError::syntax(
                connectivity.position,
                expected,
                connectivity.cells.to_string(),
            ));
        }
        mesh(cells, &connectivity, types.integers(), merge)?
    } else {
        let types = std::iter::repeat_n(Ok(POLYGON), connectivity.cells);
        mesh(cells, &connectivity, types, merge)?
    };
    for CellArray {
        position,
        name,
        array,
    } in &sections.cell_data
    {
        vtk_fields::add(&mut mesh, (count, &kept), (*position, name), array)?;
    }
    Ok(mesh)
}

/// Reads the three lines before the data set. Returns whether cells have the layout of version 5.
fn header(cursor: &mut Cursor) -> Result<bool, MeshFileError> {
    const START: &str = "# vtk DataFile Version 2.0 to 5.1";
    let line = cursor.expect(START)?;
    let version = line
        .rest()
        .strip_prefix("# vtk DataFile Version ")
        .and_then(|version| version.trim().parse::<f64>().ok())
        .filter(|version| (1.0..6.0).contains(version))
        .ok_or_else(|| line.unexpected(START))?;
    cursor.skip_line(); // the title
    let line = cursor.expect("ASCII or BINARY")?;
    match line.rest() {
        word if word.eq_ignore_ascii_case("ASCII") => {}
        word if word.eq_ignore_ascii_case("BINARY") => cursor.binary = true,
        _ => return Err(line.unexpected("ASCII or BINARY").into()),
    }
    Ok(version >= 5.0)
}

fn sections<'a>(
    cursor: &mut Cursor<'a>,
    is_grid: bool,
    version_5: bool,
) -> Result<Sections<'a>, MeshFileError> {
    let mut found = Sections::default();
    while let Some(mut line) = cursor.next()? {
        let whole = line;
        let keyword = line.word("a section")?.to_ascii_uppercase();
        let again = || whole.unexpected(&format!("{keyword} once")).into();
        match (keyword.as_str(), is_grid) {
            ("POINTS", _) => {
                let count = line.count("a number of points")?;
                let scalar = scalar(&mut line)?;
                let points = cursor.array(&line, count.checked_mul(3), scalar)?;
                if found.points.replace(points).is_some() {
                    return Err(again());
                }
            }
            ("CELLS", true) | ("POLYGONS", false) => {
                let cells = connectivity(cursor, line, version_5)?;
                if found.cells.replace(cells).is_some() {
                    return Err(again());
                }
            }
            ("CELL_TYPES", true) => {
                let count = line.count("a number of cells")?;
                let types = cursor.array(&line, Some(count), Scalar::I32)?;
                if found.types.replace(types).is_some() {
                    return Err(again());
                }
            }
            ("VERTICES" | "LINES", false) => {
                let others = connectivity(cursor, line, version_5)?.cells;
                found.others = found.others.saturating_add(others);
            }
            ("FIELD", _) => drop(attributes::field(cursor, line, |_| false)?),
            ("METADATA", _) => cursor.skip_paragraph(),
            // Only attributes follow.
            ("POINT_DATA" | "CELL_DATA", _) => {
                found.cell_data = attributes::read(cursor, whole)?;
            }
            ("TRIANGLE_STRIPS", false) => {
                let expected = "POLYGONS (cut strips to triangles first, as ParaView's filter \
                                Triangulate does)";
                return Err(whole.unexpected(expected).into());
            }
            (_, true) => return Err(whole.unexpected("POINTS, CELLS or CELL_TYPES").into()),
            (_, false) => {
                return Err(whole
                    .unexpected("POINTS, POLYGONS, LINES or VERTICES")
                    .into());
            }
        }
    }
    Ok(found)
}

/// Reads a section that names the points of each cell, after its keyword.
fn connectivity<'a>(
    cursor: &mut Cursor<'a>,
    mut line: Fields<'a>,
    version_5: bool,
) -> Result<Connectivity<'a>, MeshFileError> {
    let position = line.position();
    let first = line.count("two counts")?;
    let second = line.count("two counts")?;
    if !version_5 {
        return Ok(Connectivity {
            position,
            cells: first,
            offsets: None,
            numbers: cursor.array(&line, Some(second), Scalar::I32)?,
        });
    }
    let mut named = |name: &str, count| {
        let mut line = cursor.expect(name)?;
        let whole = line;
        if !line.word(name)?.eq_ignore_ascii_case(name) {
            return Err(whole.unexpected(name).into());
        }
        let scalar = scalar(&mut line)?;
        cursor.array(&line, Some(count), scalar)
    };
    let offsets = named("OFFSETS", first)?;
    let numbers = named("CONNECTIVITY", second)?;
    Ok(Connectivity {
        position,
        cells: first.saturating_sub(1),
        offsets: Some(offsets),
        numbers,
    })
}

/// The type of an array's items.
#[derive(Clone, Copy)]
enum Items {
    Numbers(Scalar),
    /// Bits, which no mesh needs.
    Bits,
    /// Texts, which no mesh needs. If `by_line` is set, each takes a line of a binary file, too.
    Texts {
        by_line: bool,
    },
}

/// The next word as a type of numbers.
fn scalar(line: &mut Fields) -> Result<Scalar, MeshFileError> {
    let before = *line;
    match items(line)? {
        Items::Numbers(scalar) => Ok(scalar),
        Items::Bits | Items::Texts { .. } => Err(before.unexpected(NUMBERS).into()),
    }
}

const NUMBERS: &str = "a type of numbers, such as float or int";

/// The next word as a type of items.
fn items(line: &mut Fields) -> Result<Items, MeshFileError> {
    let before = *line;
    Ok(Items::Numbers(
        match line.word(NUMBERS)?.to_ascii_lowercase().as_str() {
            "char" | "signed_char" => Scalar::I8,
            "unsigned_char" => Scalar::U8,
            "short" => Scalar::I16,
            "unsigned_short" => Scalar::U16,
            "int" | "vtkidtype" => Scalar::I32,
            "unsigned_int" => Scalar::U32,
            "long" | "vtktypeint64" => Scalar::I64,
            "unsigned_long" | "vtktypeuint64" => Scalar::U64,
            "float" => Scalar::F32,
            "double" => Scalar::F64,
            "bit" => return Ok(Items::Bits),
            "string" | "utf8_string" => return Ok(Items::Texts { by_line: false }),
            "variant" => return Ok(Items::Texts { by_line: true }),
            _ => return Err(before.unexpected(NUMBERS).into()),
        },
    ))
}

/// The mesh of cells of these types, the number of cells in the file, and the number of each of the mesh's cells among
/// them.
fn mesh(
    mut cells: Cells,
    connectivity: &Connectivity,
    types: impl Iterator<Item = Result<i64, MeshFileError>>,
    merge: Option<f64>,
) -> Result<(Mesh, usize, Vec<u32>), MeshFileError> {
    let numbers = &connectivity.numbers;
    if let Some(offsets) = &connectivity.offsets {
        let mut ends = offsets.integers();
        if let Some(first) = ends.next().transpose()?
            && first != 0
        {
            let found = first.to_string();
            return Err(MeshFileError::syntax(
                offsets.position(0),
                "a first offset of 0",
                found,
            ));
        }
        cells.add(types, ends, |cell| offsets.position(cell + 1), numbers)?;
    } else {
        cells.add_counted(types, numbers)?;
    }
    cells.finish(numbers, merge)
}
