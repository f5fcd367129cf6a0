//! From VTK's arrays of cell data to the fields of a mesh, alike for its legacy and its XML files.

use crate::file::{MAX_FIELDS, MeshFileError, Place};
use crate::text::quoted;
use crate::vtk_array::Array;
use physics::mesh::{Field, Mesh};

/// Adds a field to a mesh: of the values of all the file's cells those of the cells that were kept. One
/// without a name is passed over.
///
/// `cells` is how many cells the file has, and `kept` the number among them of each of the mesh.
pub(crate) fn add(
    mesh: &mut Mesh,
    (cells, kept): (usize, &[u32]),
    (place, name): (Place, &str),
    array: &Array,
) -> Result<(), MeshFileError> {
    if name.trim().is_empty() {
        return Ok(());
    }
    check_name(
        mesh.fields_mut().iter().map(|field| &field.name[..]),
        place,
        name,
    )?;
    if array.len() != cells {
        return Err(MeshFileError::syntax(
            place,
            format!("a value for each of {cells} cells in {}", quoted(name)),
            format!("{} values", array.len()),
        ));
    }
    let mut values = Vec::with_capacity(kept.len());
    let mut next = kept.iter().copied().peekable();
    // What stands for a cell that was passed over does not matter.
    for (cell, value) in (0_u32..).zip(array.reals("a value of the cell, finite")) {
        if next.next_if_eq(&cell).is_some() {
            values.push(value?);
        }
    }
    mesh.fields_mut().push(Field {
        name: name.to_owned(),
        values,
    });
    Ok(())
}

/// Checks that one more field may have this name.
pub(crate) fn check_name<'a>(
    mut names: impl ExactSizeIterator<Item = &'a str>,
    place: Place,
    name: &str,
) -> Result<(), MeshFileError> {
    if names.len() >= MAX_FIELDS {
        let expected = format!("at most {MAX_FIELDS} arrays of cell data");
        return Err(MeshFileError::syntax(place, expected, quoted(name)));
    }
    if names.any(|other| other == name) {
        let expected = format!("cell data {} once", quoted(name));
        return Err(MeshFileError::syntax(place, expected, "it again"));
    }
    Ok(())
}
