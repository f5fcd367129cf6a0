//! The constraints of a body: handles, which move vertices with a hand, and supports, which guide vertices along axes.

use super::handle::Handle;
use super::support::Supports;

/// Handles and supports.
#[derive(Clone, Debug)]
pub(crate) struct Constraints {
    pub(crate) handles: Vec<Handle>,
    pub(crate) supports: Supports,
}

impl Constraints {
    /// The vertices of all handles, handle by handle, in the order of their nodes.
    pub(crate) fn held(&self) -> impl Iterator<Item = &u32> + Clone {
        self.handles.iter().flat_map(|handle| &handle.vertices)
    }
}
