//! The attributes of points and cells in a legacy file, from `POINT_DATA` or `CELL_DATA` to the end of the file.
//!
//! All attributes are read, because the position of an attribute depends on the size of those before it. Only fields of
//! cells are kept.

use super::cursor::Cursor;
use super::{Items, items};
use crate::error::{FilePosition, MAX_FIELDS, MeshFileError};
use crate::lines::Fields;
use crate::vtk_array::{Array, Scalar};
use crate::vtk_fields::check_name;

/// One number for each cell.
pub(super) struct CellArray<'a> {
    pub(super) position: FilePosition,
    pub(super) name: String,
    pub(super) array: Array<'a>,
}

/// Reads all attributes, from their first line `line`. Returns those of cells with one component.
pub(super) fn read<'a>(
    cursor: &mut Cursor<'a>,
    line: Fields<'a>,
) -> Result<Vec<CellArray<'a>>, MeshFileError> {
    let mut found = Vec::new();
    let mut next = Some(line);
    let (mut of_cells, mut tuples) = (false, 0);
    while let Some(mut line) = next {
        let whole = line;
        let keyword = line.word("an attribute")?.to_ascii_uppercase();
        let begin = found.len();
        match keyword.as_str() {
            "POINT_DATA" | "CELL_DATA" => {
                of_cells = keyword == "CELL_DATA";
                tuples = line.count("a number of points or cells")?;
            }
            "METADATA" => cursor.skip_paragraph(),
            "SCALARS" => found.extend(scalars(cursor, line, tuples)?),
            "FIELD" => {
                let is_wanted = |components| of_cells && components == 1;
                found.extend(field(cursor, line, is_wanted)?);
            }
            _ => pass_over(cursor, whole, tuples)?,
        }
        if !of_cells {
            found.truncate(begin);
        }
        for new in begin..found.len() {
            let (before, rest) = found.split_at(new);
            if let Some(CellArray { position, name, .. }) = rest.first() {
                check_name(before.iter().map(|array| &array.name[..]), *position, name)?;
            }
        }
        next = cursor.next()?;
    }
    Ok(found)
}

/// Reads `SCALARS name type [components]`, then the name of a table of colours, then the numbers.
fn scalars<'a>(
    cursor: &mut Cursor<'a>,
    mut line: Fields<'a>,
    tuples: usize,
) -> Result<Option<CellArray<'a>>, MeshFileError> {
    let position = line.position();
    let name = decoded(line.word("a name")?);
    let items = items(&mut line)?;
    let components = if line.rest().is_empty() {
        1
    } else {
        line.count("a number of components")?
    };
    line.end()?;
    let mut table = cursor.expect("LOOKUP_TABLE and a name")?;
    let whole = table;
    if !table
        .word("LOOKUP_TABLE")?
        .eq_ignore_ascii_case("LOOKUP_TABLE")
    {
        return Err(whole.unexpected("LOOKUP_TABLE and a name").into());
    }
    table.word("the name of a table of colours")?;
    let count = components.checked_mul(tuples);
    let Items::Numbers(scalar) = items else {
        cursor.skip_items(&table, count, items)?;
        return Ok(None);
    };
    let array = cursor.array(&table, count, scalar)?;
    Ok((components == 1).then_some(CellArray {
        position,
        name,
        array,
    }))
}

/// Reads `FIELD name arrays`, then arrays with a name, a number of components, a number of tuples and a type. Returns
/// the arrays that are wanted according to their number of components.
pub(super) fn field<'a>(
    cursor: &mut Cursor<'a>,
    mut line: Fields<'a>,
    is_wanted: impl Fn(usize) -> bool,
) -> Result<Vec<CellArray<'a>>, MeshFileError> {
    let mut found = Vec::new();
    line.word("a field's name")?;
    for _ in 0..line.count("a number of arrays")? {
        let mut line = cursor.expect("an array of the field")?;
        if line.rest().eq_ignore_ascii_case("METADATA") {
            cursor.skip_paragraph();
            line = cursor.expect("an array of the field")?;
        }
        let (whole, position) = (line, line.position());
        let name = decoded(line.word("an array's name")?);
        let components = line.count("a number of components")?;
        let tuples = line.count("a number of tuples")?;
        let items = items(&mut line)?;
        let count = components.checked_mul(tuples);
        let Items::Numbers(scalar) = items else {
            cursor.skip_items(&line, count, items)?;
            continue;
        };
        let array = cursor.array(&line, count, scalar)?;
        if is_wanted(components) {
            if found.len() == MAX_FIELDS {
                return Err(whole
                    .unexpected(&format!("at most {MAX_FIELDS} arrays"))
                    .into());
            }
            found.push(CellArray {
                position,
                name,
                array,
            });
        }
    }
    Ok(found)
}

/// Reads any other attribute of `tuples` points or cells.
fn pass_over<'a>(
    cursor: &mut Cursor<'a>,
    mut line: Fields<'a>,
    tuples: usize,
) -> Result<(), MeshFileError> {
    let whole = line;
    let keyword = line.word("an attribute")?.to_ascii_uppercase();
    // The number of components, or 0 if the line gives this number.
    let known = match keyword.as_str() {
        "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => Some(1),
        "VECTORS" | "NORMALS" => Some(3),
        "TENSORS6" => Some(6),
        "TENSORS" => Some(9),
        "COLOR_SCALARS" | "LOOKUP_TABLE" | "TEXTURE_COORDINATES" => Some(0),
        _ => None,
    };
    let Some(components) = known else {
        let expected = "an attribute of points or cells, such as SCALARS, VECTORS or FIELD";
        return Err(whole.unexpected(expected).into());
    };
    line.word("a name")?;
    let components = match components {
        0 => line.count("a number of components or colours")?,
        _ => components,
    };
    // Colours are bytes; in a text file they are numbers from 0 to 1.
    let (count, items) = match keyword.as_str() {
        "LOOKUP_TABLE" => (components.checked_mul(4), Items::Numbers(Scalar::U8)),
        "COLOR_SCALARS" => (components.checked_mul(tuples), Items::Numbers(Scalar::U8)),
        _ => (components.checked_mul(tuples), items(&mut line)?),
    };
    cursor.skip_items(&line, count, items)
}

/// The name that VTK encoded, with blanks and other characters written as `%` and two digits (see
/// `vtkDataWriter::EncodeString`).
fn decoded(name: &str) -> String {
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name.as_bytes();
    while let [first, after @ ..] = rest {
        let digits = after.get(..2).and_then(|two| std::str::from_utf8(two).ok());
        let number = digits
            .filter(|two| two.bytes().all(|byte| byte.is_ascii_hexdigit()))
            .and_then(|two| u8::from_str_radix(two, 16).ok());
        if let Some(byte) = number.filter(|_| *first == b'%') {
            bytes.push(byte);
            rest = after.get(2..).unwrap_or_default();
        } else {
            bytes.push(*first);
            rest = after;
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
