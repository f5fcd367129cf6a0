//! The hierarchy of boxes over the surfaces, and its clusters.
//!
//! The elements of a part (its triangles, or the segments of a thread) are halved at the median of their centres along
//! the longest axis, down to leaves of [`LEAF`] elements. The highest boxes with at most [`CLUSTER`] elements are the
//! **clusters**; the lists of `lists` are kept per pair of clusters. A cluster has all vertices of its elements. Every
//! edge and every vertex has one home: the leaf of its first element, by which a pair of things has one pair of leaves.
//!
//! The tree is made once and **refitted** in each step: its boxes follow the vertices (van den Bergen, "Efficient
//! collision detection of complex deformable models using AABB trees", 1997).

use super::aabb::Aabb;
use super::surface::Surfaces;
use crate::Vec3;
use core::ops::Range;
use std::collections::BTreeMap;

/// Most elements of a leaf.
pub const LEAF: usize = 8;
/// Most elements of a cluster. A cluster of 64 triangles has about 45 vertices.
pub const CLUSTER: usize = 64;

/// The elements, edges and vertices of which a leaf is the home.
#[derive(Clone, Debug, Default)]
pub(super) struct Leaf {
    pub triangles: Range<usize>,
    pub edges: Range<usize>,
    pub vertices: Range<usize>,
    /// Contains the triangles and edges, and so the vertices.
    pub bounds: Aabb,
}

/// A cluster of a part.
#[derive(Clone, Debug)]
pub struct Cluster {
    /// The part.
    pub part: usize,
    /// The leaves below the cluster.
    pub(super) leaves: Range<usize>,
    /// Its vertices in [`Hierarchy::members`].
    pub(super) members: Range<usize>,
    /// The mean of its vertices, and the largest distance from it (m). Unlike a box, this sphere only turns with a rigid
    /// motion, so that such a motion brings no clusters near each other.
    pub centre: Vec3,
    /// See `centre`.
    pub extent: f64,
}

/// What a node of the upper tree has below it.
#[derive(Clone, Copy, Debug)]
enum Below {
    Cluster(usize),
    Nodes(usize, usize),
}

#[derive(Clone, Debug)]
struct Node {
    bounds: Aabb,
    below: Below,
}

/// The hierarchy over all parts.
#[derive(Clone, Debug, Default)]
pub struct Hierarchy {
    pub(super) triangles: Vec<u32>,
    pub(super) edges: Vec<u32>,
    pub(super) vertices: Vec<u32>,
    pub(super) leaves: Vec<Leaf>,
    /// The vertices of the clusters.
    pub(super) members: Vec<u32>,
    clusters: Vec<Cluster>,
    /// Children before their parents.
    nodes: Vec<Node>,
    /// The root of each part that has elements, with the number of the part.
    roots: Vec<(usize, usize)>,
}

/// An element while the tree is made.
#[derive(Clone, Copy)]
struct Element {
    centre: Vec3,
    corners: [u32; 3],
    number: u32,
    is_triangle: bool,
}

/// The edges and the vertices that have no home yet.
struct Homeless {
    edges: BTreeMap<[u32; 2], u32>,
    vertices: Vec<bool>,
}

impl Hierarchy {
    /// The hierarchy over `surfaces` at the positions `x` (m).
    pub fn new(surfaces: &Surfaces, x: &[Vec3]) -> Self {
        let mut all = Self::default();
        let mut homeless = Homeless::new(surfaces);
        for (number, part) in surfaces.parts.iter().enumerate() {
            let mut elements: Vec<Element> = Vec::new();
            for triangle in part.triangles.clone() {
                let corners = surfaces.triangles[triangle as usize];
                let sum: Vec3 = corners.iter().map(|v| x[*v as usize]).sum();
                elements.push(Element {
                    centre: sum / 3.0,
                    corners,
                    number: triangle,
                    is_triangle: true,
                });
            }
            if part.triangles.is_empty() {
                for edge in part.edges.clone() {
                    let [a, b] = surfaces.edges[edge as usize];
                    elements.push(Element {
                        centre: (x[a as usize] + x[b as usize]) / 2.0,
                        corners: [a, b, b],
                        number: edge,
                        is_triangle: false,
                    });
                }
            }
            if !elements.is_empty() {
                let root = all.divide(number, &mut elements, &mut homeless);
                all.roots.push((number, root));
            }
        }
        all.refit(surfaces, x);
        all.grow(&vec![0.0; all.clusters.len()]);
        all
    }

