//! Reads meshes in Gmsh's MSH format, versions 4.1 and 2.0 to 2.2, text and binary, from the bytes of a file.
//!
//! Source: the Gmsh reference manual, "MSH file format" and "MSH file format version 2 (Legacy)". The reader supports
//! `$MeshFormat`, `$PhysicalNames`, `$Entities`, `$PartitionedEntities`, `$Nodes` and `$Elements`, each at most once and
//! in any order after the first, and any number of `$ElementData`. Other sections are skipped. The format has no units:
//! coordinates are taken as metres.
//!
//! - A file without tetrahedra is a sheet. 3-node triangles become its triangles, in the order of the file. 2-node
//!   lines and points only name vertices. Any other element is an error, because a mesh without the element would
//!   have holes.
//! - A file with tetrahedra of 4 or 10 nodes is a solid, if the caller accepts solids. Triangles, lines and
//!   points only name vertices. They must have the order of the tetrahedra; otherwise their groups would
//!   lack the vertices at the middles of edges.
//! - A file whose lines are its cells of highest dimension is a thread, if one is asked for. Points only name vertices.
//! - Vertices are the nodes that a line of a thread, a triangle of a sheet, or a cell of a solid, uses, in the file's
//!   order; others (the centre of an arc) are dropped, from groups too.
//! - A named physical group of points or curves becomes a vertex group, of curves in a thread also a group of lines; of
//!   surfaces, a vertex group and, in a sheet, a triangle group; of volumes, a cell group. Groups of one name are one group. A group left
//!   without members is dropped, and so is one without a name. The sign of a physical tag is ignored. The parts of a
//!   partitioned entity have their own physical groups. In version 2 each element has its own.
//! - An `$ElementData` with one component becomes a field of the lines of a thread, the triangles of a
//!   sheet or the cells of a solid. It has to name each of them once. Values of other elements are skipped, and so is an
//!   `$ElementData` without a name, with more components or with values that are not finite.
//!
//! The file is hostile until checked. Every number is parsed, and every count is compared with the data that follow.
//! Memory is allocated in proportion to the size of the text, never to a number in the text.

mod assemble;
mod elements;
mod fields;
mod groups;
mod input;
mod sections;
pub(crate) mod solid;
mod thread;
mod version2;

use crate::file::{Place, Wanted};
use crate::lines::Unexpected;
use physics::mesh::{Mesh, MeshError, SolidError, ThreadError, TriMesh};
use thiserror::Error;

/// Largest number of named physical groups in a file.
pub const MAX_GROUPS: usize = crate::file::MAX_GROUPS;
/// Largest number of physical groups of one entity. This limit bounds the memory for groups by the memory for
/// elements.
pub const MAX_TAGS: usize = 16;

/// The reason why a text holds no valid mesh. Lines are counted from one. Every message is one line of text.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum GmshError {
    /// A number, a name or a section is missing or malformed.
    #[error("{place}: expected {expected}, found {found}")]
    Syntax {
        /// Where.
        place: Place,
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
    #[error("{place}: found elements of type {code} ({name}), expected {expected}; {advice}")]
    Element {
        /// Where the block of elements starts.
        place: Place,
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
        "{place}: found {name}, in {first} {first_name}; mesh again with one Mesh.ElementOrder for \
         all"
    )]
    MixedOrder {
        /// Where the block of elements of the other order starts.
        place: Place,
        /// The name of these elements.
        name: &'static str,
        /// Where the first block of tetrahedra starts.
        first: Place,
        /// The name of the elements of that block.
        first_name: &'static str,
    },
    /// A section, a field or a tag that may occur only once occurs again.
    #[error("{place}: expected {item} once, found a second one; the first is in {first}")]
    Repeated {
        /// Where the repetition stands.
        place: Place,
        /// The section, the field, or the kind of tag with its number.
        item: String,
        /// Where the first one stands.
        first: Place,
    },
    /// A section is missing.
    #[error("{place}: expected a section {section}, found the end of the file")]
    Missing {
        /// The end of the file.
        place: Place,
        /// The section.
        section: &'static str,
    },
    /// The triangles form no valid mesh. The message counts vertices and triangles from zero, as in the mesh.
    #[error("{place}: {source}")]
    Mesh {
        /// The place of the faulty triangle or vertex.
        place: Place,
        /// The fault.
        source: MeshError,
    },
    /// The tetrahedra form no valid mesh. The message counts vertices and cells from zero, as in the mesh.
    #[error("{place}: {source}")]
    Solid {
        /// The place of the faulty cell or vertex.
        place: Place,
        /// The fault.
        source: SolidError,
    },
    /// The lines make no usable mesh. Vertices and lines of the mesh are counted from zero here, as they would be in the
    /// mesh.
    #[error("{place}: {source}")]
    Thread {
        /// Where the element or vertex at fault stands.
        place: Place,
        /// What is wrong with it.
        source: ThreadError,
    },
}

impl From<Unexpected> for GmshError {
    fn from(error: Unexpected) -> Self {
        Self::Syntax {
            place: error.place,
            expected: error.expected,
            found: error.found,
        }
    }
}

/// Reads a sheet from the text of an MSH file. Coordinates are taken as metres.
///
/// # Errors
/// The first [`GmshError`] found. A tetrahedron is an error.
pub fn parse(text: &str) -> Result<TriMesh, GmshError> {
    parse_bytes(text.as_bytes())
}

/// As [`parse`], from the bytes of a file, text or binary.
///
/// # Errors
/// As [`parse`]; [`GmshError::NotText`] if the bytes of a text file are not UTF-8.
pub fn parse_bytes(bytes: &[u8]) -> Result<TriMesh, GmshError> {
    assemble::sheet(&sections::read(bytes, Wanted::Sheet)?, None)
}

/// As [`parse_bytes`], a solid if there is a tetrahedron in the file, a thread if there is nothing but lines and points,
/// otherwise a sheet. With a distance, vertices within it are merged.
///
/// # Errors
/// As [`parse_bytes`], except that tetrahedra are allowed.
pub(crate) fn parse_mesh(bytes: &[u8], merge: Option<f64>) -> Result<Mesh, GmshError> {
    let sections = sections::read(bytes, Wanted::Any)?;
    Ok(match elements::highest_dimension(&sections)? {
        3 => Mesh::Solid(solid::mesh(&sections, merge)?),
        1 => Mesh::Thread(thread::mesh(&sections, merge)?),
        _ => Mesh::Sheet(assemble::sheet(&sections, merge)?),
    })
}
