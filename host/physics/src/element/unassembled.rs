//! The kernel of triangles that have none for vector instructions, in a sheet that can tear: the stiffness of each
//! triangle by itself. An edit changes its triangles alone, while the pattern of a matrix would have to change.

use super::Torn;
use super::elements::Elements;
use super::kernel::{Counted, Kernel};
use super::torn::make_room;
use crate::cost::Cost;
use crate::lanes::block::{less, plus};
use crate::lanes::{Node, Real, add, to_node, to_vec};
use crate::linear::block_matrix::BlockMatrix;
use crate::material::Tangent;
use crate::{Mat3, Vec3};

/// The stiffness (N/m) by the displacements of the second and third node relative to the first: row by row.
type Local<T> = [[T; 6]; 6];

/// Triangles with their stiffness, one by one.
#[derive(Debug)]
pub(super) struct Unassembled<T> {
    elements: Box<dyn Elements>,
    nodes: Vec<[u32; 3]>,
    /// The latest stiffness of each triangle.
    local: Vec<Local<T>>,
    rest: Vec<Vec3>,
    x: Vec<Vec3>,
}

impl<T: Real> Unassembled<T> {
    /// A kernel of `elements`, which start at `rest` (m). `None` for elements of another kind than triangles.
    pub(super) fn new(elements: Box<dyn Elements>, rest: &[Vec3]) -> Option<Self> {
        let nodes = (0..elements.count()).map(|e| elements.nodes(e).try_into().ok());
        let nodes: Vec<[u32; 3]> = nodes.collect::<Option<_>>()?;
        Some(Self {
            local: vec![[[T::ZERO; 6]; 6]; nodes.len()],
            elements,
            nodes,
            rest: rest.to_vec(),
            x: rest.to_vec(),
        })
    }
}

impl<T: Real> Kernel<T> for Unassembled<T> {
    fn linearize(&mut self, d: &[Node<T>], force: &mut [Node<T>]) -> f64 {
        for ((x, rest), d) in self.x.iter_mut().zip(&self.rest).zip(d) {
            *x = rest + to_vec(d);
        }
        for (e, (nodes, local)) in self.nodes.iter().zip(&mut self.local).enumerate() {
            let at = nodes.map(|node| self.x[node as usize]);
            let Some(element) = self.elements.triangle(e, at, Tangent::Clipped) else {
                continue;
            };
            for (&node, f) in nodes.iter().zip(&element.force) {
                add(&mut force[node as usize], &to_node(f));
            }
            for (row, to) in local.iter_mut().enumerate() {
                let blocks = &element.stiffness[1 + row / 3];
                for (column, to) in to.iter_mut().enumerate() {
                    *to = T::of(blocks[1 + column / 3][(row % 3, column % 3)]);
                }
            }
        }
        self.elements.energy(&self.x)
    }

    fn product(&mut self, factor: T, u: &[Node<T>], y: &mut [Node<T>]) {
        for (nodes, local) in self.nodes.iter().zip(&self.local) {
            let [n0, n1, n2] = nodes.map(|node| node as usize);
            let (a, b) = (less(u[n1], u[n0]), less(u[n2], u[n0]));
            let u = [a[0], a[1], a[2], b[0], b[1], b[2]];
            let pull = |row: usize| {
                let mut sum = T::ZERO;
                for (k, u) in local[row].iter().zip(&u) {
                    sum += *k * *u;
                }
                factor * sum
            };
            let first = [pull(0), pull(1), pull(2), T::ZERO];
            let second = [pull(3), pull(4), pull(5), T::ZERO];
            y[n1] = plus(y[n1], first);
            y[n2] = plus(y[n2], second);
            // A translation gives no force, so the forces of a triangle sum to zero.
            y[n0] = less(y[n0], plus(first, second));
        }
    }

    fn add_to(&self, _: &mut BlockMatrix) {}

    fn bytes(&self) -> usize {
        self.elements.bytes()
            + size_of_val(self.nodes.as_slice())
            + size_of_val(self.local.as_slice())
            + size_of_val(self.rest.as_slice())
            + size_of_val(self.x.as_slice())
    }

    fn reserve(&mut self, triangles: usize) -> bool {
        let (elements, nodes) = (self.nodes.len() + triangles, self.rest.len());
        make_room(&mut self.nodes, elements);
        make_room(&mut self.local, elements);
        // Each corner of each triangle may become a node of its own.
        make_room(&mut self.rest, nodes.max(3 * elements));
        make_room(&mut self.x, nodes.max(3 * elements));
        self.elements.reserve(triangles)
    }

    fn follow(&mut self, torn: &Torn<'_>) {
        self.elements.follow(torn);
        for &touched in torn.surface.touched() {
            let (e, nodes) = (touched as usize, torn.nodes(touched));
            if e == self.nodes.len() {
                self.nodes.push(nodes);
                self.local.push([[T::ZERO; 6]; 6]);
            }
            self.nodes[e] = nodes;
            for node in nodes.map(|node| node as usize) {
                if node < self.rest.len() {
                    self.rest[node] = torn.rest[node];
                }
            }
        }
        let added = &torn.rest[self.rest.len().min(torn.rest.len())..];
        self.rest.extend_from_slice(added);
        self.x.extend_from_slice(added);
    }

    fn local_stiffness(
        &self,
        triangles: &[u32],
        d: &[Node<T>],
        add: &mut dyn FnMut(u32, u32, &Mat3),
    ) {
        for &triangle in triangles {
            let nodes = self.nodes[triangle as usize];
            let at = nodes.map(|node| self.rest[node as usize] + to_vec(&d[node as usize]));
            let found = (self.elements).triangle(triangle as usize, at, Tangent::Clipped);
            let Some(element) = found else { continue };
            for (&row, blocks) in nodes.iter().zip(&element.stiffness) {
                for (&column, block) in nodes.iter().zip(blocks) {
                    add(row, column, block);
                }
            }
        }
    }
}

impl<T> Counted for Unassembled<T> {
    fn linearize_cost(&self) -> Option<Cost> {
        None
    }

    fn product_cost(&self) -> Option<Cost> {
        // A product and a sum for each of the 36 numbers, the differences and the sums of forces.
        let count = self.nodes.len();
        let read = size_of_val(self.nodes.as_slice()) + size_of_val(self.local.as_slice());
        Some(Cost::read(read) + Cost::flops((72 + 6 + 6 + 12) * count))
    }
}
