//! The triangles of a sheet that can tear, and what they need to know of the edits of its surface.
//!
//! A set that has reserved room follows each edit in place: it takes the corners and the shapes at rest of the triangles
//! that the edit touched, and appends the triangles that the edit added. A triangle has the number of its triangle of the
//! [`Surface`], and its frame is that of the surface. A new triangle has the material of its original triangle.

use crate::lanes::Node;
use crate::topology::{Shape, Surface};
use crate::{Mat3, Vec3};

/// A strained triangle, in its frame at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strained {
    /// The two columns of the deformation gradient `F`.
    pub gradient: [Vec3; 2],
    /// The two columns of the first Piola-Kirchhoff stress `P` (Pa).
    pub stress: [Vec3; 2],
    /// Elastic energy per volume at rest (J/m³).
    pub density: f64,
    /// Area at rest (m²).
    pub area: f64,
    /// Thickness at rest (m).
    pub thickness: f64,
}

/// A set of triangles that can tear, in exact form.
pub trait Tearable {
    /// Mass of a triangle (kg).
    fn mass(&self, triangle: usize) -> f64;

    /// The corners of a triangle at rest (m), in the frame in which the set has its deformation gradient.
    fn rest_shape(&self, triangle: usize) -> Shape;

    /// Makes room for `triangles` more triangles, so that [`follow`](Self::follow) allocates nothing. Copies have the same
    /// room.
    fn reserve(&mut self, triangles: usize);

    /// Follows the latest edit of a torn surface, which is the set's own: element by element its triangles, with shapes in
    /// the frames of [`strained`](Self::strained). The set has to be [bound](super::Elements::bind) anew before it is
    /// assembled.
    fn follow(&mut self, torn: &Torn<'_>);

    /// The state of a triangle at node positions `x` (m) in its frame at rest, or `None` past the last triangle.
    fn strained(&self, triangle: usize, x: &[Vec3]) -> Option<Strained>;
}

/// A kernel of triangles that can tear.
pub(crate) trait TearableKernel<T> {
    /// Makes room for `triangles` more triangles, so that [`follow`](Self::follow) allocates nothing.
    fn reserve(&mut self, triangles: usize);

    /// Follows the latest edit of a torn surface. Products use the tangent of the next linearization. From then on the
    /// kernel may not be [assembled](super::kernel::Kernel::add_to): a new factor is made from kernels of the torn sheet.
    fn follow(&mut self, torn: &Torn<'_>);

    /// Calls `add` with the blocks (N/m) of the tangent of `triangles` at displacements `d` (m), by row and column.
    fn local_stiffness(
        &self,
        triangles: &[u32],
        d: &[Node<T>],
        add: &mut dyn FnMut(u32, u32, &Mat3),
    );
}

/// A surface after an edit, with the numbers and the starting positions of its vertices in a set.
#[derive(Clone, Copy, Debug)]
pub struct Torn<'a> {
    /// The surface after the edit. Each edit is followed once, before the next one.
    pub surface: &'a Surface,
    /// The number in the set of each vertex, or `None` if the set has the numbers of the surface.
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
