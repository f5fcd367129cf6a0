//! The convex hull of a few points: the shape of a tool, without the radius that rounds the tool.
//!
//! A point rounded by a radius is a sphere, a segment is a capsule, and so on: one code serves all shapes. The nearest points of a
//! hull and a triangle are found as the point of the difference of the two that is nearest to the origin: E. G. Gilbert, D. W. Johnson and
//! S. S. Keerthi, "A fast procedure for computing the distance between complex objects in three-dimensional space" (1988). The
//! nearest point of a simplex is found on its triangles.

use crate::geometry::Vec3;
use crate::nearest::weights;
use nalgebra::UnitQuaternion;

/// Largest number of corners of a hull.
pub const MAX_CORNERS: usize = 32;

/// Largest number of rounds: hulls of 32 corners need at most twelve.
const ROUNDS: usize = 24;
/// The fraction of the squared distance by which a round must be able to shorten it.
const SHORTER: f64 = 1e-12;
/// The fraction of the squared distance by which a corner may be further away and still counts as a nearest point.
const AS_NEAR: f64 = 4e-9;
/// A distance (m) below which a hull and a triangle meet: ten thousand times less than any device renders.
const MEETS: f64 = 1e-10;
/// The volume of a tetrahedron as a fraction of that of its edges, and the square of that fraction of a triangle's area, below which they are
/// flat.
const FLAT: f64 = 1e-12;

/// The convex hull of points, in axes of its own.
///
/// ```
/// use rt_core::Vec3;
/// use rt_core::hull::Hull;
///
/// // A segment of 2 cm, 3 cm above a triangle.
/// let segment = Hull::new(&[Vec3::new(-0.01, 0.0, 0.03), Vec3::new(0.01, 0.0, 0.03)]).unwrap();
/// let corners = [[-0.1, -0.1], [0.1, -0.1], [0.0, 0.1]].map(|[x, y]| Vec3::new(x, y, 0.0));
/// let near = segment.nearest(corners.each_ref());
/// assert!(near.are_apart);
/// assert!((near.point.z - 0.03).abs() < 1e-15);
/// assert!((segment.extent() - 0.001_f64.sqrt()).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hull {
    corners: [Vec3; MAX_CORNERS],
    count: u8,
}

/// How a hull and a triangle lie to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// The weights of the triangle's corners at its nearest point, or at a common point.
    pub weights: [f64; 3],
    /// The nearest point of the hull, or that common point (m).
    pub point: Vec3,
    /// Whether hull and triangle have no point in common.
    pub are_apart: bool,
}

/// A corner of the hull and a corner of the triangle, by their numbers.
type Pair = [u8; 2];

/// Where a search for nearest points begins: at the corners of the hull on which an earlier search ended. Where hull and other points have
/// moved little, the search ends there again. Any seed leads to the same distance, up to rounding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seed {
    /// The corner of the largest weight first.
    corners: [u8; 3],
    count: u8,
}

impl Default for Seed {
    fn default() -> Self {
        Self {
            corners: [0; 3],
            count: 1,
        }
    }
}

/// Up to four pairs, and their weights at the point of their hull that is nearest to the origin. The weights sum to one.
#[derive(Clone)]
struct Simplex {
    pairs: [Pair; 4],
    /// From the triangle to the hull (m), by pair.
    apart: [Vec3; 4],
    weights: [f64; 4],
    count: usize,
}

impl Hull {
    /// A point at the origin: the hull of a sphere.
    pub const POINT: Self = Self {
        corners: [Vec3::new(0.0, 0.0, 0.0); MAX_CORNERS],
        count: 1,
    };

    /// The hull of points (m); `None` for no point, for more than [`MAX_CORNERS`], or for numbers that are not finite.
    pub fn new(points: &[Vec3]) -> Option<Self> {
        let mut hull = Self::POINT;
        let each = hull.corners.iter_mut().zip(points);
        for (corner, point) in each {
            *corner = *point;
        }
        let is_finite = points
            .iter()
            .all(|point| point.iter().all(|x| x.is_finite()));
        let count = points.len();
        hull.count = count as u8;
        (count > 0 && count <= MAX_CORNERS && is_finite).then_some(hull)
    }

    /// The corners (m).
    pub fn corners(&self) -> &[Vec3] {
        let count = usize::from(self.count);
        self.corners.get(..count).unwrap_or(&self.corners)
    }

