//! Reads a mesh from the bytes of a file of any format: a sheet ([`read`]), or a sheet or a solid ([`read_mesh`]).
//!
//! The format follows from the end of the file's name or, if that is unknown, from the beginning of the file. The same
//! rules hold for all formats. Every number is checked, and every count is compared with the data that follow. Memory
//! is allocated in proportion to the size of the file, never to a number in the file. Vertices that no triangle or
//! cell uses are dropped. A mesh that [`TriMesh::validate`] or [`TetMesh::validate`] refuses is an error, and so are
//! two vertices at one place. Tetrahedra with negative volume are reoriented.
//!
//! [`TetMesh::validate`]: physics::mesh::TetMesh::validate

use crate::gmsh::{self, GmshError};
use crate::lines::Unexpected;
use crate::{obj, vtk_legacy, vtk_xml};
use physics::mesh::{Mesh, MeshError, SolidError, TriMesh};
use std::fmt;
use thiserror::Error;

/// Largest number of named groups in a file.
pub const MAX_GROUPS: usize = 256;
/// Largest number of named fields in a file, without the fields that are skipped.
pub const MAX_FIELDS: usize = 256;

/// The kinds of mesh that a reader accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// Sheets only; a tetrahedron is an error.
    Sheet,
    /// A solid if the file has a tetrahedron, otherwise a sheet.
    Any,
}

/// The reason why a file holds no valid mesh. Every message is one line of text.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MeshFileError {
    /// Neither the name nor the beginning of the file identifies a format.
    #[error(
        "expected a mesh in a file called .obj, .vtk, .vtu, .vtp or .msh, found another name and {found}"
    )]
    Format {
        /// The beginning of the file.
        found: String,
    },
    /// The file has a syntax error.
    #[error("{place}: expected {expected}, found {found}")]
    Syntax {
        /// Place of the error.
        place: Place,
        /// The expected text, in some cases with advice.
        expected: String,
        /// The text found, shortened.
        found: String,
    },
    /// The triangles form no valid mesh. The message counts vertices and triangles from zero, as in the mesh.
    #[error("{place}: {source}")]
    Mesh {
        /// Place of the faulty triangle or vertex.
        place: Place,
        /// The fault.
        source: MeshError,
    },
    /// The tetrahedra form no valid mesh. The message counts vertices and cells from zero, as in the mesh.
    #[error("{place}: {source}")]
    Solid {
        /// Place of the faulty cell or vertex.
        place: Place,
        /// The fault.
        source: SolidError,
    },
    /// A Gmsh file has an error.
    #[error(transparent)]
    Gmsh(#[from] GmshError),
}

/// A place in a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A line, counted from one.
    Line(usize),
    /// A byte of a file that is not text, counted from zero.
    Byte(usize),
    /// A number of an encoded array, counted from zero, and the line where the array begins.
    Item {
        /// The line, counted from one.
        line: usize,
        /// Index of the number in the array, from zero.
        item: usize,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(to, "line {line}"),
            Self::Byte(byte) => write!(to, "byte {byte}"),
            Self::Item { line, item } => write!(to, "line {line}, number {item} of the array"),
        }
    }
}

impl From<Unexpected> for MeshFileError {
    fn from(error: Unexpected) -> Self {
        Self::Syntax {
            place: Place::Line(error.line),
            expected: error.expected,
            found: error.found,
        }
    }
}

impl MeshFileError {
    pub(crate) fn syntax(
        place: Place,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Syntax {
            place,
            expected: expected.into(),
            found: found.into(),
        }
    }
}

/// The mesh as a sheet. A reader that accepts only sheets has already refused any tetrahedron, with its place.
pub(crate) fn into_sheet(mesh: Mesh) -> Result<TriMesh, MeshFileError> {
    match mesh {
        Mesh::Sheet(mesh) => Ok(mesh),
        Mesh::Solid(_) => Err(MeshFileError::syntax(
            Place::Line(1),
            "a sheet",
            "a file of tetrahedra",
        )),
    }
}

/// Reads a sheet from the bytes of a file called `name`. Coordinates are taken as metres.
///
/// # Errors
/// The first [`MeshFileError`] found. A tetrahedron is an error.
pub fn read(name: &str, bytes: &[u8]) -> Result<TriMesh, MeshFileError> {
    Ok(match Format::of(name, bytes)? {
        Format::Obj => obj::parse(bytes)?,
        Format::Gmsh => gmsh::parse_bytes(bytes)?,
        Format::VtkLegacy => vtk_legacy::parse(bytes)?,
        Format::VtkXml => vtk_xml::parse(bytes)?,
    })
}

/// Reads a mesh from the bytes of a file called `name`: a solid if there is a tetrahedron in it, otherwise a
/// sheet. Coordinates are taken as metres.
///
/// In the file of a solid, triangles, lines and points only name vertices. If the format has named groups, the
/// groups of such elements become vertex groups. Otherwise such elements are skipped.
///
/// # Errors
/// The first [`MeshFileError`] found.
pub fn read_mesh(name: &str, bytes: &[u8]) -> Result<Mesh, MeshFileError> {
    Ok(match Format::of(name, bytes)? {
        Format::Obj => Mesh::Sheet(obj::parse(bytes)?),
        Format::Gmsh => gmsh::parse_mesh(bytes)?,
        Format::VtkLegacy => vtk_legacy::parse_mesh(bytes)?,
        Format::VtkXml => vtk_xml::parse_mesh(bytes)?,
    })
}

enum Format {
    Obj,
    Gmsh,
    VtkLegacy,
    VtkXml,
}

impl Format {
    fn of(name: &str, bytes: &[u8]) -> Result<Self, MeshFileError> {
        let extension = name
            .rsplit_once('.')
            .map(|(_, end)| end.to_ascii_lowercase());
        match extension.as_deref() {
            Some("obj") => Ok(Self::Obj),
            Some("msh") => Ok(Self::Gmsh),
            Some("vtk") => Ok(Self::VtkLegacy),
            Some("vtu" | "vtp") => Ok(Self::VtkXml),
            _ => Self::by_beginning(bytes),
        }
    }

    fn by_beginning(bytes: &[u8]) -> Result<Self, MeshFileError> {
        let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
        let start = text.trim_ascii_start();
        if start.starts_with(b"$MeshFormat") {
            Ok(Self::Gmsh)
        } else if start.starts_with(b"# vtk DataFile") {
            Ok(Self::VtkLegacy)
        } else if start.starts_with(b"<?xml") || start.starts_with(b"<VTKFile") {
            Ok(Self::VtkXml)
        } else {
            let found = if start.is_empty() {
                "an empty file".to_owned()
            } else {
                format!(
                    "a file that begins with {}",
                    crate::text::quoted_bytes(start)
                )
            };
            Err(MeshFileError::Format { found })
        }
    }
}
