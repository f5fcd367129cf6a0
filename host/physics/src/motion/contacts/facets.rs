//! The contacts of the facets of solids in equilibrium: the mortar method.
//!
//! A vertex against a triangle, or an edge against an edge, puts the force of a uniform pressure at places that depend on how
//! two meshes lie on each other. So in equilibrium two solids press on each other over their facets. The pressure is linear on
//! the facets of the finer surface, between values at its corners. Each corner `a` has one contact, whose gap is the mean of the
//! gap `g` over both surfaces, and whose force is `lambda` times the area of its shape function `N`:
//!
//! ```text
//! g_a = sum over common parts of the integral of N_a g / A_a,    A_a = integral of N_a
//! ```
//!
//! (Puso and Laursen, "A mortar segment-to-segment contact method for large deformation solid mechanics", 2004; linear pressure on
//! quadratic facets: Puso, Laursen and Solberg, 2008.) The integrals are exact on plane facets with straight sides, so that a
//! uniform pressure passes between meshes that do not match. The contact has the law of all contacts (`contact::row`) and the
//! nodes of both surfaces under `N_a`.
//!
//! The mean gap closes, and not that of each point: between two curved surfaces points overlap by the error of the meshes.

use super::Contacts;
use super::Pressed;
use super::parts::Owner;
use crate::Vec3;
use crate::contact::facet::{Common, Facet};
use crate::contact::row::{Row, Stiffness};
use crate::mesh::check_solid::size;
use crate::mesh::{Mesh, TetMesh};
use crate::motion::joined::At;
use crate::motion::touching::Touch;
use std::collections::{BTreeMap, BTreeSet};

/// Facets take part up to this depth, as a fraction of the mean thickness of the thinner body, which is twice its volume over its
/// surface. The far sides of two bodies face each other, too, and are deeper. Contacts are found before they close, so that no
/// iteration goes deep.
const DEPTH: f64 = 0.25;
/// What lies further from a corner than its least gap and this fraction of the size of its facets does not count for it: a step
/// in the other surface.
const BEYOND: f64 = 0.5;
/// The depth beyond which a multiplier is carried on once more in an iteration, as a fraction of the distance of contact.
const DEEP: f64 = 0.25;

/// A contact between facets: any number of nodes.
pub(super) type FacetTouch = Touch<Vec<(At, f64)>>;

/// The contacts of facets; empty in a motion.
#[derive(Debug, Default)]
pub(super) struct Facets {
    pairs: Vec<Faces>,
    pub(super) touches: Vec<FacetTouch>,
    /// Of each contact its pair and its corner, and the area of the shape function there (m²).
    pub(super) of: Vec<(Corner, f64)>,
    pub(super) kept: Kept,
}

/// A pair of surfaces by its number, and a corner of the first one.
pub(super) type Corner = (usize, u32);
/// The normal force and the friction force (N) of contacts.
pub(super) type Kept = BTreeMap<Corner, (f64, Vec3)>;

/// Two surfaces that face each other. The pressure is linear on the facets of the first one.
#[derive(Debug)]
pub(super) struct Faces {
    pub(super) sides: [usize; 2],
    pub(super) facets: [Vec<Facet>; 2],
    distance: f64,
    /// See [`DEPTH`] (m).
    depth: f64,
    friction: f64,
}

/// The part of a contact that one common part of two facets gives.
struct Share {
    /// The gap, its mean (m).
    gap: f64,
    /// The integral of the shape function (m²).
    area: f64,
    normal: Vec3,
    facets: [usize; 2],
    /// The integrals of the products with the shape functions of the nodes of both facets (m²).
    weights: [[f64; 6]; 2],
}

