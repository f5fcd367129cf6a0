//! Mesh files: what is accepted is a mesh, and what is refused is refused in one line. Each function returns how many
//! meshes were read.

use crate::is_one_line;
use meshio::{Choices, read_mesh_as};
use physics::mesh::Mesh;

fn mesh(name: &str, bytes: &[u8], texture_unit: Option<f64>) -> usize {
    let choices = Choices {
        merge: None,
        texture_unit,
    };
    let mesh = read_mesh_as(name, bytes, choices);
    match &mesh {
        Ok(Mesh::Thread(mesh)) => mesh.validate().expect("what is read is valid"),
        Ok(Mesh::Sheet(mesh)) => mesh.validate().expect("what is read is valid"),
        Ok(Mesh::Solid(mesh)) => mesh.validate().expect("what is read is valid"),
        Err(error) => is_one_line(error),
    }
    usize::from(mesh.is_ok())
}

/// Gmsh.
///
/// # Panics
/// If the reader breaks the rule.
pub fn gmsh(bytes: &[u8]) -> usize {
    mesh("mesh.msh", bytes, None)
}

/// OBJ, with and without a flat pattern.
///
/// # Panics
/// If the reader breaks the rule.
pub fn obj(bytes: &[u8]) -> usize {
    mesh("mesh.obj", bytes, None) + mesh("mesh.obj", bytes, Some(0.01))
}

/// VTK's older format.
///
/// # Panics
/// If the reader breaks the rule.
pub fn vtk_legacy(bytes: &[u8]) -> usize {
    mesh("mesh.vtk", bytes, None)
}

/// VTK's format in XML.
///
/// # Panics
/// If the reader breaks the rule.
pub fn vtk_xml(bytes: &[u8]) -> usize {
    mesh("mesh.vtu", bytes, None)
}

/// Any format, which follows from how the file begins.
///
/// # Panics
/// If the reader breaks the rule.
pub fn solid(bytes: &[u8]) -> usize {
    mesh("mesh", bytes, None)
}
