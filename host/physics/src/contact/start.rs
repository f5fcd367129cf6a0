//! What keeps surfaces from beginning a run: parts that cross, lie inside each other, or are too thin.
//!
//! An edge that passes through a triangle crosses it ([`passes`]). What crosses nothing lies inside a closed part if its
//! first vertex does: the winding number of a closed surface about a point inside is one (Jacobson, Kavan and
//! Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding numbers", 2013; the solid angle by van
//! Oosterom and Strackee, 1983). The distance to a shape is convex, so its tangents bound its least value on a triangle
//! from below, and nested searches find it.

use super::aabb::Aabb;
use super::crossing::passes;
use super::hierarchy::{Hierarchy, Leaf};
use super::obstacle::Obstacle;
use super::pair::Pair;
use super::search::Search;
use super::surface::Surfaces;
use crate::Vec3;
use std::collections::BTreeMap;

/// Steps of a search for the least distance: each keeps two thirds of a range.
const STEPS: usize = 40;
/// The winding number above which a vertex is inside: a vertex on a flat face of the closed part has a half.
const INSIDE: f64 = 0.9;
/// The cosine below which two normals point to opposite sides.
const OPPOSITE: f64 = -0.5;

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// An edge of a part passes through a triangle of another part, or of its own.
    Crossed {
        /// The parts, ascending.
        parts: [usize; 2],
        /// Where (m).
        at: Vec3,
    },
    /// A part lies inside a closed one.
    Inside {
        /// The part that lies inside.
        part: usize,
        /// The closed part.
        of: usize,
        /// A vertex that lies inside (m).
        at: Vec3,
    },
    /// Two places of a part are nearer to each other than the distance at which the part touches.
    Thin {
        /// The part.
        part: usize,
        /// Where (m).
        at: Vec3,
        /// How far the places are apart (m).
        apart: f64,
    },
}

/// How the parts touch.
pub struct Touching<'a> {
    /// The distance (m) at which two parts touch, or a part itself; `None` for those that do not touch. It is symmetric.
    pub distance: &'a dyn Fn(usize, usize) -> Option<f64>,
    /// For each closed part, the distance (m) that must lie between its walls; `None` for another part.
    pub walls: &'a [Option<f64>],
}

/// The first fault of each pair of parts at the positions `x` (m), in the order of the parts. A part is searched for faults
/// of its own if it [touches itself](super::Part::touches_itself).
pub fn faults(surfaces: &Surfaces, x: &[Vec3], touching: &Touching<'_>) -> Vec<Fault> {
    let count = surfaces.parts.len();
    let mut hierarchy = Hierarchy::new(surfaces, x);
    let all = (0..count).flat_map(|p| (p..count).map(move |q| [p, q]));
    let distances = all.filter_map(|[p, q]| (touching.distance)(p, q));
    let walls = touching.walls.iter().flatten().copied();
    let farthest = distances.chain(walls).fold(0.0, f64::max);
    hierarchy.grow(&vec![farthest; hierarchy.clusters().len()]);
    let start = Start {
        surfaces,
        hierarchy: &hierarchy,
        x,
        normals: normals(surfaces, x),
        places: places(x),
        touching,
    };
    let mut near = Vec::new();
    hierarchy.near(surfaces, &mut |a, b| near.push([a, b]));
    let mut found: Vec<([usize; 2], Fault)> = Vec::new();
    for [a, b] in near {
        let parts = [a, b].map(|cluster| hierarchy.clusters()[cluster].part);
        let is_known = found.iter().any(|(pair, _)| *pair == parts);
        if let Some(fault) = (!is_known).then(|| start.between(a, b, parts)).flatten() {
            found.push((parts, fault));
        }
    }
    for of in 0..count {
        if touching.walls[of].is_none() {
            continue;
        }
        for part in 0..count {
            let pair = [part.min(of), part.max(of)];
            let is_known = found.iter().any(|(parts, _)| *parts == pair);
            let touches = part != of && (touching.distance)(part, of).is_some();
            if let Some(at) = (touches && !is_known)
                .then(|| start.inside(part, of))
                .flatten()
            {
                found.push((pair, Fault::Inside { part, of, at }));
            }
        }
    }
    found.sort_by_key(|(parts, _)| *parts);
    found.into_iter().map(|(_, fault)| fault).collect()
}

