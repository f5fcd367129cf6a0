//! The vector form of bending that follows the edits of a torn sheet: it follows by the exact form, and copies the
//! derivatives and the triangles that changed.

use super::NONE;
use super::exact::Bending;
use super::facets::{AtRest, BentFacets, Plan};
use super::kernels::{Blocks, State};
use super::scalar::ScalarMatrix;
use crate::element::torn::{TearableKernel, Torn, make_room, with_room};
use crate::lanes::block::LANES;
use crate::lanes::{Node, Real, to_vec};
use crate::{Mat3, Vec3};
use std::sync::Arc;

/// The exact form of the same bending.
#[derive(Clone, Debug)]
pub(super) struct Followed {
    exact: Bending,
    /// The starting positions of the nodes (m).
    rest: Vec<Vec3>,
    /// The number of each triangle's lane, over all blocks.
    lanes: Vec<u32>,
}

impl Followed {
    /// The exact form, if it follows edits. `order` contains the triangles in the order of the lanes.
    pub(super) fn new(exact: &Bending, rest: &[Vec3], order: &[usize]) -> Option<Box<Self>> {
        let mut lanes = vec![0; order.len()];
        for (lane, &triangle) in (0_u32..).zip(order) {
            lanes[triangle] = lane;
        }
        exact.can_follow().then(|| {
            Box::new(Self {
                exact: exact.clone(),
                rest: rest.to_vec(),
                lanes,
            })
        })
    }

    pub(super) fn bytes(&self) -> usize {
        self.exact.bytes() + size_of_val(self.rest.as_slice()) + size_of_val(self.lanes.as_slice())
    }
}

impl<T: Real> TearableKernel<T> for BentFacets<T> {
    /// Makes room for the edits that the exact form has room for. The kernel has its own constant data from then on.
    fn reserve(&mut self, _: usize) {
        let Some(followed) = &mut self.followed else {
            return;
        };
        let (triangles, rows, entries) = followed.exact.limits();
        let blocks = triangles.div_ceil(LANES);
        let from = &self.plan.blocks;
        let curved = if from.curved.is_empty() { 0 } else { blocks };
        let mut derivatives = self.plan.derivatives.clone();
        derivatives.make_room(rows, entries);
        // Each corner of each triangle may become a node of its own.
        let nodes = followed.rest.len().max(3 * triangles);
        let mut back = ScalarMatrix::default();
        back.make_room(nodes, entries);
        back.transpose(&derivatives, followed.rest.len());
        self.plan = Arc::new(Plan {
            count: self.plan.count,
            blocks: Blocks {
                nodes: with_room(&from.nodes, blocks),
                edges: with_room(&from.edges, blocks),
                rest: with_room(&from.rest, blocks),
                curved: with_room(&from.curved, curved),
            },
            derivatives,
            back,
        });
        make_room(&mut self.state, blocks);
        make_room(&mut self.theta, rows);
        make_room(&mut self.pull, rows);
        make_room(&mut followed.rest, nodes);
        make_room(&mut followed.lanes, triangles);
    }

    fn follow(&mut self, torn: &Torn<'_>) {
        let Some(followed) = &mut self.followed else {
            return;
        };
        // Only a kernel with constant data of its own has room.
        let Some(plan) = Arc::get_mut(&mut self.plan) else {
            return;
        };
        let Followed { exact, rest, lanes } = &mut **followed;
        for &touched in torn.surface.touched() {
            for node in torn.nodes(touched).map(|node| node as usize) {
                if node < rest.len() {
                    rest[node] = torn.rest[node];
                }
            }
        }
        rest.extend_from_slice(&torn.rest[rest.len().min(torn.rest.len())..]);
        exact.follow(torn, &|node| rest[node as usize]);
        while plan.derivatives.rows() < exact.rotations.rows() {
            let room = exact.rotations.room(plan.derivatives.rows());
            plan.derivatives.push_roomy(core::iter::empty(), room);
        }
        let Some(tear) = &exact.tear else { return };
        for &row in &tear.rows {
            let entries = exact.rotations.row(row as usize);
            let entries = entries.map(|(column, weight)| (column, T::of(weight)));
            plan.derivatives.set_row(row as usize, entries);
        }
        plan.back.transpose(&plan.derivatives, rest.len());
        self.theta.resize(plan.derivatives.rows(), [T::ZERO; 4]);
        self.pull.resize(plan.derivatives.rows(), [T::ZERO; 4]);
        while lanes.len() < exact.triangles.len() {
            let lane = lanes.len();
            if lane / LANES == plan.blocks.nodes.len() {
                plan.blocks.push_like_last();
                self.state.push(State::ZERO);
            }
            lanes.push(lane as u32);
        }
        plan.count = lanes.len();
        for &triangle in &tear.near {
            let triangle = triangle as usize;
            let lane = lanes[triangle] as usize;
            let one = AtRest::new(exact, triangle, rest);
            plan.blocks.set(lane, exact, triangle, &one);
        }
    }

    fn local_stiffness(
        &self,
        triangles: &[u32],
        d: &[Node<T>],
        add: &mut dyn FnMut(u32, u32, &Mat3),
    ) {
        let Some(followed) = &self.followed else {
            return;
        };
        let x = |node: u32| followed.rest[node as usize] + to_vec(&d[node as usize]);
        followed.exact.local_stiffness(triangles, x, add);
    }
}

impl<T: Real> Blocks<T> {
    /// Adds a block of copies of the last one without stiffness.
    fn push_like_last(&mut self) {
        let (Some(&nodes), Some(&edges)) = (self.nodes.last(), self.edges.last()) else {
            return;
        };
        self.nodes.push(nodes);
        self.edges.push(edges);
        if let Some(mut rest) = self.rest.last().cloned() {
            rest.weights = [[T::ZERO; LANES]; 9];
            self.rest.push(rest);
        }
        if let Some(mut curved) = self.curved.last().cloned() {
            curved.curvature = [[T::ZERO; LANES]; 3];
            self.curved.push(curved);
        }
    }

    /// Sets the constants of a triangle in a lane, counted over all blocks.
    fn set(&mut self, lane: usize, exact: &Bending, triangle: usize, one: &AtRest) {
        let (block, lane) = (lane / LANES, lane % LANES);
        let facet = &exact.facets[triangle];
        self.nodes[block][lane] = exact.triangles[triangle];
        // The slope at a border has no weight, so that any edge does there.
        let edge = |edge: u32| if edge == NONE { 0 } else { edge };
        self.edges[block][lane] = exact.sides[triangle].map(edge);
        let rest = &mut self.rest[block];
        for i in 0..3 {
            for k in 0..2 {
                rest.sides[3 * k + i][lane] = T::of(one.sides[k][i]);
                rest.along[2 * i + k][lane] = T::of(one.along[i][k]);
            }
            for e in 0..3 {
                rest.weights[3 * e + i][lane] = T::of(facet.weights[e][i]);
            }
        }
        // A sheet that was flat at rest stays so.
        if let Some(curved) = self.curved.get_mut(block) {
            let curvature = exact.rest_curvature(triangle);
            for i in 0..3 {
                curved.rise[i][lane] = T::of(one.rise[i]);
                curved.normal[i][lane] = T::of(one.normal[i]);
                curved.curvature[i][lane] = T::of(curvature[i]);
            }
        }
    }
}
