//! Mesh files: what is accepted is a mesh, and what is refused is refused in one line. Each function returns how many
//! meshes were read.

use crate::is_one_line;
use meshio::{read, read_mesh};
use physics::mesh::{Mesh, TriMesh};
use std::error::Error;

fn sheet(read: Result<TriMesh, impl Error>) -> usize {
    match read {
        Ok(mesh) => mesh.validate().expect("what is read is valid"),
        Err(error) => {
            is_one_line(&error);
            return 0;
        }
    }
    1
}

/// Gmsh.
///
/// # Panics
/// If the reader breaks the rule.
pub fn gmsh(bytes: &[u8]) -> usize {
    sheet(meshio::gmsh::parse_bytes(bytes))
}

/// OBJ, with and without a flat pattern.
///
/// # Panics
/// If the reader breaks the rule.
pub fn obj(bytes: &[u8]) -> usize {
    sheet(meshio::obj::parse(bytes)) + sheet(meshio::obj::parse_with_pattern(bytes, 0.01))
}

/// VTK's older format.
///
/// # Panics
/// If the reader breaks the rule.
pub fn vtk_legacy(bytes: &[u8]) -> usize {
    sheet(meshio::vtk_legacy::parse(bytes))
}

/// VTK's format in XML.
///
/// # Panics
/// If the reader breaks the rule.
pub fn vtk_xml(bytes: &[u8]) -> usize {
    sheet(meshio::vtk_xml::parse(bytes))
}

/// Any format, which follows from how the file begins. What is accepted as a sheet is that sheet.
///
/// # Panics
/// If the reader breaks the rule.
pub fn solid(bytes: &[u8]) -> usize {
    let mesh = read_mesh("mesh", bytes);
    match &mesh {
        Ok(Mesh::Thread(mesh)) => mesh.validate().expect("what is read is valid"),
        Ok(Mesh::Sheet(mesh)) => mesh.validate().expect("what is read is valid"),
        Ok(Mesh::Solid(mesh)) => mesh.validate().expect("what is read is valid"),
        Err(error) => is_one_line(error),
    }
    if let Ok(sheet) = read("mesh", bytes) {
        assert_eq!(mesh, Ok(Mesh::Sheet(sheet)));
    }
    usize::from(mesh.is_ok())
}
