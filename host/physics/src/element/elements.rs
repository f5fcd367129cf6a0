//! The interface of a set of elements of one kind to a body.
//!
//! A body consists of one or more such sets over the same nodes. Each set has its own arrays and its own loops over its
//! elements. The body calls functions of whole sets only, so there is no dispatch element by element. Nodes are the
//! vertices of the mesh. A solver may renumber a copy of the set to its own places.

use super::{Tearable, VectorForm};
use crate::linear::block_matrix::{BlockMatrix, ElementSlots};
use crate::material::Tangent;
use crate::{Mat3, Vec3};
use core::fmt;

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

    /// The elements as those of a sheet that can tear, or `None` if they cannot be torn.
    fn tearable(&self) -> Option<&dyn Tearable> {
        None
    }

    /// [`tearable`](Self::tearable), to be changed.
    fn tearable_mut(&mut self) -> Option<&mut dyn Tearable> {
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

/// The places of the nodes of each element.
pub(crate) fn placed<const N: usize>(
    elements: &[[u32; N]],
    place: &[u32],
) -> impl Iterator<Item = [u32; N]> {
    let at = |node: u32| place[node as usize];
    elements.iter().map(move |nodes| nodes.map(at))
}

/// The slots of the blocks of each element in `matrix`. The result is empty if `matrix` lacks a block.
pub(crate) fn slots<const N: usize>(
    elements: impl Iterator<Item = [u32; N]>,
    matrix: &BlockMatrix,
) -> Vec<ElementSlots<N>> {
    let slots = elements.map(|nodes| matrix.element_slots(nodes));
    slots.collect::<Option<_>>().unwrap_or_default()
}
