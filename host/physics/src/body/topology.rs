//! The vertices of a body, and the count of the changes of their connections.
//!
//! A node of a body is a vertex of its mesh and has the number of the vertex, whatever handles and supports there are.

/// The number of vertices, and the epoch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Topology {
    pub(crate) vertex_count: usize,
    /// Number of changes of connectivity, handles and supports. Data that a solver made for one epoch are invalid in
    /// another.
    pub(crate) epoch: u64,
}
