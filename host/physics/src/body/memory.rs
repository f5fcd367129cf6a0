//! The memory that a body holds.

use super::Body;
use super::handle::Handle;
use crate::element::bending::Bending;

impl Body {
    /// Memory that it holds (bytes).
    pub fn bytes(&self) -> usize {
        let elements: usize = self.elements.iter().map(|set| set.bytes()).sum();
        let bending = self.bending.as_ref().map(Bending::weights);
        let handle = |handle: &Handle| size_of_val(handle) + size_of_val(handle.offsets.as_slice());
        let by_node = [
            &self.rest,
            &self.x,
            &self.v,
            &self.external,
            &self.internal,
            &self.displacement,
            &self.grip,
            &self.promised,
            &self.missed,
            &self.ahead,
        ];
        let nodes: usize = by_node.iter().map(|v| size_of_val(v.as_slice())).sum();
        size_of::<Self>()
            + elements
            + bending.map_or(0, size_of_val)
            + self.stiffness.bytes()
            + self.handles.iter().map(handle).sum::<usize>()
            + self.supports.bytes()
            + nodes
            + size_of_val(self.mass.as_slice())
            + size_of_val(self.load.as_slice())
            + size_of_val(self.node_of_vertex.as_slice())
            + self.pcg.bytes()
    }
}
