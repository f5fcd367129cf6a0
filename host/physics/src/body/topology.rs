//! The vertices of a body, and the count of the changes of their connections.
//!
//! A vertex of the mesh is a node of the body and has the same number, whatever handles and supports there are. The
//! ghosts of clamped borders have the numbers after the vertices.

/// The number of vertices, and the epoch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Topology {
    pub(crate) vertex_count: usize,
    /// Number of changes of connectivity, handles and supports. Data that a solver made for one epoch are invalid in
    /// another.
    pub(crate) epoch: u64,
}