struct Start<'a> {
    surfaces: &'a Surfaces,
    hierarchy: &'a Hierarchy,
    x: &'a [Vec3],
    /// The sum of the normals of each vertex's triangles, by area.
    normals: Vec<Vec3>,
    /// For each vertex, the first one at its place. The two lips of a notch lie on each other, and no edge crosses there.
    places: Vec<u32>,
    touching: &'a Touching<'a>,
}

impl Start<'_> {
    /// The first fault between two clusters.
    fn between(&self, a: usize, b: usize, parts: [usize; 2]) -> Option<Fault> {
        let [one, other] = parts;
        let distance = (self.touching.distance)(one, other);
        if distance.is_some()
            && let Some(at) = self.crossed(a, b)
        {
            return Some(Fault::Crossed { parts, at });
        }
        if one != other {
            return None;
        }
        let walls = self.touching.walls[one];
        let radius = distance.into_iter().chain(walls).fold(0.0, f64::max);
        let search = Search {
            surfaces: self.surfaces,
            hierarchy: self.hierarchy,
            x: self.x,
            radius,
        };
        let mut thin = None;
        search.clusters(a, b, &mut |pair, apart| {
            let touches = distance.is_some_and(|distance| apart < distance);
            let is_thin = walls.is_some_and(|walls| apart < walls) && self.is_opposite(pair);
            if thin.is_none() && (touches || is_thin) && !self.is_joined(pair) {
                let at = self.x[pair.vertices(self.surfaces)[0] as usize];
                thin = Some(Fault::Thin {
                    part: one,
                    at,
                    apart,
                });
            }
        });
        thin
    }

    /// Whether some of the one vertices lie where some of the others do.
    fn share_a_place(&self, ones: &[u32], others: &[u32]) -> bool {
        let place = |vertex: &u32| self.places[*vertex as usize];
        let mut ones = ones.iter();
        ones.any(|one| others.iter().any(|other| place(one) == place(other)))
    }

    fn is_joined(&self, pair: Pair) -> bool {
        let vertices = pair.vertices(self.surfaces);
        let (first, second) = vertices.split_at(pair.split());
        self.share_a_place(first, second)
    }

    /// Whether the triangle of a pair is the wall opposite to its vertex, with the volume between them.
    fn is_opposite(&self, pair: Pair) -> bool {
        let Pair::VertexTriangle(vertex, triangle) = pair else {
            return false;
        };
        let outwards = self.normals[vertex as usize];
        let normal = normal(self.surfaces.triangles[triangle as usize], self.x);
        let inwards = pair.foot(self.surfaces, self.x).apart.dot(&outwards) > 0.0;
        inwards && normal.dot(&outwards) < OPPOSITE * normal.norm() * outwards.norm()
    }

    /// A place where an edge of one of two clusters passes through a triangle of the other one.
    fn crossed(&self, a: usize, b: usize) -> Option<Vec3> {
        let leaves = |cluster: usize| {
            let range = self.hierarchy.clusters()[cluster].leaves.clone();
            self.hierarchy.leaves[range].iter()
        };
        let mut pairs = leaves(a).flat_map(|one| leaves(b).map(move |other| (one, other)));
        pairs.find_map(|(one, other)| {
            let is_near = one.bounds.overlaps(&other.bounds);
            let through = || {
                self.through(one, other)
                    .or_else(|| self.through(other, one))
            };
            is_near.then(through).flatten()
        })
    }

    /// A place where an edge of one leaf passes through a triangle of another one.
    fn through(&self, of_edges: &Leaf, of_triangles: &Leaf) -> Option<Vec3> {
        let (surfaces, x) = (self.surfaces, self.x);
        for edge in &self.hierarchy.edges[of_edges.edges.clone()] {
            let ends = surfaces.edges[*edge as usize];
            let [p, q] = ends.map(|v| &x[v as usize]);
            let bounds = Aabb::of([p, q]);
            if !bounds.overlaps(&of_triangles.bounds) {
                continue;
            }
            for triangle in &self.hierarchy.triangles[of_triangles.triangles.clone()] {
                let corners = surfaces.triangles[*triangle as usize];
                if self.share_a_place(&ends, &corners) {
                    continue;
                }
                let [a, b, c] = corners.map(|v| &x[v as usize]);
                if bounds.overlaps(&Aabb::of([a, b, c])) && passes([p, q], [a, b, c]) {
                    let normal = (b - a).cross(&(c - a));
                    let (from, to) = (normal.dot(&(p - a)), normal.dot(&(q - a)));
                    // Rounding may hide a crossing that exact signs show.
                    let part = from / (from - to);
                    let part = if part.is_finite() { part } else { 0.5 };
                    return Some(p + (q - p) * part.clamp(0.0, 1.0));
                }
            }
        }
        None
    }

    /// A vertex of a part that lies inside a closed part, if no two of their triangles cross.
    fn inside(&self, part: usize, of: usize) -> Option<Vec3> {
        let range = self.surfaces.parts[of].triangles.clone();
        let triangles = &self.surfaces.triangles[range.start as usize..range.end as usize];
        let firsts = firsts(self.surfaces, part).into_iter();
        let mut points = firsts.map(|vertex| self.x[vertex as usize]);
        points.find(|point| winding(triangles, self.x, point) > INSIDE)
    }
}

