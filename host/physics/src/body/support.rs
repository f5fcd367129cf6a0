//! Supports: vertices whose motion is prescribed along some of the world axes and free along the others.
//!
//! A handle holds its vertices along all three axes and rotates them with its pose. A support guides vertices: a face
//! that may slide, a plane of symmetry, a prescribed displacement. Guided nodes count as free nodes; the
//! solvers leave out the guided axes (the filter of Baraff and Witkin, "Large steps in cloth simulation", 1998).

use super::border::{self, Border, Clamp};
use crate::Vec3;
use crate::error::BodyError;

/// The specification of a support.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SupportSpec {
    /// Vertices of the mesh, at least one, none of which a handle holds.
    pub vertices: Vec<u32>,
    /// The world axes along which the support guides its vertices; a clamp has all of them.
    pub axes: [bool; 3],
    /// Whether a sheet that bends turns freely about the edges of its border that the support holds.
    pub border: Border,
}

/// One support: its nodes, axes and displacement, and the force that it gave.
#[derive(Clone, Debug)]
pub(crate) struct Support {
    /// Its vertices, then the ghosts of its clamps.
    nodes: Vec<u32>,
    pub(super) clamps: Vec<Clamp>,
    axes: [bool; 3],
    /// Positions of the nodes when the support was added (m).
    base: Vec<Vec3>,
    /// Displacement from `base` (m); only the guided axes count.
    pub(crate) displacement: Vec3,
    /// Force of the support on the body in the last solve (N).
    pub(crate) reaction: Vec3,
}

/// All supports of a body. The vectors are empty if there are none.
#[derive(Clone, Debug, Default)]
pub(crate) struct Supports {
    pub(crate) list: Vec<Support>,
    /// By node and axis: 0 if a support guides the axis, 1 elsewhere.
    mask: Vec<Vec3>,
    /// By node and axis: the support that guides the axis, counted from 1; 0 for none.
    owner: Vec<[u16; 3]>,
    /// Guided nodes, in ascending order.
    guided: Vec<u32>,
    /// Guided positions without displacements, each axis from the support that guides it (m).
    rest: Vec<Vec3>,
}

impl Supports {
    /// Memory of the supports (bytes).
    pub(crate) fn bytes(&self) -> usize {
        let own = |support: &Support| {
            size_of_val(support.nodes.as_slice())
                + size_of_val(support.clamps.as_slice())
                + size_of_val(support.base.as_slice())
        };
        size_of_val(self.list.as_slice())
            + self.list.iter().map(own).sum::<usize>()
            + size_of_val(self.mask.as_slice())
            + size_of_val(self.owner.as_slice())
            + size_of_val(self.guided.as_slice())
            + size_of_val(self.rest.as_slice())
    }

    /// Adds a support of nodes that no handle holds, and of `clamps`, at their present positions `x` (m). If several
    /// supports guide the same axis of a node, the latest of them applies. The support has still to be
    /// [laid](border::lay).
    pub(crate) fn add(
        &mut self,
        nodes: &[u32],
        axes: [bool; 3],
        clamps: Vec<Clamp>,
        x: &[Vec3],
    ) -> Result<usize, BodyError> {
        let support = self.list.len();
        let fail = |found| Err(BodyError::Support { support, found });
        if nodes.is_empty() {
            return fail("it has no vertices");
        }
        if axes == [false; 3] {
            return fail("it guides no axis");
        }
        if support >= usize::from(u16::MAX) {
            return fail("there are too many supports");
        }
        let ghosts = clamps.iter().map(|clamp| clamp.ghost);
        let base = nodes.iter().map(|&node| x[node as usize]);
        self.list.push(Support {
            nodes: nodes.iter().copied().chain(ghosts).collect(),
            axes,
            base: base
                .chain(clamps.iter().map(|clamp| clamp.extend(x)))
                .collect(),
            clamps,
            displacement: Vec3::zeros(),
            reaction: Vec3::zeros(),
        });
        Ok(support)
    }

    /// Makes a support guide its vertices at their present positions `x` (m), without displacement.
    pub(crate) fn settle(&mut self, support: usize, x: &[Vec3]) {
        let entry = &mut self.list[support];
        for (base, &node) in entry.base.iter_mut().zip(&entry.nodes) {
            *base = x[node as usize];
        }
        entry.displacement = Vec3::zeros();
        self.lay_out(self.mask.len());
    }

    /// Removes a support. The others have to be [laid](border::lay) again.
    pub(crate) fn lift(&mut self, support: usize) {
        self.list.remove(support);
    }

    /// Gives the ghosts the numbers from `next` on.
    pub(super) fn number_ghosts(&mut self, next: &mut u32) {
        for support in &mut self.list {
            border::number(&mut support.nodes, &mut support.clamps, next);
        }
    }

    /// The support that guides a node along some axis.
    pub(crate) fn owner_of(&self, node: u32) -> Option<usize> {
        let owners = self.owner.get(node as usize)?;
        let owner = owners.iter().find(|&&owner| owner > 0)?;
        Some(usize::from(*owner) - 1)
    }

    /// Finds the support of each axis of `count` nodes.
    pub(super) fn lay_out(&mut self, count: usize) {
        let count = if self.list.is_empty() { 0 } else { count };
        self.mask = vec![Vec3::repeat(1.0); count];
        self.owner = vec![[0; 3]; count];
        let mut base = vec![Vec3::zeros(); count];
        for (support, entry) in self.list.iter().enumerate() {
            for (&node, at) in entry.nodes.iter().zip(&entry.base) {
                for axis in 0..3 {
                    if entry.axes[axis] {
                        self.mask[node as usize][axis] = 0.0;
                        self.owner[node as usize][axis] = support as u16 + 1;
                        base[node as usize][axis] = at[axis];
                    }
                }
            }
        }
        self.guided = (0..count as u32)
            .filter(|&node| self.owner[node as usize] != [0; 3])
            .collect();
        let guided = self.guided.iter().map(|&node| base[node as usize]);
        self.rest = guided.collect();
    }

