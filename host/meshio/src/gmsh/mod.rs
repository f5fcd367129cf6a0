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
//! - A file with tetrahedra of 4 or 10 nodes is a solid. Triangles, lines and
//!   points only name vertices. They must have the order of the tetrahedra; otherwise their groups would
//!   lack the vertices at the middles of edges.
//! - A file whose lines are its cells of highest dimension is a thread. Points only name vertices.
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

pub(crate) mod assemble;
mod elements;
mod fields;
mod groups;
mod input;
mod sections;
mod version2;

use crate::error::GmshError;
use crate::lines::Unexpected;
use physics::mesh::Mesh;

/// Largest number of named physical groups in a file.
pub const MAX_GROUPS: usize = crate::error::MAX_GROUPS;
/// Largest number of physical groups of one entity. This limit bounds the memory for groups by the memory for
/// elements.
pub const MAX_TAGS: usize = 16;

impl From<Unexpected> for GmshError {
    fn from(error: Unexpected) -> Self {
        Self::Syntax {
            position: error.position,
            expected: error.expected,
            found: error.found,
        }
    }
}

/// Reads a mesh from the bytes of an MSH file: a solid if there is a tetrahedron in the file, a thread if there is nothing
/// but lines and points, otherwise a sheet. Coordinates are taken as metres. With a distance, vertices within it are
/// merged.
///
/// # Errors
/// The first [`GmshError`] found.
pub(crate) fn parse(bytes: &[u8], merge: Option<f64>) -> Result<Mesh, GmshError> {
    let sections = sections::read(bytes)?;
    Ok(match elements::highest_dimension(&sections)? {
        3 => Mesh::Solid(assemble::solid(&sections, merge)?),
        1 => Mesh::Thread(assemble::thread(&sections, merge)?),
        _ => Mesh::Sheet(assemble::sheet(&sections, merge)?),
    })
}