/// One vertex of each piece of a part, ascending.
fn firsts(surfaces: &Surfaces, part: usize) -> Vec<u32> {
    let part = &surfaces.parts[part];
    let first = part.vertices.start;
    // By vertex, a vertex before it in its piece, or itself; `None` for a vertex without an edge.
    let mut leaders: Vec<Option<usize>> = vec![None; part.vertices.len()];
    for edge in part.edges.clone() {
        let ends = surfaces.edges[edge as usize].map(|vertex| (vertex - first) as usize);
        let [a, b] = ends.map(|vertex| lead(&mut leaders, vertex));
        leaders[a.max(b)] = Some(a.min(b));
        leaders[a.min(b)] = Some(a.min(b));
    }
    let each = leaders.iter().zip(part.vertices.clone());
    let leads = |(leader, vertex): (&Option<usize>, u32)| {
        (*leader == Some((vertex - first) as usize)).then_some(vertex)
    };
    each.filter_map(leads).collect()
}

/// The first vertex of the piece of a vertex. The path to it is halved.
fn lead(leaders: &mut [Option<usize>], mut vertex: usize) -> usize {
    while let Some(above) = leaders[vertex].filter(|above| *above != vertex) {
        leaders[vertex] = leaders[above];
        vertex = above;
    }
    vertex
}

/// The normal of a triangle, twice as long as its area (m²).
fn normal(corners: [u32; 3], x: &[Vec3]) -> Vec3 {
    let [a, b, c] = corners.map(|v| x[v as usize]);
    (b - a).cross(&(c - a))
}

/// For each vertex, the first one at its place.
fn places(x: &[Vec3]) -> Vec<u32> {
    let mut firsts = BTreeMap::new();
    let each = x.iter().zip(0..);
    // The sum has no negative zero.
    each.map(|(x, vertex)| {
        let place: [u64; 3] = x.map(|x| (x + 0.0).to_bits()).into();
        *firsts.entry(place).or_insert(vertex)
    })
    .collect()
}

fn normals(surfaces: &Surfaces, x: &[Vec3]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::zeros(); x.len()];
    for corners in &surfaces.triangles {
        let normal = normal(*corners, x);
        for vertex in corners {
            normals[*vertex as usize] += normal;
        }
    }
    normals
}

/// How often a closed surface encloses a point: 1 inside, 0 outside.
pub fn winding(triangles: &[[u32; 3]], x: &[Vec3], point: &Vec3) -> f64 {
    let angle = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|v| x[v as usize] - point);
        let [la, lb, lc] = [a.norm(), b.norm(), c.norm()];
        let below = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
        2.0 * libm::atan2(a.dot(&b.cross(&c)), below)
    };
    triangles.iter().map(angle).sum::<f64>() / (4.0 * core::f64::consts::PI)
}