    /// Divides elements down to clusters. Returns the node over them.
    fn divide(&mut self, part: usize, elements: &mut [Element], homeless: &mut Homeless) -> usize {
        let below = if elements.len() <= CLUSTER {
            Below::Cluster(self.cluster(part, elements, homeless))
        } else {
            let (lower, upper) = halve(elements);
            let lower = self.divide(part, lower, homeless);
            Below::Nodes(lower, self.divide(part, upper, homeless))
        };
        self.nodes.push(Node {
            bounds: Aabb::EMPTY,
            below,
        });
        self.nodes.len() - 1
    }

    fn cluster(&mut self, part: usize, elements: &mut [Element], homeless: &mut Homeless) -> usize {
        let first = self.members.len();
        let mut corners: Vec<u32> = elements.iter().flat_map(|e| e.corners).collect();
        corners.sort_unstable();
        corners.dedup();
        self.members.extend(corners);
        let leaf = self.leaves.len();
        self.leave(elements, homeless);
        self.clusters.push(Cluster {
            part,
            leaves: leaf..self.leaves.len(),
            members: first..self.members.len(),
            centre: Vec3::zeros(),
            extent: 0.0,
        });
        self.clusters.len() - 1
    }

    /// Divides elements down to leaves.
    fn leave(&mut self, elements: &mut [Element], homeless: &mut Homeless) {
        if elements.len() > LEAF {
            let (lower, upper) = halve(elements);
            self.leave(lower, homeless);
            self.leave(upper, homeless);
            return;
        }
        let (triangle, edge, vertex) =
            (self.triangles.len(), self.edges.len(), self.vertices.len());
        for element in elements.iter() {
            if element.is_triangle {
                self.triangles.push(element.number);
            }
            homeless.house(element.corners, &mut self.edges, &mut self.vertices);
        }
        self.leaves.push(Leaf {
            triangles: triangle..self.triangles.len(),
            edges: edge..self.edges.len(),
            vertices: vertex..self.vertices.len(),
            bounds: Aabb::EMPTY,
        });
    }

    /// The clusters.
    pub fn clusters(&self) -> &[Cluster] {
        &self.clusters
    }

    /// Calls `found` for each facet of a cluster of this number: a triangle, or a segment of a thread with its second end twice.
    pub(crate) fn each_facet(
        &self,
        surfaces: &Surfaces,
        cluster: usize,
        found: &mut dyn FnMut([u32; 3]),
    ) {
        let cluster = &self.clusters[cluster];
        let is_thread = surfaces.parts[cluster.part].triangles.is_empty();
        for leaf in &self.leaves[cluster.leaves.clone()] {
            for triangle in &self.triangles[leaf.triangles.clone()] {
                found(surfaces.triangles[*triangle as usize]);
            }
            for edge in self.edges[leaf.edges.clone()].iter().filter(|_| is_thread) {
                let [a, b] = surfaces.edges[*edge as usize];
                found([a, b, b]);
            }
        }
    }

    /// The vertices of a cluster.
    pub fn members(&self, cluster: usize) -> &[u32] {
        &self.members[self.clusters[cluster].members.clone()]
    }

    /// Has the boxes follow the vertices.
    pub fn refit(&mut self, surfaces: &Surfaces, x: &[Vec3]) {
        for leaf in &mut self.leaves {
            let mut bounds = Aabb::EMPTY;
            for triangle in &self.triangles[leaf.triangles.clone()] {
                for vertex in surfaces.triangles[*triangle as usize] {
                    bounds.add(&x[vertex as usize]);
                }
            }
            for edge in &self.edges[leaf.edges.clone()] {
                for vertex in surfaces.edges[*edge as usize] {
                    bounds.add(&x[vertex as usize]);
                }
            }
            leaf.bounds = bounds;
        }
        for cluster in &mut self.clusters {
            let members = &self.members[cluster.members.clone()];
            let sum: Vec3 = members.iter().map(|vertex| x[*vertex as usize]).sum();
            cluster.centre = sum / members.len() as f64;
            let apart = |vertex: &u32| (x[*vertex as usize] - cluster.centre).norm_squared();
            cluster.extent = members.iter().map(apart).fold(0.0, f64::max).sqrt();
        }
    }

