//! Line meshes: positions, lines of two vertices each, named groups, and values per line.
//!
//! A thread, a suture or a net of threads. Lines may branch and may come in several pieces. The
//! vertices do not tell the thickness of a line: a cross-section is a value per line, or one value of the scene.

use super::{Bounds, Field, Group};
use crate::Vec3;

/// A mesh of lines with named groups, as a generator or a file gives it.
///
/// Every index in it has been checked against the arrays that it points into.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LineMesh {
    /// Rest positions (m), one per vertex.
    pub positions: Vec<Vec3>,
    /// Vertex indices of each line.
    pub lines: Vec<[u32; 2]>,
    /// Named sets of vertices, in the order in which they were defined.
    pub vertex_groups: Vec<Group>,
    /// Named sets of lines, in the order in which they were defined.
    pub line_groups: Vec<Group>,
    /// Named values, one per line.
    pub line_fields: Vec<Field>,
}

impl LineMesh {
    /// The group of vertices called `name`.
    ///
    /// A group of lines that came from a file has a group of vertices of the same name.
    pub fn group(&self, name: &str) -> Option<&Group> {
        self.vertex_groups.iter().find(|group| group.name == name)
    }

    /// The smallest axis-aligned box that holds the mesh at rest, or `None` if it has no vertices.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(&self.positions)
    }
}
