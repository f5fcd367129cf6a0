//! Reads meshes in VTK's XML formats for unstructured grids (`.vtu`) and polygons (`.vtp`) from the bytes of a file.
//!
//! Source: "VTK File Formats" in the VTK documentation, section "XML Formats". The reader supports arrays as text
//! (`ascii`), in base64 (`binary`) and appended (raw or in base64), uncompressed or compressed by zlib, in both byte
//! orders. The format has no units: coordinates are taken as metres.
//!
//! Triangles become the triangles of a sheet, and tetrahedra (linear or quadratic) the cells of a solid, if the caller asks
//! for one. If lines are the cells of highest dimension, they become the lines of a thread. Points, lines in a file with other
//! cells, and triangles in the file of a solid are skipped. Any other cell is an error, because a mesh without it would have
//! holes. A named array of `CellData` with one component becomes a field if its values are finite numbers. Other arrays,
//! `PointData` and `FieldData` are skipped. The file makes no groups.
//!
//! A file whose arrays unpack to much more than its own size is refused: see [`MAX_RATIO`].

mod data;
mod document;
mod tag;

use crate::error::{FilePosition, MeshFileError};
use crate::vtk_array::Array;
use crate::vtk_cells::{Cells, POLYGON};
use crate::vtk_fields;
use data::Unpacker;
use document::{Document, NamedArray, Piece, Role};
use physics::mesh::Mesh;

/// Largest ratio of the size of the unpacked arrays to the size of the file.
///
/// zlib compresses by a factor of up to a thousand. VTK's file of a regular grid is compressed by a factor of six,
/// although its coordinates and numbers repeat more than those of other meshes.
pub const MAX_RATIO: usize = 16;
/// Size to which compressed arrays may unpack in any case (bytes): a small file may consist mostly of repetitions.
pub const MIN_UNPACKED: usize = 64 << 10;
/// Largest size to which compressed arrays may unpack (bytes): that of a grid of three million vertices.
pub(crate) const MAX_UNPACKED: usize = 256 << 20;

/// Reads a mesh from the bytes of a VTU or VTP file: a solid if there is a tetrahedron in the file, a sheet if there is a
/// triangle, a thread if there are cells of two points (`VTK_LINE`). Coordinates are taken as metres. With a distance,
/// vertices within it are merged.
///
/// # Errors
/// The first [`MeshFileError`] found.
pub(crate) fn parse(bytes: &[u8], merge: Option<f64>) -> Result<Mesh, MeshFileError> {
    let document = document::read(bytes)?;
    let mut unpacker = Unpacker::new(bytes, &document.encoding);
    let piece = &document.piece;
    let at = FilePosition::Line(piece.line);
    if piece.strips > 0 {
        return Err(MeshFileError::syntax(
            at,
            "no strips of triangles (cut to triangles first, as ParaView's filter Triangulate does)",
            format!("{} strips", piece.strips),
        ));
    }

    let points = array(&document, &mut unpacker, Role::Points)?;
    count(piece, "coordinates", piece.points.checked_mul(3), &points)?;
    let numbers = array(&document, &mut unpacker, Role::Connectivity)?;
    let ends = array(&document, &mut unpacker, Role::Offsets)?;
    count(piece, "ends of cells", Some(piece.cells), &ends)?;
    let end_position = |cell| ends.position(cell);

    let mut cells = Cells::new(points, piece.others)?;
    if document.is_grid {
        let types = array(&document, &mut unpacker, Role::Types)?;
        count(piece, "types of cells", Some(piece.cells), &types)?;
        cells.add(types.integers(), ends.integers(), end_position, &numbers)?;
    } else {
        let types = std::iter::repeat_n(Ok(POLYGON), ends.len());
        cells.add(types, ends.integers(), end_position, &numbers)?;
    }
    let (mut mesh, count, kept) = cells.finish(&numbers, merge)?;
    for NamedArray { name, array } in &piece.cell_data {
        let position = FilePosition::Line(array.line);
        let array = unpacker.array(array)?;
        vtk_fields::add(&mut mesh, (count, &kept), (position, name), &array)?;
    }
    Ok(mesh)
}

/// The array of this role. A file without points or cells may omit the array.
fn array<'a>(
    document: &Document<'a>,
    unpacker: &mut Unpacker<'a>,
    role: Role,
) -> Result<Array<'a>, MeshFileError> {
    let piece = &document.piece;
    match piece.arrays.iter().find(|(of, _)| *of == role) {
        Some((_, array)) => unpacker.array(array),
        None if piece.points == 0 || piece.cells == 0 => Ok(Array::none(piece.line)),
        None => Err(MeshFileError::syntax(
            FilePosition::Line(piece.line),
            format!("a DataArray of {}", role.name()),
            "none in this Piece",
        )),
    }
}

/// Checks that an array has the number of items that the piece declares.
fn count(
    piece: &Piece,
    items: &str,
    claimed: Option<usize>,
    array: &Array,
) -> Result<(), MeshFileError> {
    if claimed == Some(array.len()) {
        return Ok(());
    }
    let claimed = claimed.map_or_else(|| "too many".to_owned(), |claimed| claimed.to_string());
    Err(MeshFileError::syntax(
        FilePosition::Line(piece.line),
        format!("{claimed} {items}, as this Piece says"),
        format!("{} in the DataArray", array.len()),
    ))
}