    /// The hull, turned about its origin.
    #[must_use]
    pub fn turned(&self, rotation: &UnitQuaternion<f64>) -> Self {
        let mut turned = *self;
        let turn = rotation.to_rotation_matrix();
        for corner in turned.corners.iter_mut().take(usize::from(self.count)) {
            *corner = turn * *corner;
        }
        turned
    }

    /// The largest distance of a corner from the origin (m).
    pub fn extent(&self) -> f64 {
        let lengths = self.corners().iter().map(Vec3::norm);
        lengths.fold(0.0, f64::max)
    }

    /// The corner (m) that lies furthest against a direction.
    pub fn lowest(&self, direction: &Vec3) -> Vec3 {
        let (mut lowest, mut height) = (Vec3::zeros(), f64::INFINITY);
        for corner in self.corners() {
            let at = direction.dot(corner);
            if at < height {
                (lowest, height) = (*corner, at);
            }
        }
        lowest
    }

    /// The nearest points of the hull and a triangle (m).
    pub fn nearest(&self, triangle: [&Vec3; 3]) -> Near {
        let mut simplex = self.begin(0, triangle);
        self.approach(&mut simplex, f64::INFINITY, &triangle);
        simplex.near(self)
    }

    /// The nearest point of the hull to a point (m). The weights are those of a triangle whose first corner is the point.
    pub fn nearest_to(&self, point: &Vec3) -> Near {
        self.nearest_to_from(point, &mut Seed::default())
    }

    /// The nearest points of the hull and a triangle (m), or `None` where they are further apart than `most` (m), which costs less. The search
    /// begins at a seed, and leaves that of the next search.
    ///
    /// Parallel faces have many nearest points. A corner of the hull is preferred: a plate would otherwise lie on its middle.
    pub fn nearest_within(&self, most: f64, triangle: [&Vec3; 3], seed: &mut Seed) -> Option<Near> {
        let [corner, ..] = seed.corners;
        let mut simplex = self.begin(corner, triangle);
        let is_near = self.approach(&mut simplex, most, &triangle);
        if is_near {
            self.prefer_corner(&mut simplex, triangle);
        }
        simplex.seed(seed);
        is_near.then(|| simplex.near(self))
    }

    /// Replaces a simplex of nearest points by that of a corner of the hull that is as near.
    fn prefer_corner(&self, simplex: &mut Simplex, triangle: [&Vec3; 3]) {
        let apart = simplex.nearest();
        let (least, as_near) = (apart.norm_squared(), 1.0 + AS_NEAR);
        let mut pairs = simplex.pairs.iter().take(simplex.count);
        let is_at_corner = pairs
            .next()
            .is_some_and(|[first, _]| pairs.all(|[corner, _]| corner == first));
        if is_at_corner || !are_apart(least) {
            return;
        }
        let level = apart.dot(&simplex.near(self).point) + least * AS_NEAR;
        for (corner, number) in self.corners().iter().zip(0..) {
            if apart.dot(corner) <= level {
                let there = self.begin(number, triangle);
                if there.nearest().norm_squared() <= least * as_near {
                    *simplex = there;
                    return;
                }
            }
        }
    }

    /// The nearest point of the hull to a point (m), from a seed on as [`Self::nearest_within`].
    pub fn nearest_to_from(&self, point: &Vec3, seed: &mut Seed) -> Near {
        let mut simplex = Simplex::EMPTY;
        for corner in seed.corners.into_iter().take(usize::from(seed.count)) {
            simplex.push([corner, 0], self.corner(corner) - point, 1.0);
        }
        if seed.count > 1 {
            simplex.reduce();
        }
        self.approach(&mut simplex, f64::INFINITY, &[point]);
        simplex.seed(seed);
        simplex.near(self)
    }

    /// The simplex of a corner of the hull and its nearest point on a triangle.
    fn begin(&self, corner: u8, triangle: [&Vec3; 3]) -> Simplex {
        let first = self.corner(corner);
        let mut simplex = Simplex::EMPTY;
        let near = weights(first, triangle);
        for ((other, weight), place) in (0..).zip(near).zip(triangle) {
            if weight > 0.0 {
                simplex.push([corner, other], first - place, weight);
            }
        }
        simplex
    }

