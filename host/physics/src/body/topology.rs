//! Which vertices a body has, and how solvers number them.
//!
//! Solvers work on *nodes*: the vertices numbered anew, free ones first in the mesh's order, then those of each handle.

/// The vertices of a body and their nodes.
#[derive(Clone, Debug)]
pub(crate) struct Topology {
    pub(crate) node_of_vertex: Vec<u32>,
    /// Counts the changes of what is connected and of what holds it. What a solver made for one epoch is of no use in
    /// another.
    pub(crate) epoch: u64,
}

impl Topology {
    /// Numbers `count` vertices, those of `held` after all others and in its order; tells how many others there are.
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
