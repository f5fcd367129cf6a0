//! The memory of a body.

use super::Body;
use super::handle::Handle;
use crate::element::bending::{Bending, BentSheet};

impl Body {
    /// Memory of the body (bytes).
    pub fn bytes(&self) -> usize {
        let elements: usize = self.model.elements.iter().map(|set| set.bytes()).sum();
        let bending = self.model.bending.as_ref();
        let handle = |handle: &Handle| {
            size_of_val(handle)
                + size_of_val(handle.offsets.as_slice())
                + size_of_val(handle.vertices.as_slice())
                + size_of_val(handle.clamps.as_slice())
                + size_of_val(handle.grip.as_slice())
        };
        size_of::<Self>()
            + elements
            + bending.map_or(0, Bending::bytes)
            + self.model.bent.as_ref().map_or(0, BentSheet::bytes)
            + self.constraints.handles.iter().map(handle).sum::<usize>()
            + self.constraints.supports.bytes()
            + self.state.bytes()
            + size_of_val(self.model.rest.as_slice())
            + size_of_val(self.model.external.as_slice())
            + size_of_val(self.model.mass.as_slice())
            + size_of_val(self.model.load.as_slice())
            + self.constraints.mask_bytes()
            + self.assembly.bytes()
    }
}
