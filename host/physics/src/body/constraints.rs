//! The constraints of a body: handles, which move vertices with a hand, and supports, which guide vertices along axes.
//!
//! Constraints are masks over the nodes. They renumber no node.

use super::border::{self, Clamp};
use super::handle::Handle;
use super::support::Supports;
use crate::Vec3;
use crate::linear::places::Places;

/// Handles and supports.
#[derive(Clone, Debug)]
pub(crate) struct Constraints {
    pub(crate) handles: Vec<Handle>,
    pub(crate) supports: Supports,
    /// By node, whether a handle holds it, or it has halted.
    is_held: Vec<bool>,
    /// Nodes that have halted: those of pieces that have left the scene.
    gone: Vec<u32>,
}

impl Constraints {
    /// Constraints by `handles`, which have still to be [laid](border::lay).
    pub(crate) fn new(handles: Vec<Handle>) -> Self {
        Self {
            handles,
            supports: Supports::default(),
            is_held: Vec::new(),
            gone: Vec::new(),
        }
    }

    /// Halts nodes that no handle holds: they stand still from now on. Nodes that have halted are ignored.
    pub(super) fn halt(&mut self, nodes: &[u32]) {
        for &node in nodes {
            if let Some(held) = self.is_held.get_mut(node as usize)
                && !*held
            {
                *held = true;
                self.gone.push(node);
            }
        }
    }

    /// The nodes that have halted.
    pub(crate) fn gone(&self) -> &[u32] {
        &self.gone
    }

    /// All clamps, in the order of their ghosts.
    pub(crate) fn clamps(&self) -> impl Iterator<Item = &Clamp> {
        let supports = self.supports.list.iter();
        let handles = self.handles.iter().flat_map(|handle| &handle.clamps);
        handles.chain(supports.flat_map(|support| &support.clamps))
    }

    /// Numbers the ghosts after the first `vertices` of `count` nodes, and finds which handle or support each node has.
    pub(super) fn lay_out(&mut self, vertices: usize, count: usize) {
        let mut next = vertices as u32;
        for handle in &mut self.handles {
            border::number(&mut handle.vertices, &mut handle.clamps, &mut next);
        }
        self.supports.number_ghosts(&mut next);
        self.is_held.resize(count, false);
        self.mark();
        self.supports.lay_out(count);
    }

    /// Makes room for `nodes` more nodes, which [`push`](Self::push) adds.
    pub(super) fn reserve(&mut self, nodes: usize) {
        self.is_held.reserve(nodes);
        self.gone.reserve(self.is_held.len() + nodes);
        self.supports.reserve(nodes);
    }

    /// Adds a node that no handle holds, and that supports guide as both `ends` between which it lies: see
    /// [`Supports::push`].
    pub(super) fn push(&mut self, ends: [u32; 2], at: f64) {
        self.is_held.push(false);
        self.supports.push(ends, at);
    }

    /// Whether a handle holds a node, or it has halted.
    pub(crate) fn holds(&self, node: u32) -> bool {
        self.is_held.get(node as usize).is_some_and(|held| *held)
    }

    /// Whether the motion of all `nodes` is prescribed: by one handle, or by supports along all axes.
    pub(crate) fn prescribe_all(&self, nodes: &[u32]) -> bool {
        if nodes.iter().all(|&node| self.is_held[node as usize]) {
            let holds = |handle: &Handle| nodes.iter().all(|n| handle.vertices.contains(n));
            return self.handles.iter().any(holds);
        }
        let mask = self.supports.mask().unwrap_or_default();
        let guided = |&node: &u32| mask.get(node as usize).is_some_and(|m| m.amax() == 0.0);
        nodes.iter().all(guided)
    }

    fn mark(&mut self) {
        self.is_held.fill(false);
        let held = self.handles.iter().flat_map(|handle| &handle.vertices);
        for &node in held.chain(&self.gone) {
            self.is_held[node as usize] = true;
        }
    }

    /// All nodes in the order of sums over a body: free nodes in the mesh's order, then those of each handle, then those
    /// that have halted. A sum in this order does not depend on when the handles were grabbed.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = usize> + '_ {
        let gone = self.gone.iter().map(|&node| node as usize);
        self.free_nodes().chain(self.held_nodes()).chain(gone)
    }

    /// The nodes that no handle holds and that have not halted, in the mesh's order.
    pub(crate) fn free_nodes(&self) -> impl Iterator<Item = usize> + '_ {
        let marked = self.is_held.iter().enumerate();
        marked
            .filter(|(_, is_held)| !**is_held)
            .map(|(node, _)| node)
    }

    /// The held nodes, handle by handle.
    pub(crate) fn held_nodes(&self) -> impl Iterator<Item = usize> + '_ {
        let held = self.handles.iter().flat_map(|handle| &handle.vertices);
        held.map(|&node| node as usize)
    }

    /// The forces of the hands on the [held nodes](Self::held_nodes), less the inertia of the nodes, in the last step
    /// (N).
    pub(crate) fn grips(&self) -> impl Iterator<Item = &Vec3> {
        self.handles.iter().flat_map(|handle| &handle.grip)
    }

    /// The same forces, to be changed.
    pub(crate) fn grips_mut(&mut self) -> impl Iterator<Item = &mut Vec3> {
        self.handles.iter_mut().flat_map(|handle| &mut handle.grip)
    }

    /// Sets the forces of the hands to zero: they are unknown.
    pub(crate) fn forget_grips(&mut self) {
        self.grips_mut().for_each(|grip| *grip = Vec3::zeros());
    }

    /// The places of the nodes in the matrices of solvers: the order of [`nodes`](Self::nodes).
    pub(crate) fn places(&self) -> Places {
        let held = self.handles.iter().flat_map(|handle| &handle.vertices);
        Places::new(&self.is_held, held.chain(&self.gone).copied())
    }

    /// Memory of the mask (bytes).
    pub(crate) fn mask_bytes(&self) -> usize {
        size_of_val(self.is_held.as_slice()) + size_of_val(self.gone.as_slice())
    }
}