impl Contacts {
    /// Lets solids touch each other over their facets, as long as nothing moves in time. Nothing else of them is listed.
    pub(crate) fn face(&mut self) {
        for one in 0..self.sources.len() {
            for other in one + 1..self.sources.len() {
                let is_body = |part: usize| matches!(self.owners[part], Owner::Body(_));
                let (Mesh::Solid(first), Mesh::Solid(second)) =
                    (&self.sources[one].mesh, &self.sources[other].mesh)
                else {
                    continue;
                };
                let Some(meeting) = self
                    .meetings
                    .get(one, other)
                    .filter(|_| is_body(one) && is_body(other))
                else {
                    continue;
                };
                let of =
                    |mesh, part: usize| Facet::of(mesh, self.surfaces.parts[part].vertices.start);
                let facets = [of(first, one), of(second, other)];
                let area = |facets: &[Facet], mesh: &TetMesh, part: usize| {
                    let from = self.surfaces.parts[part].vertices.start;
                    let areas = facets.iter().map(|facet| {
                        let at = |i: usize| mesh.positions[(facet.nodes[i] - from) as usize];
                        let [a, b, c] = [0, 1, 2].map(at);
                        0.5 * (b - a).cross(&(c - a)).norm()
                    });
                    areas.sum::<f64>()
                };
                let areas = [
                    area(&facets[0], first, one),
                    area(&facets[1], second, other),
                ];
                let thickness = |mesh: &TetMesh, area: f64| {
                    let cells = mesh.cells.vertices();
                    let volumes = cells.map(|cell| size(&mesh.positions, cell).0 / 6.0);
                    2.0 * volumes.sum::<f64>() / area
                };
                let thinner = thickness(first, areas[0]).min(thickness(second, areas[1]));
                let mean = |side: usize| areas[side] / facets[side].len() as f64;
                let is_turned = mean(1) < mean(0);
                let (mut sides, mut facets) = ([one, other], facets);
                if is_turned {
                    sides.reverse();
                    facets.reverse();
                }
                self.facets.pairs.push(Faces {
                    sides,
                    facets,
                    distance: meeting.distance,
                    depth: DEPTH * thinner,
                    friction: meeting.friction,
                });
                self.meetings.forget(one, other);
                self.surfaces.keep_apart(one, other);
            }
        }
    }
}

impl Facets {
    /// The pair of this number.
    pub(super) fn pair(&self, number: usize) -> &Faces {
        &self.pairs[number]
    }

    /// Finds the contacts at the positions `x` (m) of the vertices, with their stiffnesses (N/m), up to gaps of
    /// `ahead` (m).
    pub(super) fn find(
        &mut self,
        x: &[Vec3],
        stiffness: &[f64],
        ahead: f64,
        at: &dyn Fn(u32) -> Option<At>,
    ) {
        self.touches.clear();
        self.of.clear();
        for (number, pair) in self.pairs.iter().enumerate() {
            for (corner, found) in pair.corners(x, ahead) {
                let key = (number, corner);
                let kept = self.kept.get(&key).copied().unwrap_or_default();
                if let Some((touch, area)) = pair.touch(&found, x, stiffness, kept, at) {
                    self.touches.push(touch);
                    self.of.push((key, area));
                }
            }
        }
    }

    /// Adds what the contacts press on the nodes of a body to `found`, which has the area of each. The vertices of the body begin
    /// with the number `first`.
    ///
    /// The pressure of a node is the force on it over the integral of its shape function over what the surfaces share, which the
    /// contacts of all corners give in sum.
    pub(super) fn press(&self, body: usize, first: u32, found: &mut [Pressed]) {
        // Force (N) and area (m^2), by node.
        let mut sums: BTreeMap<u32, [f64; 2]> = BTreeMap::new();
        for (touch, (_, area)) in self.touches.iter().zip(&self.of) {
            let own = || touch.nodes.iter().filter(|(at, _)| at.body == body);
            let sign = own().map(|(_, weight)| weight).sum::<f64>().signum();
            for (at, weight) in own() {
                let sum = sums.entry(at.node).or_default();
                sum[0] += touch.response.normal * weight * sign;
                sum[1] += area * weight * sign;
            }
        }
        let facets = self
            .pairs
            .iter()
            .flat_map(|pair| pair.facets.iter().flatten());
        let middles = middles(facets, first, found.len());
        // A linear shape function of a corner is that of the corner and half of those of the middles beside it.
        for (middle, ends) in &middles {
            let Some([force, area]) = sums.remove(middle) else {
                continue;
            };
            for end in ends {
                let sum = sums.entry(*end).or_default();
                *sum = [sum[0] + 0.5 * force, sum[1] + 0.5 * area];
            }
        }
        let pressure = |node: &u32| {
            let [force, area] = sums.get(node).copied().unwrap_or_default();
            if area > 0.0 { force / area } else { 0.0 }
        };
        let mut press = |node: &u32, pressure: f64| {
            let own = &mut found[*node as usize];
            own.force += pressure * own.area;
        };
        for node in sums.keys() {
            press(node, pressure(node));
        }
        for (middle, [a, b]) in &middles {
            press(middle, 0.5 * (pressure(a) + pressure(b)));
        }
    }

