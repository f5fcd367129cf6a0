//! What sets of elements need to know of the edits of a torn surface.
//!
//! A set that has reserved room follows each edit in place: it takes the corners and the shapes at rest of the triangles
//! that the edit touched, and appends the triangles that the edit added. A triangle has the number of its triangle of the
//! [`Surface`], and its frame is that of the surface. A new triangle has the material of its original triangle.

use crate::Vec3;
use crate::topology::{Shape, Surface};

/// A surface after an edit, with the numbers and the starting positions of its vertices in a set.
#[derive(Clone, Copy, Debug)]
pub struct Torn<'a> {
    /// The surface after the edit. Each edit is followed once, before the next one.
    pub surface: &'a Surface,
    /// The number in the set of each vertex, or `None` where the set has the numbers of the surface.
    pub place: Option<&'a [u32]>,
    /// The positions from which displacements count (m), by number in the set.
    pub rest: &'a [Vec3],
}

impl Torn<'_> {
    /// The number of a vertex in the set.
    pub(crate) fn place(&self, vertex: u32) -> u32 {
        self.place.map_or(vertex, |place| place[vertex as usize])
    }

    /// The corners of a triangle, numbered as in the set.
    pub(crate) fn nodes(&self, triangle: u32) -> [u32; 3] {
        self.surface.triangles()[triangle as usize].map(|vertex| self.place(vertex))
    }

    /// The shape of a triangle at rest (m).
    pub(crate) fn shape(&self, triangle: u32) -> Shape {
        self.surface.shape(triangle)
    }
}

/// A copy of `from` with room for `limit` values in all.
pub(crate) fn with_room<T: Clone>(from: &[T], limit: usize) -> Vec<T> {
    let mut copy = Vec::with_capacity(limit.max(from.len()));
    copy.extend_from_slice(from);
    copy
}

/// Makes room in `values` for `limit` values in all.
pub(crate) fn make_room<T>(values: &mut Vec<T>, limit: usize) {
    values.reserve_exact(limit.saturating_sub(values.len()));
}
