//! Meshes in Gmsh's MSH format, version 4.1, ASCII, from a file's text.
//!
//! Source: the Gmsh reference manual, "MSH file format". Read are `$MeshFormat`, `$PhysicalNames`,
//! `$Entities`, `$Nodes` and `$Elements`, each at most once and in any order after the first; other
//! sections are skipped. The format knows no units: coordinates are taken as metres.
//!
//! - 3-node triangles become the mesh's triangles, in the file's order. 2-node lines and points only name
//!   vertices. Any other element is an error, for a mesh without it would have holes.
//! - Vertices are the nodes that a triangle uses, in the file's order; others (the centre of an arc) are
//!   dropped, from groups too.
//! - A named physical group of points or curves becomes a vertex group; of surfaces, a triangle group and
//!   a vertex group. Groups of one name are one group. A group left without members is dropped, and so
//!   is one without a name. The sign of a physical tag is ignored.
//!
//! The file is hostile until checked: every number is parsed, every count compared with what follows, and
//! memory is taken in proportion to the text, never to a number in it.

mod assemble;
mod sections;

use super::lines::Unexpected;
use super::{MeshError, TriMesh};
use thiserror::Error;

/// The most named physical groups that a file may have.
pub const MAX_GROUPS: usize = super::file::MAX_GROUPS;
/// The most physical groups that one entity may be in. With it the room for groups is bounded by that for
/// elements.
pub const MAX_TAGS: usize = 16;

/// Why a text is no mesh. Lines are counted from one; every message is one line of text.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum GmshError {
    /// Something else stands where a number, a name or a section should.
    #[error("line {line}: expected {expected}, found {found}")]
    Syntax {
        /// Where.
        line: usize,
        /// What should stand there.
        expected: String,
        /// What stands there, shortened.
        found: String,
    },
    /// The file is in another version of the format, or binary.
    #[error(
        "line {line}: found MSH {found}, only 4.1 ASCII is read; convert the file with \
         `gmsh in.msh -save -o out.msh -format msh41`"
    )]
    Version {
        /// Where.
        line: usize,
        /// The version and whether it is ASCII or binary.
        found: String,
    },
    /// The bytes are no UTF-8 text.
    #[error(
        "line {line}: found bytes that are no text, expected MSH 4.1 ASCII in UTF-8; convert the file \
         with `gmsh in.msh -save -o out.msh -format msh41`"
    )]
    NotText {
        /// Where the first such byte stands.
        line: usize,
    },
    /// The file has elements other than 3-node triangles, 2-node lines and points.
    #[error(
        "line {line}: found elements of type {code} ({name}), expected 3-node triangles, 2-node lines or \
         points; {advice}"
    )]
    Element {
        /// Where the block of elements starts.
        line: usize,
        /// Gmsh's number for the type.
        code: u32,
        /// The type in words.
        name: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// What may stand only once stands twice.
    #[error("line {line}: expected {what} once, found it again, first in line {first}")]
    Repeated {
        /// Where it stands again.
        line: usize,
        /// A section, or a kind of tag with its number.
        what: String,
        /// Where it stood first.
        first: usize,
    },
    /// A section is missing.
    #[error("line {line}: expected a section {section}, found the end of the file")]
    Missing {
        /// The last line.
        line: usize,
        /// The section.
        section: &'static str,
    },
    /// The triangles make no usable mesh. Vertices and triangles are counted from zero here, as they
    /// would be in the mesh.
    #[error("line {line}: {source}")]
    Mesh {
        /// Where the triangle or vertex at fault stands.
        line: usize,
        /// What is wrong with it.
        source: MeshError,
    },
}

impl From<Unexpected> for GmshError {
    fn from(error: Unexpected) -> Self {
        Self::Syntax {
            line: error.line,
            expected: error.expected,
            found: error.found,
        }
    }
}

/// Reads a mesh from the text of an MSH 4.1 ASCII file. Coordinates are taken as metres.
///
/// # Errors
/// The first [`GmshError`] found.
pub fn parse(text: &str) -> Result<TriMesh, GmshError> {
    assemble::mesh(&sections::read(text)?)
}

/// As [`parse`], from the bytes of a file, so that a binary MSH file is called by its name.
///
/// # Errors
/// As [`parse`]; [`GmshError::NotText`] if the bytes are no UTF-8.
pub fn parse_bytes(bytes: &[u8]) -> Result<TriMesh, GmshError> {
    let error = match std::str::from_utf8(bytes) {
        Ok(text) => return parse(text),
        Err(error) => error,
    };
    let text = bytes.get(..error.valid_up_to()).unwrap_or_default();
    let text = std::str::from_utf8(text).unwrap_or_default();
    sections::check_format(text)?;
    Err(GmshError::NotText {
        line: 1 + text.matches('\n').count(),
    })
}
