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

    /// The group of lines called `name`.
    pub fn line_group(&self, name: &str) -> Option<&Group> {
        self.line_groups.iter().find(|group| group.name == name)
    }

    /// The values per line called `name`.
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.line_fields.iter().find(|field| field.name == name)
    }

    /// The rest positions of a line's ends (m), or `None` if there is no such line.
    pub fn ends(&self, line: u32) -> Option<[Vec3; 2]> {
        let [a, b] = *self.lines.get(line as usize)?;
        let at = |vertex: u32| self.positions.get(vertex as usize).copied();
        Some([at(a)?, at(b)?])
    }

    /// The rest length of one line (m), or `None` if there is no such line.
    pub fn line_length(&self, line: u32) -> Option<f64> {
        let [a, b] = self.ends(line)?;
        Some((b - a).norm())
    }

    /// The rest length of the whole mesh (m).
    pub fn length(&self) -> f64 {
        (0_u32..).map_while(|line| self.line_length(line)).sum()
    }

    /// The smallest axis-aligned box that holds the mesh at rest, or `None` if it has no vertices.
    pub fn bounds(&self) -> Option<Bounds> {
        Bounds::of(&self.positions)
    }
}
