//! Meshes in VTK's legacy format, text or binary, from a file's bytes.
//!
//! Source: "VTK File Formats" in the VTK documentation, section "Simple Legacy Formats", versions 2.0 to
//! 5.1. Read are the data sets `POLYDATA` and `UNSTRUCTURED_GRID`. The format knows no units: coordinates
//! are taken as metres.
//!
//! Triangles become the mesh's triangles; points and lines are passed over; any other cell is an error,
//! for a mesh without it would have holes. So are what belongs to points and cells (`POINT_DATA`,
//! `CELL_DATA`, which end a file) and fields before them: passed over. The file makes no groups.

mod cursor;

use super::TriMesh;
use super::file::{MeshFileError, Place};
use super::vtk_array::{Array, Scalar};
use super::vtk_cells::{Cells, POLYGON};
use cursor::{Cursor, Line};

/// What a data set holds, as far as it was read.
#[derive(Default)]
struct Sections<'a> {
    points: Option<Array<'a>>,
    cells: Option<Connectivity<'a>>,
    types: Option<Array<'a>>,
}

/// Which points make which cell.
struct Connectivity<'a> {
    /// Where the section begins.
    place: Place,
    cells: usize,
    /// From version 5 on: where each cell starts, and where the last one ends.
    offsets: Option<Array<'a>>,
    numbers: Array<'a>,
}

/// Reads a mesh from the bytes of a legacy VTK file. Coordinates are taken as metres.
///
/// # Errors
/// The first [`MeshFileError`] found.
pub fn parse(bytes: &[u8]) -> Result<TriMesh, MeshFileError> {
    let mut cursor = Cursor::new(bytes);
    let version_5 = header(&mut cursor)?;
    let mut line = cursor.expect("DATASET")?;
    let is_grid = match (line.word("DATASET")?, line.word("a data set")?) {
        (word, _) if !word.eq_ignore_ascii_case("DATASET") => {
            return Err(line.unexpected("DATASET"));
        }
        (_, kind) if kind.eq_ignore_ascii_case("POLYDATA") => false,
        (_, kind) if kind.eq_ignore_ascii_case("UNSTRUCTURED_GRID") => true,
        _ => return Err(line.unexpected("DATASET POLYDATA or DATASET UNSTRUCTURED_GRID")),
    };
    let sections = sections(&mut cursor, is_grid, version_5)?;
    let end = cursor.place();
    let missing = |what: &str| MeshFileError::syntax(end, what, "the end of the data set");
    let points = sections.points.ok_or_else(|| missing("POINTS"))?;
    let name = if is_grid { "CELLS" } else { "POLYGONS" };
    let cells = sections.cells.ok_or_else(|| missing(name))?;
    if !is_grid {
        return mesh(points, &cells, |count| {
            std::iter::repeat_n(Ok(POLYGON), count)
        });
    }
    let types = sections.types.ok_or_else(|| missing("CELL_TYPES"))?;
    if types.len() != cells.cells {
        let expected = format!("{} cells, as CELL_TYPES has", types.len());
        return Err(MeshFileError::syntax(
            cells.place,
            expected,
            cells.cells.to_string(),
        ));
    }
    mesh(points, &cells, |_| types.integers())
}

/// Reads the three lines before the data set; says whether cells are laid out as from version 5 on.
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
        _ => return Err(line.unexpected("ASCII or BINARY")),
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
        let again = || whole.unexpected(&format!("{keyword} once"));
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
            ("VERTICES" | "LINES", false) => drop(connectivity(cursor, line, version_5)?),
            ("FIELD", _) => field(cursor, line)?,
            ("METADATA", _) => cursor.skip_paragraph(),
            ("POINT_DATA" | "CELL_DATA", _) => break,
            ("TRIANGLE_STRIPS", false) => {
                let expected = "POLYGONS (cut strips to triangles first, as ParaView's filter \
                                Triangulate does)";
                return Err(whole.unexpected(expected));
            }
            (_, true) => return Err(whole.unexpected("POINTS, CELLS or CELL_TYPES")),
            (_, false) => return Err(whole.unexpected("POINTS, POLYGONS, LINES or VERTICES")),
        }
    }
    Ok(found)
}

/// A section that says which points make which cell, after its keyword.
fn connectivity<'a>(
    cursor: &mut Cursor<'a>,
    mut line: Line<'a>,
    version_5: bool,
) -> Result<Connectivity<'a>, MeshFileError> {
    let place = line.place;
    let first = line.count("two counts")?;
    let second = line.count("two counts")?;
    if !version_5 {
        return Ok(Connectivity {
            place,
            cells: first,
            offsets: None,
            numbers: cursor.array(&line, Some(second), Scalar::I32)?,
        });
    }
    let mut named = |name: &str, count| {
        let mut line = cursor.expect(name)?;
        let whole = line;
        if !line.word(name)?.eq_ignore_ascii_case(name) {
            return Err(whole.unexpected(name));
        }
        let scalar = scalar(&mut line)?;
        cursor.array(&line, Some(count), scalar)
    };
    let offsets = named("OFFSETS", first)?;
    let numbers = named("CONNECTIVITY", second)?;
    Ok(Connectivity {
        place,
        cells: first.saturating_sub(1),
        offsets: Some(offsets),
        numbers,
    })
}

/// Passes over fields: arrays with a name, a number of components, one of tuples and a type.
fn field<'a>(cursor: &mut Cursor<'a>, mut line: Line<'a>) -> Result<(), MeshFileError> {
    line.word("a field's name")?;
    for _ in 0..line.count("a number of arrays")? {
        let mut line = cursor.expect("an array of the field")?;
        if line.rest().eq_ignore_ascii_case("METADATA") {
            cursor.skip_paragraph();
            line = cursor.expect("an array of the field")?;
        }
        line.word("an array's name")?;
        let components = line.count("a number of components")?;
        let tuples = line.count("a number of tuples")?;
        let scalar = scalar(&mut line)?;
        cursor.array(&line, components.checked_mul(tuples), scalar)?;
    }
    Ok(())
}

/// The next word as a type of numbers.
fn scalar(line: &mut Line) -> Result<Scalar, MeshFileError> {
    const EXPECTED: &str = "a type of numbers, such as float or int";
    let before = *line;
    Ok(match line.word(EXPECTED)?.to_ascii_lowercase().as_str() {
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
        _ => return Err(before.unexpected(EXPECTED)),
    })
}

/// The mesh of some cells whose types `types` gives for a number of cells.
fn mesh<T: Iterator<Item = Result<i64, MeshFileError>>>(
    points: Array,
    connectivity: &Connectivity,
    types: impl Fn(usize) -> T,
) -> Result<TriMesh, MeshFileError> {
    let mut cells = Cells::new(points)?;
    let numbers = &connectivity.numbers;
    let types = types(connectivity.cells);
    if let Some(offsets) = &connectivity.offsets {
        let mut ends = offsets.integers();
        if let Some(first) = ends.next().transpose()?
            && first != 0
        {
            let found = first.to_string();
            return Err(MeshFileError::syntax(
                offsets.place(0),
                "a first offset of 0",
                found,
            ));
        }
        cells.add(types, ends, |cell| offsets.place(cell + 1), numbers)?;
    } else {
        cells.add_counted(types, numbers)?;
    }
    cells.finish(numbers)
}
