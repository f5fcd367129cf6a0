//! The vertices of a body, and the numbers that solvers give them.
//!
//! Solvers work on *nodes*: vertices numbered with free vertices first, in the mesh's order, then those of each handle.

/// The vertices of a body and their nodes.
#[derive(Clone, Debug)]
pub(crate) struct Topology {
    pub(crate) node_of_vertex: Vec<u32>,
    /// Number of changes of connectivity, handles and supports. Data that a solver made for one epoch are invalid in
    /// another.
    pub(crate) epoch: u64,
}

impl Topology {
    /// Numbers `count` vertices: first the free ones, then those of `held` in its order. Returns the nodes of the
    /// vertices and the number of free vertices.
    pub(crate) fn number<'a>(
        count: usize,
        held: impl Iterator<Item = &'a u32> + Clone,
    ) -> (Vec<u32>, usize) {
        let mut free = vec![true; count];
        for &vertex in held.clone() {
            free[vertex as usize] = false;
        }
        let mut nodes = vec![0; count];
        let unheld = (0..count as u32).filter(|&vertex| free[vertex as usize]);
        for (node, vertex) in unheld.chain(held.copied()).enumerate() {
            nodes[vertex as usize] = node as u32;
        }
        (nodes, free.iter().filter(|free| **free).count())
    }
}
