//! Converts VTK's arrays of cell data to the fields of a mesh, for legacy and XML files alike.

use crate::error::{FilePosition, MAX_FIELDS, MeshFileError};
use crate::text::quoted;
use crate::vtk_array::Array;
use physics::mesh::{Field, Mesh};

/// Adds a field to a mesh, with the values of the cells that were kept. A field without a name is skipped, and so is one
/// with a value that is not finite, as programs write if a value is not known.
///
/// `cells` is the number of cells in the file, and `kept` holds the number of each of the mesh's cells among them.
pub(crate) fn add(
    mesh: &mut Mesh,
    (cells, kept): (usize, &[u32]),
    (position, name): (FilePosition, &str),
    array: &Array,
) -> Result<(), MeshFileError> {
    if name.trim().is_empty() {
        return Ok(());
    }
    check_name(
        mesh.fields_mut().iter().map(|field| &field.name[..]),
        position,
        name,
    )?;
    if array.len() != cells {
        return Err(MeshFileError::syntax(
            position,
            format!("a value for each of {cells} cells in {}", quoted(name)),
            format!("{} values", array.len()),
        ));
    }
    let mut values = Vec::with_capacity(kept.len());
    let mut next = kept.iter().copied().peekable();
    // The values of skipped cells are not checked.
    for (cell, value) in (0_u32..).zip(array.numbers("a number for the cell")) {
        if next.next_if_eq(&cell).is_some() {
            values.push(value?);
        }
    }
    if values.iter().any(|value| !value.is_finite()) {
        return Ok(());
    }
    mesh.fields_mut().push(Field {
        name: name.to_owned(),
        values,
    });
    Ok(())
}

/// Checks that a further field may have this name.
pub(crate) fn check_name<'a>(
    mut names: impl ExactSizeIterator<Item = &'a str>,
    position: FilePosition,
    name: &str,
) -> Result<(), MeshFileError> {
    if names.len() >= MAX_FIELDS {
        let expected = format!("at most {MAX_FIELDS} arrays of cell data");
        return Err(MeshFileError::syntax(position, expected, quoted(name)));
    }
    if names.any(|other| other == name) {
        let expected = format!("cell data {} once", quoted(name));
        return Err(MeshFileError::syntax(position, expected, "a second one"));
    }
    Ok(())
}