    /// Leads a reduced simplex to the nearest points of the hull and of the hull of up to three points. Returns whether these are not known to
    /// be further apart than `most` (m).
    fn approach(&self, simplex: &mut Simplex, most: f64, others: &[&Vec3]) -> bool {
        let mut apart = simplex.nearest();
        let mut least = apart.norm_squared();
        if self.count == 1 {
            return least <= most * most;
        }
        for _ in 0..ROUNDS {
            let (pair, way) = self.furthest(&apart, others);
            let bound = apart.dot(&way);
            if bound > 0.0 && bound * bound > most * most * least {
                return false;
            }
            if !are_apart(least) || least - bound <= SHORTER * least {
                break;
            }
            let mut next = simplex.clone();
            next.push(pair, way, 0.0);
            next.reduce();
            let nearer = next.nearest();
            // Rounding ends the search.
            if nearer.norm_squared() >= least {
                break;
            }
            (*simplex, apart, least) = (next, nearer, nearer.norm_squared());
        }
        true
    }

    fn corner(&self, number: u8) -> &Vec3 {
        let [first, ..] = &self.corners;
        self.corners.get(usize::from(number)).unwrap_or(first)
    }

    /// The distance of a triangle from the hull (m).
    pub fn distance(&self, triangle: [&Vec3; 3]) -> f64 {
        let near = self.nearest(triangle);
        (near.point - at(triangle, &near.weights)).norm()
    }

    /// The pair of corners that lies furthest against a direction, and the way between them.
    fn furthest(&self, direction: &Vec3, others: &[&Vec3]) -> (Pair, Vec3) {
        let (mut pair, mut way) = ([0, 0], Vec3::zeros());
        let [corner, other] = &mut pair;
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        for (place, number) in self.corners().iter().zip(0..) {
            let height = direction.dot(place);
            if height < lowest {
                (*corner, lowest, way) = (number, height, *place);
            }
        }
        let mut from = Vec3::zeros();
        for (place, number) in others.iter().zip(0..) {
            let height = direction.dot(place);
            if height > highest {
                (*other, highest, from) = (number, height, **place);
            }
        }
        (pair, way - from)
    }
}

/// Whether points at this squared distance are apart.
fn are_apart(squared: f64) -> bool {
    squared > MEETS * MEETS
}

/// The point of a triangle of these weights.
fn at([a, b, c]: [&Vec3; 3], [x, y, z]: &[f64; 3]) -> Vec3 {
    a * *x + b * *y + c * *z
}

impl Simplex {
    const EMPTY: Self = Self {
        pairs: [[0; 2]; 4],
        apart: [Vec3::new(0.0, 0.0, 0.0); 4],
        weights: [0.0; 4],
        count: 0,
    };

    /// Adds a pair. There is room: a simplex of four ends the search.
    fn push(&mut self, pair: Pair, apart: Vec3, weight: f64) {
        let place = self
            .pairs
            .get_mut(self.count)
            .zip(self.apart.get_mut(self.count));
        if let Some((place, way)) = place
            && let Some(its) = self.weights.get_mut(self.count)
        {
            (*place, *way, *its) = (pair, apart, weight);
            self.count = self.count.saturating_add(1);
        }
    }

    /// Leaves the least simplex on which the nearest point lies. Of four pairs, the last one is new: the point lies on one of its faces,
    /// because without it the point was found before.
    fn reduce(&mut self) {
        let corners = self.apart.each_ref();
        let [a, b, c, _] = corners;
        let weights = match self.count {
            1 => [1.0, 0.0, 0.0, 0.0],
            2 => {
                let [x, y] = on_segment(a, b);
                [x, y, 0.0, 0.0]
            }
            3 => {
                let [x, y, z] = on_triangle([a, b, c]);
                [x, y, z, 0.0]
            }
            _ => in_tetrahedron(corners),
        };
        self.count = 0;
        let (pairs, places) = (self.pairs, self.apart);
        for ((pair, apart), weight) in pairs.into_iter().zip(places).zip(weights) {
            if weight > 0.0 {
                self.push(pair, apart, weight);
            }
        }
    }

    /// The nearest point to the origin (m).
    fn nearest(&self) -> Vec3 {
        let each = self.apart.iter().zip(&self.weights).take(self.count);
        each.fold(Vec3::zeros(), |sum, (apart, weight)| sum + apart * *weight)
    }

    /// The nearest points of the hull and the triangle.
    fn near(&self, hull: &Hull) -> Near {
        let mut near = Near {
            weights: [0.0; 3],
            point: Vec3::zeros(),
            are_apart: are_apart(self.nearest().norm_squared()),
        };
        for ([corner, other], weight) in self.pairs.iter().zip(&self.weights).take(self.count) {
            near.point += hull.corner(*corner) * *weight;
            if let Some(sum) = near.weights.get_mut(usize::from(*other)) {
                *sum += weight;
            }
        }
        near
    }