    /// Keeps the forces of the contacts.
    pub(super) fn keep(&mut self) {
        let each = self.touches.iter().zip(&self.of);
        self.kept = each
            .filter(|(touch, _)| touch.response.acts())
            .map(|(touch, (key, _))| (*key, (touch.response.normal, touch.response.friction)))
            .collect();
    }
}

impl Faces {
    /// The shares of each corner, of facets up to gaps of `ahead` (m).
    fn corners(&self, x: &[Vec3], ahead: f64) -> BTreeMap<u32, Vec<Share>> {
        let mut found: BTreeMap<u32, Vec<Share>> = BTreeMap::new();
        let [own, its] = self.boxes(x, ahead.max(self.depth));
        for (one, low, high) in &own {
            for (other, _, _) in its
                .iter()
                .filter(|(_, from, to)| meet([low, high], [from, to]))
            {
                let facets = [&self.facets[0][*one], &self.facets[1][*other]];
                facets[0].each_common(facets[1], x, &mut |common| {
                    for (corner, share) in shares(facets, common, x) {
                        let gap = share.gap - self.distance;
                        if -self.depth <= gap && gap <= ahead {
                            let numbers = [*one, *other];
                            let all = found.entry(facets[0].nodes[corner]);
                            all.or_default().push(Share {
                                facets: numbers,
                                ..share
                            });
                        }
                    }
                });
            }
        }
        found
    }

    /// The facets of both sides that are near the other side, with their boxes, those of the first side enlarged by `reach` (m).
    fn boxes(&self, x: &[Vec3], reach: f64) -> [Vec<(usize, Vec3, Vec3)>; 2] {
        let boxes = |which: usize, by: f64| {
            let by = Vec3::repeat(by);
            let facets = self.facets[which].iter().enumerate();
            let facets = facets.map(|(number, facet)| {
                let at = x[facet.nodes[0] as usize];
                let nodes = facet.nodes().iter().map(|node| x[*node as usize]);
                let (low, high) =
                    nodes.fold((at, at), |(low, high), x| (low.inf(&x), high.sup(&x)));
                (number, low - by, high + by)
            });
            facets.collect::<Vec<_>>()
        };
        let reach = reach + self.distance;
        let both = [boxes(0, reach), boxes(1, 0.0)];
        let around = |all: &[(usize, Vec3, Vec3)]| {
            let start = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
            all.iter().fold(start, |(low, high), one| {
                (low.inf(&one.1), high.sup(&one.2))
            })
        };
        let whole = [around(&both[0]), around(&both[1])];
        let near = |all: &[(usize, Vec3, Vec3)], (low, high): &(Vec3, Vec3)| {
            let near = all.iter().filter(|one| meet([&one.1, &one.2], [low, high]));
            near.copied().collect::<Vec<_>>()
        };
        [near(&both[0], &whole[1]), near(&both[1], &whole[0])]
    }