    /// Makes room for `nodes` more nodes, which [`push`](Self::push) adds.
    pub(crate) fn reserve(&mut self, nodes: usize) {
        for support in &mut self.list {
            support.nodes.reserve(nodes);
            support.base.reserve(nodes);
        }
        self.mask.reserve(nodes);
        self.owner.reserve(nodes);
        self.guided.reserve(nodes);
        self.rest.reserve(nodes);
    }

    /// Adds a node that lies between two `ends`, the fraction `at` of the way from the first to the second; a copy of a
    /// node has this node as both ends. A support guides the node along the axes along which it guides both ends. This
    /// does not allocate within the room that was reserved.
    pub(crate) fn push(&mut self, ends: [u32; 2], at: f64) {
        if self.list.is_empty() {
            return;
        }
        let node = self.mask.len() as u32;
        let [a, b] = ends.map(|end| end as usize);
        let (mut mask, mut owner, mut base) = (Vec3::repeat(1.0), [0; 3], Vec3::zeros());
        let of = |node: usize| self.guided.binary_search(&(node as u32));
        if let (Ok(first), Ok(second)) = (of(a), of(b)) {
            let between = self.rest[first] + (self.rest[second] - self.rest[first]) * at;
            for axis in 0..3 {
                let guide = self.owner[a][axis];
                if guide > 0 && guide == self.owner[b][axis] {
                    (mask[axis], owner[axis], base[axis]) = (0.0, guide, between[axis]);
                }
            }
        }
        self.mask.push(mask);
        self.owner.push(owner);
        if owner == [0; 3] {
            return;
        }
        // New nodes have the largest numbers, so the list stays ascending.
        self.guided.push(node);
        self.rest.push(base);
        for (number, support) in self.list.iter_mut().enumerate() {
            if owner.contains(&(number as u16 + 1)) {
                support.nodes.push(node);
                support.base.push(base);
            }
        }
    }

    /// Moves the guided place of a node that moved at rest to the same point between the guided places of three other
    /// nodes. An axis along which the support does not guide all of them keeps its place.
    pub(crate) fn shift(&mut self, node: u32, corners: [u32; 3], weights: [f64; 3]) {
        let of = |node: u32| self.guided.binary_search(&node).ok();
        let (Some(at), [Some(a), Some(b), Some(c)]) = (of(node), corners.map(of)) else {
            return;
        };
        let place =
            self.rest[a] * weights[0] + self.rest[b] * weights[1] + self.rest[c] * weights[2];
        for axis in 0..3 {
            let guide = self.owner[node as usize][axis];
            if corners
                .iter()
                .all(|&corner| self.owner[corner as usize][axis] == guide)
            {
                self.rest[at][axis] = place[axis];
            }
        }
    }

    /// By node and axis: 0 if a support guides the axis, 1 elsewhere; `None` without supports.
    pub(crate) fn mask(&self) -> Option<&[Vec3]> {
        (!self.mask.is_empty()).then_some(&self.mask)
    }

    /// Sets the guided components of `u` to `fraction` of the displacement from `x` to the guided positions.
    pub(crate) fn prescribe(&self, x: &[Vec3], fraction: f64, u: &mut [Vec3]) {
        for (&node, rest) in self.guided.iter().zip(&self.rest) {
            let node = node as usize;
            for axis in 0..3 {
                let owner = self.owner[node][axis];
                if owner > 0 {
                    let support = &self.list[usize::from(owner) - 1];
                    let displacement = rest[axis] + support.displacement[axis] - x[node][axis];
                    u[node][axis] = displacement * fraction;
                }
            }
        }
    }

    /// Sets the guided components of `u` to the displacement from `x` to `places`, by node.
    pub(crate) fn prescribe_to(&self, x: &[Vec3], places: &[Vec3], u: &mut [Vec3]) {
        for &node in &self.guided {
            let node = node as usize;
            let guided = Vec3::repeat(1.0) - self.mask[node];
            u[node] = (places[node] - x[node]).component_mul(&guided);
        }
    }

    /// An upper bound of the work (J) of the supports, for a `force` on each node and its displacement `moved`.
    pub(crate) fn work(&self, force: impl Fn(usize) -> Vec3, moved: impl Fn(usize) -> Vec3) -> f64 {
        let nodes = self.guided.iter().map(|&node| node as usize);
        nodes
            .map(|node| {
                let guided = Vec3::repeat(1.0) - self.mask[node];
                let work = force(node).component_mul(&moved(node)).abs();
                work.dot(&guided)
            })
            .sum()
    }

    /// Sums the forces of the supports from the imbalance of each guided node.
    pub(crate) fn collect_reactions(&mut self, imbalance: impl Fn(usize) -> Vec3) {
        for support in &mut self.list {
            support.reaction = Vec3::zeros();
        }
        for &node in &self.guided {
            let node = node as usize;
            let force = imbalance(node);
            for axis in 0..3 {
                let owner = self.owner[node][axis];
                if owner > 0 {
                    self.list[usize::from(owner) - 1].reaction[axis] += force[axis];
                }
            }
        }
    }
}
