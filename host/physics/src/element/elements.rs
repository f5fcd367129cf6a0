//! The interface of a set of elements of one kind to a body.
//!
//! A body consists of one or more such sets over the same nodes. Each set has its own arrays and its own loops over its
//! elements. The body calls functions of whole sets only, so there is no dispatch element by element. Nodes are the
//! vertices of the mesh. A solver may renumber a copy of the set to its own places.

use super::triangle::membrane::Element;
use super::{Torn, VectorForm};
use crate::linear::block_matrix::{BlockMatrix, ElementSlots};
use crate::material::Tangent;
use crate::topology::Shape;
use crate::{Mat3, Vec3};
use core::fmt;

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

/// A set of elements of one kind.
pub trait Elements: fmt::Debug + Send + Sync {
    /// Number of elements.
    fn count(&self) -> usize;

    /// Nodes of an element.
    fn nodes(&self, element: usize) -> &[u32];

    /// Replaces each node by its place.
    fn renumber(&mut self, place: &[u32]);

    /// Looks up the slots of the elements' blocks in `matrix`, whose rows are the places of the nodes.
    fn bind(&mut self, matrix: &BlockMatrix, place: &[u32]);

    /// Adds each node's lumped mass (kg) to `mass`, and the integral of the density times the node's shape function
    /// (kg) to `load`. A body force (m/s²) is multiplied by `load`. The two differ for quadratic elements.
    fn add_mass(&self, mass: &mut [f64], load: &mut [f64]);

    /// Elastic energy (J) at node positions `x`.
    fn energy(&self, x: &[Vec3]) -> f64;

    /// Adds the elastic forces (N) at node positions `x` to `force`, and the tangent (N/m) to `stiffness`.
    fn assemble(
        &self,
        x: &[Vec3],
        tangent: Tangent,
        force: &mut [Vec3],
        stiffness: &mut BlockMatrix,
    );

    /// Memory of the elements (bytes).
    fn bytes(&self) -> usize;

    /// Number of elements that are inverted at `x`. The elements of a sheet cannot be inverted.
    fn inverted(&self, x: &[Vec3]) -> usize;

    /// Cauchy stress (Pa) of an element at `x`, averaged over it, in world axes.
    fn stress(&self, element: usize, x: &[Vec3]) -> Mat3;

    /// The elements as a kernel for vector instructions takes them, or `None` if they have no such kernel. The realtime
    /// step then multiplies by their assembled matrix.
    fn vector_form(&self) -> Option<VectorForm> {
        None
    }

    /// Mass of an element (kg). Zero for elements that cannot be torn.
    fn mass(&self, _element: usize) -> f64 {
        0.0
    }

    /// The corners of a triangle at rest (m), in the frame in which the set has its deformation gradient; `None` for
    /// elements that cannot be torn.
    fn rest_shape(&self, _element: usize) -> Option<Shape> {
        None
    }

    /// Makes room for `triangles` more triangles, so that [`follow`](Self::follow) allocates nothing. The result is `false`
    /// if the set cannot follow edits; the other functions of edits then do nothing. Copies have the same room.
    fn reserve(&mut self, _triangles: usize) -> bool {
        false
    }

    /// Follows the latest edit of a torn surface, which is the set's own: element by element its triangles, with shapes in
    /// the frames of [`strained`](Self::strained). The set has to be [bound](Self::bind) anew before it is assembled.
    fn follow(&mut self, _torn: &Torn<'_>) {}

    /// Force and tangent of a triangle with its corners at these positions (m), or `None` for elements that cannot be torn.
    fn triangle(&self, _triangle: usize, _at: [Vec3; 3], _tangent: Tangent) -> Option<Element> {
        None
    }

    /// Calls `add` with the blocks (N/m) of the clipped tangent of `triangles` at node positions `x` (m), by row and
    /// column. No matrix is needed.
    fn local_stiffness(&self, triangles: &[u32], x: &[Vec3], add: &mut dyn FnMut(u32, u32, &Mat3)) {
        for &triangle in triangles {
            let Ok(nodes) = <[u32; 3]>::try_from(self.nodes(triangle as usize)) else {
                continue;
            };
            let at = nodes.map(|node| x[node as usize]);
            let element = self.triangle(triangle as usize, at, Tangent::Clipped);
            for (&row, blocks) in nodes.iter().zip(element.iter().flat_map(|e| &e.stiffness)) {
                for (&column, block) in nodes.iter().zip(blocks) {
                    add(row, column, block);
                }
            }
        }
    }

    /// Adds the elastic forces (N) at node positions `x` (m) to `force`, without a matrix.
    fn add_force(&self, _x: &[Vec3], _force: &mut [Vec3]) {}

    /// The elastic energy (J) of each triangle at node positions `x` (m).
    fn energies(&self, _x: &[Vec3], _energies: &mut [f64]) {}

    /// The state of a triangle at node positions `x` (m) in its frame at rest, or `None` for elements that cannot be torn.
    fn strained(&self, _triangle: usize, _x: &[Vec3]) -> Option<Strained> {
        None
    }

    /// A copy of the elements.
    fn boxed(&self) -> Box<dyn Elements>;
}

impl Clone for Box<dyn Elements> {
    fn clone(&self) -> Self {
        self.boxed()
    }
}

/// Replaces each node by its place.
pub(crate) fn renumber<const N: usize>(elements: &mut [[u32; N]], place: &[u32]) {
    for nodes in elements {
        *nodes = nodes.map(|node| place[node as usize]);
    }
}

/// The slots of the blocks of each element in `matrix`. The result is empty if `matrix` lacks a block.
pub(crate) fn slots<const N: usize>(
    elements: impl Iterator<Item = [u32; N]>,
    matrix: &BlockMatrix,
) -> Vec<ElementSlots<N>> {
    let slots = elements.map(|nodes| matrix.element_slots(nodes));
    slots.collect::<Option<_>>().unwrap_or_default()
}