    /// The corners of the hull, as a seed.
    fn seed(&self, seed: &mut Seed) {
        let each = self.pairs.iter().zip(&self.weights).take(self.count);
        let heaviest = each.clone().max_by(|(_, a), (_, b)| a.total_cmp(b));
        let first = heaviest.map_or(0, |([corner, _], _)| *corner);
        let others = each.map(|([corner, _], _)| *corner);
        let corners = core::iter::once(first).chain(others.filter(|corner| *corner != first));
        seed.count = 0;
        for (place, corner) in seed.corners.iter_mut().zip(corners) {
            *place = corner;
            seed.count = seed.count.saturating_add(1);
        }
    }
}

/// The weights of the ends of a segment at the point that is nearest to the origin.
fn on_segment(a: &Vec3, b: &Vec3) -> [f64; 2] {
    let way = b - a;
    let (along, whole) = (-way.dot(a), way.norm_squared());
    if along <= 0.0 {
        [1.0, 0.0]
    } else if along >= whole {
        [0.0, 1.0]
    } else {
        let along = along / whole;
        [1.0 - along, along]
    }
}

/// The weights of the corners of a triangle at the point that is nearest to the origin. The nearest point of a triangle whose corners lie on
/// a line is on an edge: its regions cannot be told apart.
fn on_triangle([a, b, c]: [&Vec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let size = ab.norm_squared() * ac.norm_squared();
    if ab.cross(&ac).norm_squared() > FLAT * size {
        return weights(&Vec3::zeros(), [a, b, c]);
    }
    let ([p, q], [r, s], [t, u]) = (on_segment(a, b), on_segment(b, c), on_segment(c, a));
    let squared = |near: &[f64; 3]| at([a, b, c], near).norm_squared();
    let mut nearest = [p, q, 0.0];
    for other in [[0.0, r, s], [u, 0.0, t]] {
        if squared(&other) < squared(&nearest) {
            nearest = other;
        }
    }
    nearest
}

/// The weights of the corners of a tetrahedron at the point that is nearest to the origin, inside or on a face of the last corner.
fn in_tetrahedron([a, b, c, d]: [&Vec3; 4]) -> [f64; 4] {
    if let Some(weights) = inside([a, b, c, d]) {
        return weights;
    }
    let squared = |corners, near: &[f64; 3]| at(corners, near).norm_squared();
    let near = on_triangle([a, b, d]);
    let (mut least, [x, y, z]) = (squared([a, b, d], &near), near);
    let mut found = [x, y, 0.0, z];
    let near = on_triangle([b, c, d]);
    if squared([b, c, d], &near) < least {
        let [x, y, z] = near;
        (least, found) = (squared([b, c, d], &near), [0.0, x, y, z]);
    }
    let near = on_triangle([c, a, d]);
    if squared([c, a, d], &near) < least {
        let [x, y, z] = near;
        found = [y, 0.0, x, z];
    }
    found
}

/// The weights of the corners of a tetrahedron at the origin; `None` if the origin lies outside, or if the tetrahedron is flat.
fn inside([a, b, c, d]: [&Vec3; 4]) -> Option<[f64; 4]> {
    let weight = |[p, q, r]: [&Vec3; 3], opposite: &Vec3| {
        let (pq, pr, to) = (q - p, r - p, opposite - p);
        let outward = pq.cross(&pr);
        let (volume, origin) = (outward.dot(&to), -outward.dot(p));
        let size = pq.norm_squared() * pr.norm_squared() * to.norm_squared();
        let is_flat = volume * volume <= FLAT * FLAT * size;
        (!is_flat && volume * origin >= 0.0).then(|| origin / volume)
    };
    Some([
        weight([b, c, d], a)?,
        weight([c, d, a], b)?,
        weight([d, a, b], c)?,
        weight([a, b, c], d)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    fn points(count: core::ops::Range<usize>) -> impl Strategy<Value = Vec<Vec3>> {
        let point = proptest::array::uniform3(-1.0..1.0_f64).prop_map(Vec3::from);
        proptest::collection::vec(point, count)
    }

    /// The corners of a box about the origin.
    fn cuboid(half: Vec3) -> Hull {
        let corners = (0..8).map(|corner: u8| {
            let sign = |bit: u8| 2.0 * f64::from(corner >> bit & 1) - 1.0;
            Vec3::new(sign(0), sign(1), sign(2)).component_mul(&half)
        });
        Hull::new(&corners.collect::<Vec<_>>()).expect("eight corners")
    }

    proptest! {
        /// The conditions of the least distance: the plane across the line between the nearest points, at each of them, has the
        /// whole hull and the whole triangle beyond it. Both points belong to their sets.
        #[test]
        fn a_plane_between_hull_and_triangle_proves_their_distance(
            hull in points(1..MAX_CORNERS + 1),
            triangle in points(3..4),
            moved in proptest::array::uniform3(-3.0..3.0_f64),
            seed in 0..MAX_CORNERS as u8,
        ) {
            let corners: Vec<Vec3> = hull.iter().map(|p| p + Vec3::from(moved)).collect();
            let hull = Hull::new(&corners).expect("few corners");
            let [a, b, c] = [0, 1, 2].map(|k| &triangle[k]);
            let mut seed = Seed {
                corners: [seed % corners.len() as u8; 3],
                count: 1,
            };
            let near = hull.nearest_within(f64::INFINITY, [a, b, c], &mut seed).unwrap();
            let foot = at([a, b, c], &near.weights);
            let apart = near.point - foot;
            if near.are_apart {
                // A search that begins where the last one ended changes nothing.
                let again = hull.nearest_within(f64::INFINITY, [a, b, c], &mut seed).unwrap();
                prop_assert!((again.point - near.point).norm() < 1e-9);
                prop_assert!((near.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                prop_assert!(near.weights.iter().all(|weight| *weight >= 0.0));
                let lowest = apart.dot(&(hull.lowest(&apart) - foot));
                let highest = [a, b, c].map(|p| apart.dot(&(p - foot))).into_iter().fold(0.0, f64::max);
                // The square of a distance found, to the eighth digit, or to rounding where the sets almost meet.
                let allowed = 1e-8 * apart.norm_squared() + 1e-13;
                prop_assert!(lowest >= apart.norm_squared() - allowed, "{near:?}");
                prop_assert!(highest <= allowed, "{near:?}");
            } else {
                // They have a point in common, and no direction separates them.
                prop_assert!((near.point - foot).norm() < 1e-9);
                for direction in triangle.iter().chain(&corners) {
                    let lowest = direction.dot(&hull.lowest(direction));
                    let each = [a, b, c].map(|p| direction.dot(p));
                    prop_assert!(lowest <= each.into_iter().fold(f64::NEG_INFINITY, f64::max) + 1e-9);
                }
            }
        }

        #[test]
        fn the_nearest_point_of_a_box_is_that_of_geometry(
            point in proptest::array::uniform3(-2.0..2.0_f64),
            half in proptest::array::uniform3(0.1..1.0_f64),
            corners in proptest::array::uniform3(0..8_u8),
            count in 1..4_u8,
        ) {
            let (point, half) = (Vec3::from(point), Vec3::from(half));
            let mut seed = Seed { corners, count };
            let near = cuboid(half).nearest_to_from(&point, &mut seed);
            let again = cuboid(half).nearest_to_from(&point, &mut seed);
            prop_assert!((again.point - near.point).norm() < 1e-9);
            let nearest = point.zip_map(&half, |p, half| p.max(-half).min(half));
            if near.are_apart {
                prop_assert!((near.point - nearest).norm() < 1e-9);
            } else {
                prop_assert!((point - nearest).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn parallel_faces_and_edges_are_as_far_apart_as_their_planes() {
        let plate = cuboid(Vec3::new(0.02, 0.03, 0.0));
        for scale in [1e-3, 0.01, 1.0] {
            let corners = [[-1.0, -1.0], [1.0, -1.0], [0.0, 1.0]];
            let [a, b, c] = corners.map(|[x, y]| Vec3::new(x * scale, y * scale, -0.005));
            let near = plate.nearest([&a, &b, &c]);
            let foot = at([&a, &b, &c], &near.weights);
            assert!(near.are_apart && (near.point - foot - Vec3::z() * 0.005).norm() < 1e-12);
        }
        let edge = [Vec3::new(-0.1, 0.04, 0.0), Vec3::new(0.1, 0.04, 0.0)];
        let near = plate.nearest([&edge[0], &edge[1], &edge[1]]);
        assert!((near.point.y - 0.03).abs() < 1e-15 && near.are_apart);
    }

    #[test]
    fn points_that_are_no_hull_are_refused() {
        assert_eq!(Hull::new(&[]), None);
        assert_eq!(Hull::new(&[Vec3::zeros(); MAX_CORNERS + 1]), None);
        assert_eq!(Hull::new(&[Vec3::new(f64::NAN, 0.0, 0.0)]), None);
        assert_eq!(Hull::new(&[Vec3::zeros()]), Some(Hull::POINT));
    }
}