/// The least signed distance (m) of the points of a triangle, or of an edge with one end twice, from a shape at time `t`
/// (s), and the point; `None` if the distance is nowhere below `below` (m), and for an obstacle that is a mesh.
pub fn deepest(
    obstacle: &Obstacle,
    corners: [&Vec3; 3],
    t: f64,
    below: f64,
) -> Option<(f64, Vec3)> {
    let [a, b, c] = corners;
    let (mut lower, mut upper) = (f64::NEG_INFINITY, (f64::INFINITY, *a));
    for at in [*a, *b, *c, (a + b + c) / 3.0] {
        let near = obstacle.nearest(&at, t)?;
        // A convex function lies above its tangents, which are least at corners.
        let tangents = corners.map(|corner| near.distance + near.normal.dot(&(corner - at)));
        lower = tangents
            .into_iter()
            .fold(f64::INFINITY, f64::min)
            .max(lower);
        if near.distance < upper.0 {
            upper = (near.distance, at);
        }
    }
    if lower >= below {
        return None;
    }
    if lower >= upper.0 {
        return Some(upper);
    }
    let at = |u: f64, v: f64| a + (b - a) * u + (c - b) * (u * v);
    let distance = |u: f64, v: f64| {
        let near = obstacle.nearest(&at(u, v), t);
        near.map_or(f64::INFINITY, |near| near.distance)
    };
    let along = |u: f64| least(&|v| distance(u, v));
    let (u, _) = least(&|u| along(u).1);
    let (v, distance) = along(u);
    (distance < below).then(|| (distance, at(u, v)))
}

/// Where from 0 to 1 a convex function is least, and its value there.
fn least(of: &dyn Fn(f64) -> f64) -> (f64, f64) {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..STEPS {
        let third = (high - low) / 3.0;
        if of(low + third) <= of(high - third) {
            high -= third;
        } else {
            low += third;
        }
    }
    // The ends are exact: most contacts begin at a vertex.
    let middle = 0.5 * (low + high);
    let places = [0.0, 1.0, middle].map(|place| (place, of(place)));
    let nearer = |best: (f64, f64), other: (f64, f64)| if other.1 < best.1 { other } else { best };
    places.into_iter().fold((0.0, f64::INFINITY), nearer)
}

#[cfg(test)]
mod tests {
    use super::super::Skin;
    use super::super::obstacle::{Geometry, Motion};
    use super::super::shape::Shape;
    use super::*;
    use crate::mesh::generate::{Pattern, sheet};
    use crate::mesh::generate_box::solid_box;
    use crate::mesh::{Mesh, TetMesh, TriMesh};

    fn cube(side: f64) -> TetMesh {
        solid_box([side; 3], [2, 2, 2]).expect("a box")
    }

    fn plane() -> TriMesh {
        sheet(1.0, 1.0, 4, 4, Pattern::Regular).expect("a sheet")
    }

    /// The faults of meshes, each moved; the last number is the distance at which all touch.
    fn found(meshes: &[(Mesh, Vec3)], distance: f64, itself: bool) -> Vec<Fault> {
        let mut surfaces = Surfaces::default();
        let (mut x, mut walls) = (Vec::new(), Vec::new());
        for (mesh, by) in meshes {
            let skin = Skin {
                radius: 0.5 * distance,
                touches_itself: true,
                is_obstacle: false,
            };
            surfaces.add(mesh, skin).expect("a surface");
            x.extend(mesh.positions().iter().map(|p| p + by));
            walls.push(matches!(mesh, Mesh::Solid(_)).then_some(distance));
        }
        let distance = |p: usize, q: usize| (p != q || itself).then_some(distance);
        let touching = Touching {
            distance: &distance,
            walls: &walls,
        };
        faults(&surfaces, &x, &touching)
    }

    #[test]
    fn parts_that_cross_or_lie_inside_are_found_and_those_apart_are_not() {
        let pair = |a: Mesh, b: Mesh, by: Vec3| found(&[(a, Vec3::zeros()), (b, by)], 0.01, false);
        let solid = |side: f64| Mesh::Solid(cube(side));
        let crossed = pair(solid(1.0), solid(1.0), Vec3::new(0.91, 0.03, 0.02));
        assert!(
            matches!(crossed[..], [Fault::Crossed { parts: [0, 1], at }] if at.x > 0.4 && at.x < 0.51),
            "{crossed:?}"
        );
        assert_eq!(pair(solid(1.0), solid(1.0), Vec3::x() * 1.005), []);
        let inner = pair(solid(1.0), solid(0.3), Vec3::new(0.05, 0.02, 0.01));
        assert!(
            matches!(inner[..], [Fault::Inside { part: 1, of: 0, .. }]),
            "{inner:?}"
        );
        let through = pair(Mesh::Sheet(plane()), solid(0.3), Vec3::new(0.1, 0.03, 0.02));
        assert!(
            matches!(through[..], [Fault::Crossed { at, .. }] if at.z.abs() < 1e-12),
            "{through:?}"
        );
        assert_eq!(
            pair(Mesh::Sheet(plane()), solid(0.3), Vec3::z() * 0.151),
            []
        );
    }

