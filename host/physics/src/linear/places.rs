//! The order in which an assembled matrix numbers the nodes of a body: free nodes first, held nodes last.
//!
//! A node is a vertex and keeps its number. A place is a row of a matrix. Only the matrix and the solvers that use the
//! matrix count places; all other data are by node.

/// The place of each node, and the node at each place: free nodes in the mesh's order, then held nodes.
#[derive(Clone, Debug)]
pub struct Places {
    place_of_node: Vec<u32>,
    node_of_place: Vec<u32>,
    free: usize,
}

impl Places {
    /// The places of nodes, of which `is_held` marks those that are not free. `held` lists these in the order of their
    /// places.
    pub(crate) fn new(is_held: &[bool], held: impl Iterator<Item = u32>) -> Self {
        let count = is_held.len();
        let free = (0..count as u32).filter(|&node| !is_held[node as usize]);
        let mut node_of_place: Vec<u32> = Vec::with_capacity(count);
        node_of_place.extend(free);
        let free = node_of_place.len();
        node_of_place.extend(held);
        let mut place_of_node = vec![0; count];
        for (place, &node) in node_of_place.iter().enumerate() {
            place_of_node[node as usize] = place as u32;
        }
        Self {
            place_of_node,
            node_of_place,
            free,
        }
    }

    /// Number of free nodes, which have the first places.
    pub fn free(&self) -> usize {
        self.free
    }

    /// The place of each node.
    pub fn of_nodes(&self) -> &[u32] {
        &self.place_of_node
    }

    /// The node at each place.
    pub fn nodes(&self) -> &[u32] {
        &self.node_of_place
    }

    /// The place of a node.
    pub(crate) fn of(&self, node: usize) -> usize {
        self.place_of_node[node] as usize
    }

    /// The node at a place.
    pub(crate) fn node(&self, place: usize) -> usize {
        self.node_of_place[place] as usize
    }

    /// The nodes at the free places, in the mesh's order.
    pub(crate) fn free_nodes(&self) -> impl ExactSizeIterator<Item = usize> + '_ {
        self.node_of_place[..self.free]
            .iter()
            .map(|&node| node as usize)
    }

    /// The nodes at the held places.
    pub(crate) fn held_nodes(&self) -> impl ExactSizeIterator<Item = usize> + '_ {
        self.node_of_place[self.free..]
            .iter()
            .map(|&node| node as usize)
    }

    /// `values` by node, in the order of places.
    pub fn gather<V: Copy>(&self, values: &[V]) -> Vec<V> {
        let nodes = self.node_of_place.iter();
        nodes.map(|&node| values[node as usize]).collect()
    }

    /// Makes room for `nodes` more nodes, which [`push`](Self::push) adds.
    pub(crate) fn reserve(&mut self, nodes: usize) {
        self.place_of_node.reserve(nodes);
        self.node_of_place.reserve(nodes);
    }

    /// Adds a node at a place after all others. The node is free, but it is not among the [free](Self::free) places: a
    /// matrix of the old places has no row for it.
    pub(crate) fn push(&mut self) {
        let last = self.place_of_node.len() as u32;
        self.place_of_node.push(last);
        self.node_of_place.push(last);
    }

    /// Adds a free node after the other free nodes, before the held ones: the places that [`new`](Self::new) gives with
    /// one free node more.
    pub(crate) fn push_free(&mut self) {
        let node = self.place_of_node.len() as u32;
        for place in &mut self.place_of_node {
            *place += u32::from(*place as usize >= self.free);
        }
        self.place_of_node.push(self.free as u32);
        self.node_of_place.insert(self.free, node);
        self.free += 1;
    }

    /// Memory of the two lists (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.place_of_node.as_slice()) + size_of_val(self.node_of_place.as_slice())
    }
}
