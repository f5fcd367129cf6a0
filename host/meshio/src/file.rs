//! A mesh from the bytes of a file, whatever its format: a thread, a sheet or a solid.
//!
//! The beginning of the file tells the format; if it does not, the end of the file's name does. The same rules hold for all
//! formats. Every number is checked, every count is compared with the data that follow, and memory is taken in proportion to
//! the file and never to a number in it. Vertices that no line, triangle or cell of the mesh uses are dropped. A mesh that
//! [`LineMesh::validate`], [`TriMesh::validate`] or [`TetMesh::validate`] refuses is an error, and so are two vertices at one
//! position and a vertex on an edge of other vertices. Tetrahedra of the opposite orientation are turned around.
//!
//! [`LineMesh::validate`]: physics::mesh::LineMesh::validate
//! [`TriMesh::validate`]: physics::mesh::TriMesh::validate
//! [`TetMesh::validate`]: physics::mesh::TetMesh::validate

use crate::error::MeshFileError;
use crate::{gmsh, obj, stl, vtk_legacy, vtk_xml};
use physics::mesh::Mesh;

/// Reads a mesh from the bytes of a file called `name`: a solid if there is a tetrahedron in it, a sheet if there is a
/// triangle, a thread if there are lines. Coordinates are taken as metres. (Lines of OBJ files, and those in the sections
/// for lines of VTK's polygon files, make no thread.)
///
/// In the file of a solid, triangles, lines and points only name vertices. If the format has named groups, the
/// groups of such elements become vertex groups. Otherwise such elements are skipped.
///
/// # Errors
/// The first [`MeshFileError`] found.
pub fn read_mesh(name: &str, bytes: &[u8]) -> Result<Mesh, MeshFileError> {
    read_mesh_as(name, bytes, Choices::default())
}

/// The choices of a caller for a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choices {
    /// The distance within which vertices are merged, in the unit of the file's coordinates. Without it, two vertices at one
    /// position are an error.
    pub merge: Option<f64>,
    /// The unit of the texture coordinates (m), if they are the flat pattern of a sheet.
    pub texture_unit: Option<f64>,
}

/// As [`read_mesh`], with choices.
///
/// # Errors
/// As [`read_mesh`]. With a unit of texture coordinates, a corner without texture coordinates is an error, and so is a file
/// of another format than OBJ, which has none.
pub fn read_mesh_as(name: &str, bytes: &[u8], choices: Choices) -> Result<Mesh, MeshFileError> {
    let Choices {
        merge,
        texture_unit,
    } = choices;
    Ok(match (Format::of(name, bytes)?, texture_unit) {
        (Format::Obj, _) => Mesh::Sheet(obj::parse(bytes, texture_unit, merge)?),
        (_, Some(_)) => return Err(MeshFileError::NoTexture),
        (Format::Gmsh, None) => gmsh::parse(bytes, merge)?,
        (Format::Stl, None) => Mesh::Sheet(stl::parse(bytes, merge)?),
        (Format::VtkLegacy, None) => vtk_legacy::parse(bytes, merge)?,
        (Format::VtkXml, None) => vtk_xml::parse(bytes, merge)?,
    })
}

#[derive(Clone, Copy)]
enum Format {
    Obj,
    Gmsh,
    Stl,
    VtkLegacy,
    VtkXml,
}

impl Format {
    fn of(name: &str, bytes: &[u8]) -> Result<Self, MeshFileError> {
        let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        let start = text.trim_ascii_start();
        let beginnings: [(&[u8], Self); 6] = [
            (b"$MeshFormat", Self::Gmsh),
            (b"$NOD", Self::Gmsh),
            (b"# vtk DataFile", Self::VtkLegacy),
            (b"<?xml", Self::VtkXml),
            (b"<!--", Self::VtkXml),
            (b"<VTKFile", Self::VtkXml),
        ];
        let known = beginnings.iter().find(|(word, _)| start.starts_with(word));
        if let Some((_, format)) = known {
            return Ok(*format);
        }
        if stl::is_stl(bytes) {
            return Ok(Self::Stl);
        }
        let extension = name
            .rsplit_once('.')
            .map(|(_, end)| end.to_ascii_lowercase());
        match extension.as_deref() {
            Some("obj") => return Ok(Self::Obj),
            Some("msh") => return Ok(Self::Gmsh),
            Some("stl") => return Ok(Self::Stl),
            Some("vtk") => return Ok(Self::VtkLegacy),
            Some("vtu" | "vtp") => return Ok(Self::VtkXml),
            _ => {}
        }
        // The program meshio reads these.
        let others: [(&[u8], &str); 5] = [
            (b"ply", "a PLY file"),
            (b"OFF", "an OFF file"),
            (b"MeshVersionFormatted", "a MEDIT file"),
            (b"*", "an Abaqus file"),
            (b"\x89HDF", "an HDF5 file"),
        ];
        let other = others.iter().find(|(word, _)| start.starts_with(word));
        let found = if start.is_empty() {
            "an empty file".to_owned()
        } else if let Some((_, kind)) = other {
            format!("{kind}; convert the file with `meshio convert FILE mesh.vtu`")
        } else {
            format!(
                "a file that begins with {}",
                crate::text::quoted_bytes(start)
            )
        };
        Err(MeshFileError::Format { found })
    }
}