    #[test]
    fn walls_and_folds_that_are_nearer_than_the_thickness_are_found() {
        let flat = Mesh::Solid(solid_box([1.0, 1.0, 0.008], [8, 8, 1]).expect("a box"));
        let thin = found(&[(flat.clone(), Vec3::zeros())], 0.01, false);
        assert!(
            matches!(thin[..], [Fault::Thin { part: 0, apart, .. }] if (apart - 0.008).abs() < 1e-12),
            "{thin:?}"
        );
        assert_eq!(found(&[(flat, Vec3::zeros())], 0.007, false), []);
        // A sheet that is finer than its thickness, and one that is folded through itself.
        let sheet = |mesh: TriMesh, itself: bool| {
            found(&[(Mesh::Sheet(mesh), Vec3::zeros())], 0.01, itself)
        };
        assert_eq!(sheet(plane(), true), []);
        let fine = crate::mesh::generate::sheet(0.02, 0.02, 4, 4, Pattern::Regular).expect("fine");
        assert_eq!(sheet(fine.clone(), false), []);
        assert!(matches!(sheet(fine, true)[..], [Fault::Thin { .. }]));
        let mut folded = plane();
        for x in &mut folded.positions {
            // The right half turns back below the left half and up through it.
            if x.x > 0.0 {
                *x = Vec3::new(-x.x, x.y + 0.01, 0.6 * x.x - 0.2);
            }
        }
        assert!(matches!(sheet(folded, true)[..], [Fault::Crossed { .. }]));
        // The lips of a notch lie on each other: the vertices of one side are doubled.
        let mut notched = plane();
        let is_lip = |x: &Vec3| x.x == 0.0 && x.y < 0.0;
        for vertex in 0..notched.positions.len() {
            if !is_lip(&notched.positions[vertex]) {
                continue;
            }
            let doubled = notched.positions.len() as u32;
            notched.positions.push(notched.positions[vertex]);
            let positions = &notched.positions;
            let is_left =
                |corners: &[u32; 3]| corners.iter().any(|v| positions[*v as usize].x < 0.0);
            for corners in notched
                .triangles
                .iter_mut()
                .filter(|corners| is_left(corners))
            {
                *corners = corners.map(|v| if v == vertex as u32 { doubled } else { v });
            }
        }
        assert_eq!(sheet(notched, true), []);
    }

    #[test]
    fn the_least_distance_of_a_triangle_from_a_shape_is_that_of_geometry() {
        let shape = |shape: Shape, at: Vec3| {
            let motion = Motion::Still(nalgebra::Translation3::from(at).into());
            Obstacle::new(Geometry::Shape(shape), motion).expect("a shape")
        };
        let ball = shape(Shape::sphere(0.1), Vec3::new(0.3, 0.3, 0.08));
        let corners = [Vec3::zeros(), Vec3::x(), Vec3::y()];
        let [a, b, c] = &corners;
        let (distance, at) = deepest(&ball, [a, b, c], 0.0, 0.0).expect("near");
        assert!((distance + 0.02).abs() < 1e-9, "{distance}");
        assert!((at - Vec3::new(0.3, 0.3, 0.0)).norm() < 1e-4);
        let floor = shape(Shape::Plane, Vec3::z() * 0.25);
        let (distance, _) = deepest(&floor, [a, b, c], 0.0, 0.0).expect("near");
        assert_eq!(distance, -0.25);
        let far = shape(Shape::sphere(0.1), Vec3::z() * 9.0);
        assert_eq!(deepest(&far, [a, b, c], 0.0, 0.0), None);
        // An edge, with one end twice.
        let (distance, _) = deepest(&ball, [a, b, b], 0.0, 1.0).expect("near");
        let exact = 0.3_f64.hypot(0.08) - 0.1;
        assert!((distance - exact).abs() < 1e-9);
    }
}