    /// Has [`near`](Self::near) test the spheres of the clusters grown by `by` (m), one number each.
    pub fn grow(&mut self, by: &[f64]) {
        for number in 0..self.nodes.len() {
            self.nodes[number].bounds = match self.nodes[number].below {
                Below::Cluster(cluster) => {
                    let Cluster { centre, extent, .. } = self.clusters[cluster];
                    Aabb::of([&centre]).grown(extent + by[cluster])
                }
                Below::Nodes(a, b) => self.nodes[a].bounds.union(&self.nodes[b].bounds),
            };
        }
    }

    /// Calls `found` for each pair of clusters whose grown spheres overlap and whose parts may touch, once each, in an
    /// order that depends on the spheres alone. The first of the two has the smaller number or is of an earlier part.
    pub fn near(&self, surfaces: &Surfaces, found: &mut dyn FnMut(usize, usize)) {
        for (i, (part, root)) in self.roots.iter().enumerate() {
            if surfaces.may_touch(*part, *part) {
                self.within(*root, found);
            }
            for (other_part, other) in &self.roots[i + 1..] {
                if surfaces.may_touch(*part, *other_part) {
                    self.between(*root, *other, found);
                }
            }
        }
    }

    fn within(&self, node: usize, found: &mut dyn FnMut(usize, usize)) {
        match self.nodes[node].below {
            Below::Cluster(cluster) => found(cluster, cluster),
            Below::Nodes(a, b) => {
                self.within(a, found);
                self.within(b, found);
                self.between(a, b, found);
            }
        }
    }

    fn between(&self, one: usize, other: usize, found: &mut dyn FnMut(usize, usize)) {
        let (first, second) = (&self.nodes[one], &self.nodes[other]);
        if !first.bounds.overlaps(&second.bounds) {
            return;
        }
        match (first.below, second.below) {
            (Below::Cluster(a), Below::Cluster(b)) => found(a, b),
            (Below::Nodes(a, b), Below::Cluster(_)) => {
                self.between(a, other, found);
                self.between(b, other, found);
            }
            (Below::Cluster(_), Below::Nodes(a, b)) => {
                self.between(one, a, found);
                self.between(one, b, found);
            }
            (Below::Nodes(a, b), Below::Nodes(c, d)) => {
                // The larger box is divided.
                if first.bounds.half_area() >= second.bounds.half_area() {
                    self.between(a, other, found);
                    self.between(b, other, found);
                } else {
                    self.between(one, c, found);
                    self.between(one, d, found);
                }
            }
        }
    }
}

/// The two halves of elements along the longest axis of their centres.
fn halve(elements: &mut [Element]) -> (&mut [Element], &mut [Element]) {
    let bounds = elements.iter().fold(Aabb::EMPTY, |mut all, element| {
        all.add(&element.centre);
        all
    });
    let axis = bounds.longest_axis();
    let middle = elements.len() / 2;
    elements.select_nth_unstable_by(middle, |a, b| {
        let order = a.centre[axis].total_cmp(&b.centre[axis]);
        order.then(a.number.cmp(&b.number))
    });
    elements.split_at_mut(middle)
}

impl Homeless {
    fn new(surfaces: &Surfaces) -> Self {
        Self {
            edges: (surfaces.edges.iter().copied()).zip(0..).collect(),
            vertices: vec![true; surfaces.vertices],
        }
    }

    /// Gives the corners of an element, and the edges between them, a home unless they have one.
    fn house(&mut self, corners: [u32; 3], edges: &mut Vec<u32>, vertices: &mut Vec<u32>) {
        let [a, b, c] = corners;
        for vertex in corners {
            if core::mem::take(&mut self.vertices[vertex as usize]) {
                vertices.push(vertex);
            }
        }
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let ends = [from.min(to), from.max(to)];
            edges.extend(self.edges.remove(&ends));
        }
    }
}
