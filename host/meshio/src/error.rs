//! Why a mesh file cannot be read: the errors of all formats, the places in files, and the bounds that all formats keep.

use physics::mesh::check::Location;
use physics::mesh::{MeshError, SolidError, ThreadError};
use std::fmt;
use thiserror::Error;

/// Largest number of named groups in a file.
pub const MAX_GROUPS: usize = 256;
/// Largest number of named fields in a file, without the fields that are skipped.
pub const MAX_FIELDS: usize = 256;

/// The reason why a file holds no valid mesh. Every message is one line of text.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MeshFileError {
    /// Neither the beginning nor the name of the file identifies a format.
    #[error(
        "expected a mesh file whose name ends in .obj, .stl, .vtk, .vtu, .vtp or .msh, found another name and {found}"
    )]
    Format {
        /// The beginning of the file.
        found: String,
    },
    /// The file should have a flat pattern, but its format has no texture coordinates.
    #[error(
        "a flat pattern is read from texture coordinates, which only OBJ files have; export the mesh as \
         .obj with texture coordinates"
    )]
    NoTexture,
    /// The file has a syntax error.
    #[error("{position}: expected {expected}, found {found}")]
    Syntax {
        /// Position of the error.
        position: FilePosition,
        /// The expected text, in some cases with advice.
        expected: String,
        /// The text found, shortened.
        found: String,
    },
    /// The cells form no valid mesh.
    #[error(transparent)]
    Mesh(#[from] InvalidMesh),
    /// A Gmsh file is wrong.
    #[error(transparent)]
    Gmsh(#[from] GmshError),
}

/// The cells of a file form no valid mesh. The message counts vertices and cells from zero, as in the mesh.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{position}: {source}")]
pub struct InvalidMesh {
    /// Position of the faulty cell or vertex.
    pub position: FilePosition,
    /// The fault.
    pub source: MeshFault,
}

/// The fault of a mesh, by the kind of the mesh.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MeshFault {
    /// Of triangles.
    #[error(transparent)]
    Sheet(#[from] MeshError),
    /// Of tetrahedra.
    #[error(transparent)]
    Solid(#[from] SolidError),
    /// Of lines.
    #[error(transparent)]
    Thread(#[from] ThreadError),
}

impl MeshFault {
    /// The faulty vertex or cell of the mesh.
    pub(crate) fn location(&self) -> Location {
        match self {
            Self::Sheet(error) => error.location(),
            Self::Solid(error) => error.location(),
            Self::Thread(error) => error.location(),
        }
    }
}

/// A position in a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilePosition {
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

impl fmt::Display for FilePosition {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(to, "line {line}"),
            Self::Byte(byte) => write!(to, "byte {byte}"),
            Self::Item { line, item } => write!(to, "line {line}, number {item} of the array"),
        }
    }
}

impl MeshFileError {
    pub(crate) fn syntax(
        position: FilePosition,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Syntax {
            position,
            expected: expected.into(),
            found: found.into(),
        }
    }
}

/// The reason why a text holds no valid mesh. Lines are counted from one. Every message is one line of text.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum GmshError {
    /// A number, a name or a section is missing or malformed.
    #[error("{position}: expected {expected}, found {found}")]
    Syntax {
        /// Where.
        position: FilePosition,
        /// What should stand there.
        expected: String,
        /// The text found, shortened.
        found: String,
    },
    /// The file is in another version of the format.
    #[error(
        "line {line}: expected MSH 4.1 or 2.2, found MSH {found}; convert the file with \
         `gmsh in.msh -save -o out.msh -format msh41`"
    )]
    Version {
        /// Where.
        line: usize,
        /// The version and whether it is ASCII or binary.
        found: String,
    },
    /// The bytes are not UTF-8 text.
    #[error(
        "line {line}: found bytes that are no text, expected MSH ASCII in UTF-8; convert the file \
         with `gmsh in.msh -save -o out.msh -format msh41`"
    )]
    NotText {
        /// The line of the first such byte.
        line: usize,
    },
    /// The file has elements of an unsupported type.
    #[error("{position}: found elements of type {code} ({name}), expected {expected}; {advice}")]
    Element {
        /// Where the block of elements starts.
        position: FilePosition,
        /// Gmsh's number for the type.
        code: u32,
        /// The type in words.
        name: &'static str,
        /// The supported types, in words.
        expected: &'static str,
        /// Advice to the user.
        advice: &'static str,
    },
    /// Some elements are of first order, others of second order.
    #[error(
        "{position}: found {name}, in {first} {first_name}; mesh again with one Mesh.ElementOrder for \
         all"
    )]
    MixedOrder {
        /// Where the block of elements of the other order starts.
        position: FilePosition,
        /// The name of these elements.
        name: &'static str,
        /// Where the first block of tetrahedra starts.
        first: FilePosition,
        /// The name of the elements of that block.
        first_name: &'static str,
    },
    /// A section, a field or a tag that may occur only once occurs again.
    #[error("{position}: expected {item} once, found a second one; the first is in {first}")]
    Repeated {
        /// Where the repetition stands.
        position: FilePosition,
        /// The section, the field, or the kind of tag with its number.
        item: String,
        /// Where the first one stands.
        first: FilePosition,
    },
    /// A section is missing.
    #[error("{position}: expected a section {section}, found the end of the file")]
    Missing {
        /// The end of the file.
        position: FilePosition,
        /// The section.
        section: &'static str,
    },
    /// The cells form no valid mesh.
    #[error(transparent)]
    Mesh(#[from] InvalidMesh),
}
