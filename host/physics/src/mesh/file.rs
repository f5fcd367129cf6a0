//! A mesh from the bytes of a file, whatever its format.
//!
//! The format follows from the end of the file's name and, where that says nothing, from how the file
//! begins. All formats are held to the same: every number is checked, every count compared with what
//! follows, memory taken in proportion to the file and never to a number in it. Vertices that no triangle
//! uses are dropped; what [`TriMesh::validate`] refuses, and two vertices at one place, is an error.

use super::gmsh::{self, GmshError};
use super::lines::Unexpected;
use super::{MeshError, TriMesh, obj, vtk_legacy, vtk_xml};
use std::fmt;
use thiserror::Error;

/// The most named groups that a file may have.
pub const MAX_GROUPS: usize = 256;

/// Why a file is no mesh. Every message is one line of text.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MeshFileError {
    /// Neither the file's name nor how it begins says which format it is in.
    #[error(
        "expected a mesh in a file called .obj, .vtk, .vtu, .vtp or .msh, found another name and {found}"
    )]
    Format {
        /// How the file begins.
        found: String,
    },
    /// Something else stands in the file than should.
    #[error("{place}: expected {expected}, found {found}")]
    Syntax {
        /// Where.
        place: Place,
        /// What should stand there, and where it helps, what to do.
        expected: String,
        /// What stands there, shortened.
        found: String,
    },
    /// The triangles make no usable mesh. Vertices and triangles are counted from zero here, as they
    /// would be in the mesh.
    #[error("{place}: {source}")]
    Mesh {
        /// Where the triangle or vertex at fault stands.
        place: Place,
        /// What is wrong with it.
        source: MeshError,
    },
    /// A Gmsh file is wrong.
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
        /// The number's place in the array, counted from zero.
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
    pub(super) fn syntax(
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

/// Reads a mesh from the bytes of a file called `name`. Coordinates are taken as metres.
///
/// # Errors
/// The first [`MeshFileError`] found.
pub fn read(name: &str, bytes: &[u8]) -> Result<TriMesh, MeshFileError> {
    let extension = name
        .rsplit_once('.')
        .map(|(_, end)| end.to_ascii_lowercase());
    match extension.as_deref() {
        Some("obj") => obj::parse(bytes),
        Some("msh") => Ok(gmsh::parse_bytes(bytes)?),
        Some("vtk") => vtk_legacy::parse(bytes),
        Some("vtu" | "vtp") => vtk_xml::parse(bytes),
        _ => read_by_beginning(bytes),
    }
}

fn read_by_beginning(bytes: &[u8]) -> Result<TriMesh, MeshFileError> {
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let start = text.trim_ascii_start();
    if start.starts_with(b"$MeshFormat") {
        Ok(gmsh::parse_bytes(bytes)?)
    } else if start.starts_with(b"# vtk DataFile") {
        vtk_legacy::parse(bytes)
    } else if start.starts_with(b"<?xml") || start.starts_with(b"<VTKFile") {
        vtk_xml::parse(bytes)
    } else {
        let found = if start.is_empty() {
            "an empty file".to_owned()
        } else {
            format!(
                "a file that begins with {}",
                super::text::quoted_bytes(start)
            )
        };
        Err(MeshFileError::Format { found })
    }
}
