//! The places of a body's nodes: the order in which a stepper keeps what belongs to them.

use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::lanes::{Node, to_node};

/// The order of a body's nodes, and what stays the same from step to step by place.
#[derive(Debug)]
pub(crate) struct Places<T> {
    /// The place of each node, and the node at each place. Free nodes come first, in an order that keeps the factor
    /// sparse.
    pub(crate) of: Vec<u32>,
    pub(crate) node: Vec<u32>,
    pub(crate) free: usize,
    /// The first held place. The places between are for the vertices that tears will add. Until then their node is the
    /// first one of the body, and no element has them.
    pub(crate) held: usize,
    /// Positions at rest (m).
    pub(crate) rest: Vec<Vec3>,
    pub(crate) mass: Vec<f64>,
    /// By axis of a free place: 1 if the axis is free, 0 if a support guides it; empty without supports.
    pub(crate) mask: Vec<Node<T>>,
    /// Mass times the rounding error of positions (kg m): a force below this value over `h^2` moves nothing.
    pub(super) unseen: f64,
}

impl<T: Precision> Places<T> {
    /// The places of the nodes of `body`, whose rows have the order `order`.
    pub(super) fn new(body: &Body, order: &[u32]) -> Self {
        let rows = &body.assembly.places;
        let in_order = order.iter().map(|&row| rows.nodes()[row as usize]);
        let node: Vec<u32> = in_order.collect();
        let mut of = vec![0; node.len()];
        for (place, &node) in node.iter().enumerate() {
            of[node as usize] = place as u32;
        }
        let mass: Vec<f64> = by_place(&body.model.mass, &node);
        let rest = by_place(&body.model.rest, &node);
        let lost = mass.iter().zip(&rest);
        let lost = lost.map(|(mass, rest)| (mass * rest.amax() * (0.5 * f64::EPSILON)).powi(2));
        let guided = body.constraints.supports.mask();
        let mask = guided.map_or_else(Vec::new, |mask| by_place(mask, &node[..rows.free()]));
        Self {
            of,
            free: rows.free(),
            held: rows.free(),
            unseen: lost.sum::<f64>().sqrt(),
            rest,
            mass,
            mask: mask.iter().map(to_node).collect(),
            node,
        }
    }

    /// Makes places for `spare` vertices of tears.
    pub(super) fn widen(&mut self, body: &Body, spare: usize) {
        let free = self.free;
        let first = body.constraints.nodes().next().unwrap_or(0) as u32;
        self.held = free + spare;
        self.node
            .splice(free..free, core::iter::repeat_n(first, spare));
        for place in self.of.iter_mut().filter(|place| **place as usize >= free) {
            *place += spare as u32;
        }
        self.of.reserve_exact(spare);
        self.rest = by_place(&body.model.rest, &self.node);
        self.mass
            .splice(free..free, core::iter::repeat_n(0.0, spare));
        if !self.mask.is_empty() {
            self.mask
                .resize(self.held, [T::of(1.0), T::of(1.0), T::of(1.0), T::ZERO]);
        }
    }

    /// Guides the axes that supports guide, and no others.
    pub(crate) fn guide(&mut self, body: &Body) {
        let Some(guided) = body.constraints.supports.mask() else {
            self.mask.clear();
            return;
        };
        for (mask, node) in self.mask.iter_mut().zip(&self.node[..self.free]) {
            *mask = to_node(&guided[*node as usize]);
        }
    }

    /// The place of each row of the matrix of `body`.
    pub(super) fn of_rows(&self, body: &Body) -> Vec<u32> {
        by_place(&self.of, body.assembly.places.nodes())
    }

    /// The places that nodes have: the free places, then the held places.
    pub(crate) fn taken(&self) -> impl Iterator<Item = usize> + use<T> {
        (0..self.free).chain(self.held..self.node.len())
    }
}

/// The values of nodes.
fn by_place<V: Copy>(values: &[V], node: &[u32]) -> Vec<V> {
    node.iter().map(|&node| values[node as usize]).collect()
}