    /// The contact of a corner from its `shares`, and the area of its shape function (m²); `None` if nothing can move.
    fn touch(
        &self,
        shares: &[Share],
        x: &[Vec3],
        stiffness: &[f64],
        (force, friction): (f64, Vec3),
        at: &dyn Fn(u32) -> Option<At>,
    ) -> Option<(FacetTouch, f64)> {
        let own: BTreeSet<usize> = shares.iter().map(|share| share.facets[0]).collect();
        let whole: f64 = own
            .iter()
            .map(|facet| {
                let [a, b, c] = [0, 1, 2].map(|i| x[self.facets[0][*facet].nodes[i] as usize]);
                (b - a).cross(&(c - a)).norm() / 6.0
            })
            .sum();
        let least = shares
            .iter()
            .map(|share| share.gap)
            .fold(f64::INFINITY, f64::min);
        let most = least + BEYOND * whole.sqrt();
        let mut weights: BTreeMap<u32, f64> = BTreeMap::new();
        let (mut normal, mut area) = (Vec3::zeros(), 0.0);
        for share in shares.iter().filter(|share| share.gap <= most) {
            area += share.area;
            normal -= share.normal * share.area;
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                let facet = &self.facets[side][share.facets[side]];
                for (node, weight) in facet.nodes().iter().zip(share.weights[side]) {
                    *weights.entry(*node).or_insert(0.0) += sign * weight;
                }
            }
        }
        let normal = normal.normalize();
        if !(area > 0.0 && normal.x.is_finite()) {
            return None;
        }
        let each = || weights.iter().map(|(node, weight)| (*node, weight / area));
        let compliance: f64 = each()
            .map(|(node, weight)| weight * weight / stiffness[node as usize])
            .sum();
        let gap = each().map(|(node, weight)| normal.dot(&x[node as usize]) * weight);
        let gap = gap.sum::<f64>() - self.distance;
        let stiff = Stiffness {
            mass: compliance.recip(),
            step: 1.0,
            thickness: self.distance,
            approach: 0.0,
            force: 0.0,
            friction: self.friction,
        };
        let across = friction - normal * normal.dot(&friction);
        let row = Row {
            most: f64::INFINITY,
            normal,
            gap,
            motion: Vec3::zeros(),
            friction: self.friction,
            depth: DEEP * self.distance,
            normal_stiffness: stiff.normal(),
            friction_stiffness: Stiffness { force, ..stiff }.friction(),
            carried: force,
            anchored: across,
            is_held: false,
        };
        let nodes = each().filter_map(|(node, weight)| Some((at(node)?, weight)));
        (compliance > 0.0).then(|| (Touch::new(nodes.collect(), row), area))
    }
}

/// The middles of the quadratic facets of a body of `count` vertices that begin with the number `first`, each with the corners at
/// the ends of its side.
fn middles<'a>(
    facets: impl Iterator<Item = &'a Facet>,
    first: u32,
    count: usize,
) -> BTreeMap<u32, [u32; 2]> {
    let own = first..first + count as u32;
    let facets = facets.filter(|facet| facet.is_quadratic && own.contains(&facet.nodes[0]));
    let each = facets.flat_map(|facet| {
        let [a, b, c, ab, bc, ca] = facet.nodes.map(|node| node - first);
        [(ab, [a, b]), (bc, [b, c]), (ca, [c, a])]
    });
    each.collect()
}

/// Whether two boxes, each by its lowest and its highest corner, have a common point.
fn meet([low, high]: [&Vec3; 2], [from, to]: [&Vec3; 2]) -> bool {
    (0..3).all(|axis| low[axis] <= to[axis] && from[axis] <= high[axis])
}

/// What a common part of two facets gives to each corner of the first one.
fn shares(facets: [&Facet; 2], common: &Common, x: &[Vec3]) -> [(usize, Share); 3] {
    let at = |facet: &Facet, shapes: &[f64; 6]| -> Vec3 {
        let nodes = facet.nodes().iter().zip(shapes);
        nodes.map(|(node, shape)| x[*node as usize] * *shape).sum()
    };
    let mut gap = 0.0;
    let mut all = 0.0;
    let mut areas = [0.0; 3];
    let mut weights = [[[0.0; 6]; 2]; 3];
    for point in &common.points {
        let shapes = [0, 1].map(|side: usize| facets[side].shapes(point.at[side]));
        let [first, second] = [0, 1].map(|side: usize| at(facets[side], &shapes[side]));
        gap += common.normal.dot(&(second - first)) * point.area;
        all += point.area;
        for corner in 0..3 {
            let area = point.at[0][corner] * point.area;
            areas[corner] += area;
            for (sums, shapes) in weights[corner].iter_mut().zip(&shapes) {
                for (sum, shape) in sums.iter_mut().zip(shapes) {
                    *sum += area * shape;
                }
            }
        }
    }
    [0, 1, 2].map(|corner| {
        let share = Share {
            gap: gap / all,
            area: areas[corner],
            normal: common.normal,
            facets: [0; 2],
            weights: weights[corner],
        };
        (corner, share)
    })
}
