//! The trees of the crates, each used as its documentation says for objects that move in every step.

use super::narrow::Things;
use super::{Method, boxes};
use bvh::bounding_hierarchy::BHShape;
use nalgebra::Point3;
use obvhs::bvh2::Bvh2;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use parry3d::bounding_volume::Aabb as OfParry;
use parry3d::partitioning::{Bvh as Tree, BvhBuildStrategy, BvhWorkspace};
use physics::Vec3;
use physics::contact::Pair;

type Boxes = Vec<[[f32; 3]; 2]>;

/// One tree over all triangles, which is traversed against itself.
pub(crate) struct Parry {
    tree: Tree,
    workspace: BvhWorkspace,
    boxes: Boxes,
}

impl Parry {
    pub(crate) fn new(_: &Things) -> Self {
        Self {
            tree: Tree::new(),
            workspace: BvhWorkspace::default(),
            boxes: Vec::new(),
        }
    }
}

fn of_parry([least, most]: [[f32; 3]; 2]) -> OfParry {
    OfParry::new(least.into(), most.into())
}

impl Method for Parry {
    fn name(&self) -> &'static str {
        "parry3d 0.31, Bvh"
    }

    fn build(&mut self, things: &Things, x: &[Vec3]) {
        boxes::of(things, x, &mut self.boxes);
        let boxes = self
            .boxes
            .iter()
            .map(|corners| of_parry(*corners))
            .enumerate();
        self.tree = Tree::from_iter(BvhBuildStrategy::Binned, boxes);
    }

    fn refit(&mut self, things: &Things, x: &[Vec3]) -> bool {
        boxes::of(things, x, &mut self.boxes);
        for (number, corners) in (0..).zip(&self.boxes) {
            self.tree
                .insert_or_update_partially(of_parry(*corners), number, 0.0);
        }
        self.tree.refit(&mut self.workspace);
        true
    }

    fn search(&mut self, things: &Things, x: &[Vec3], found: &mut Vec<Pair>) -> usize {
        let mut distances = 0;
        let mut meet = |a: u32, b: u32| {
            let (a, b) = (a.min(b), a.max(b));
            if things.may_touch(a, b) {
                distances += things.narrow(x, a, b, found);
            }
        };
        self.tree
            .traverse_bvtt_single_tree::<false>(&mut self.workspace, &mut meet);
        distances
    }
}

/// One tree over all triangles; the box of each triangle is a query.
pub(crate) struct Obvhs {
    tree: Bvh2,
    builder: PlocBuilder,
    boxes: Boxes,
    of_crate: Vec<obvhs::aabb::Aabb>,
}

impl Obvhs {
    pub(crate) fn new(_: &Things) -> Self {
        Self {
            tree: Bvh2::default(),
            builder: PlocBuilder::new(),
            boxes: Vec::new(),
            of_crate: Vec::new(),
        }
    }

    fn take(&mut self, things: &Things, x: &[Vec3]) {
        boxes::of(things, x, &mut self.boxes);
        self.of_crate.clear();
        let boxes = self.boxes.iter().map(|[least, most]| {
            let [least, most] = [least, most].map(|corner| glam::Vec3A::from_array(*corner));
            obvhs::aabb::Aabb::new(least, most)
        });
        self.of_crate.extend(boxes);
    }
}

impl Method for Obvhs {
    fn name(&self) -> &'static str {
        "obvhs 0.4, Bvh2"
    }

    fn build(&mut self, things: &Things, x: &[Vec3]) {
        self.take(things, x);
        let indices = (0_u32..)
            .zip(&self.of_crate)
            .map(|(number, _)| number)
            .collect();
        self.tree = self.builder.build(
            PlocSearchDistance::Minimum,
            &self.of_crate,
            indices,
            SortPrecision::U64,
            0,
        );
        self.tree.init_primitives_to_nodes_if_uninit();
        // A refit is three times faster in this order, says the crate.
        self.tree.reorder_in_stack_traversal_order();
        self.tree.update_primitives_to_nodes();
    }

    fn refit(&mut self, things: &Things, x: &[Vec3]) -> bool {
        self.take(things, x);
        for (number, bounds) in self.of_crate.iter().enumerate() {
            let node = self.tree.primitives_to_nodes[number] as usize;
            self.tree.nodes[node].set_aabb(*bounds);
        }
        self.tree.refit_all();
        true
    }

    fn search(&mut self, things: &Things, x: &[Vec3], found: &mut Vec<Pair>) -> usize {
        let mut distances = 0;
        for (a, bounds) in (0_u32..).zip(&self.of_crate) {
            self.tree.aabb_traverse(*bounds, |tree, node| {
                let node = &tree.nodes[node as usize];
                let first = node.first_index as usize;
                for b in &tree.primitive_indices[first..first + node.prim_count as usize] {
                    if things.may_touch(a, *b) {
                        distances += things.narrow(x, a, *b, found);
                    }
                }
                true
            });
        }
        distances
    }
}

/// A triangle of the crate `bvh`.
#[derive(Clone)]
struct Shape {
    number: u32,
    bounds: bvh::aabb::Aabb<f32, 3>,
    node: usize,
}

impl bvh::aabb::Bounded<f32, 3> for Shape {
    fn aabb(&self) -> bvh::aabb::Aabb<f32, 3> {
        self.bounds
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// One tree over all triangles, made anew in each step, because the crate has no refit; the box of each triangle is a query.
pub(crate) struct OfBvh {
    tree: bvh::bvh::Bvh<f32, 3>,
    shapes: Vec<Shape>,
    boxes: Boxes,
}

impl OfBvh {
    pub(crate) fn new(_: &Things) -> Self {
        Self {
            tree: bvh::bvh::Bvh::build::<Shape>(&mut []),
            shapes: Vec::new(),
            boxes: Vec::new(),
        }
    }
}

impl Method for OfBvh {
    fn name(&self) -> &'static str {
        "bvh 0.13, no refit"
    }

    fn build(&mut self, things: &Things, x: &[Vec3]) {
        boxes::of(things, x, &mut self.boxes);
        self.shapes.clear();
        let shapes = (0..).zip(&self.boxes).map(|(number, [least, most])| Shape {
            number,
            bounds: bvh::aabb::Aabb::with_bounds(Point3::from(*least), Point3::from(*most)),
            node: 0,
        });
        self.shapes.extend(shapes);
        self.tree = bvh::bvh::Bvh::build(&mut self.shapes);
    }

    fn refit(&mut self, _: &Things, _: &[Vec3]) -> bool {
        false
    }

    fn search(&mut self, things: &Things, x: &[Vec3], found: &mut Vec<Pair>) -> usize {
        let mut distances = 0;
        for (a, one) in (0_u32..).zip(&self.shapes) {
            for other in self.tree.traverse_iterator(&one.bounds, &self.shapes) {
                if things.may_touch(a, other.number) {
                    distances += things.narrow(x, a, other.number, found);
                }
            }
        }
        distances
    }
}
