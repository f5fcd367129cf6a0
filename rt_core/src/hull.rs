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
/// A distance (m) below which a hull and a triangle meet: ten thousand times less than any device renders.
const MEETS: f64 = 1e-10;
/// The volume of a tetrahedron, as a fraction of that of its edges, below which it is flat.
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

/// A corner of the hull and a corner of the triangle.
#[derive(Clone, Copy, Debug)]
struct Pair {
    /// From the triangle to the hull (m).
    apart: Vec3,
    on_hull: Vec3,
    /// The corner of the triangle, as weights.
    weights: [f64; 3],
}

/// Up to four pairs, with weights that sum to one.
type Simplex = heapless::Vec<(Pair, f64), 4>;

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

    /// The nearest points of the hull and a triangle (m). Three equal corners are a point.
    pub fn nearest(&self, triangle: [&Vec3; 3]) -> Near {
        let [first, ..] = &self.corners;
        let near = weights(first, triangle);
        let mut apart = first - at(triangle, &near);
        let mut found = Near {
            weights: near,
            point: *first,
            are_apart: apart.norm_squared() > MEETS * MEETS,
        };
        if self.count == 1 {
            return found;
        }
        let mut simplex = Simplex::new();
        let mut least = f64::INFINITY;
        for _ in 0..ROUNDS {
            let squared = apart.norm_squared();
            let pair = self.furthest(&apart, triangle);
            if !simplex.is_empty() && squared - apart.dot(&pair.apart) <= SHORTER * squared {
                break;
            }
            let mut next = simplex.clone();
            // There is room: a simplex of four ends the search.
            let _ = next.push((pair, 0.0));
            let next = reduced(&next);
            apart = sum(&next, |pair| pair.apart);
            // Rounding ends the search.
            if apart.norm_squared() >= least {
                break;
            }
            (simplex, least) = (next, apart.norm_squared());
            found.are_apart = least > MEETS * MEETS;
            if !found.are_apart {
                break;
            }
        }
        found.point = sum(&simplex, |pair| pair.on_hull);
        let [a, b, c] = &mut found.weights;
        (*a, *b, *c) = (0.0, 0.0, 0.0);
        for (pair, weight) in &simplex {
            let [x, y, z] = pair.weights;
            (*a, *b, *c) = (*a + x * weight, *b + y * weight, *c + z * weight);
        }
        found
    }

    /// The distance of a triangle from the hull (m).
    pub fn distance(&self, triangle: [&Vec3; 3]) -> f64 {
        let near = self.nearest(triangle);
        (near.point - at(triangle, &near.weights)).norm()
    }

    /// The nearest point of the hull to a point (m).
    pub fn nearest_to(&self, point: &Vec3) -> Near {
        self.nearest([point; 3])
    }

    /// The pair of corners that lies furthest against a direction.
    fn furthest(&self, direction: &Vec3, triangle: [&Vec3; 3]) -> Pair {
        let on_hull = self.lowest(direction);
        let [a, b, c] = triangle.map(|corner| direction.dot(corner));
        let [p, q, r] = triangle;
        let (on_triangle, weights) = if a >= b && a >= c {
            (p, [1.0, 0.0, 0.0])
        } else if b >= c {
            (q, [0.0, 1.0, 0.0])
        } else {
            (r, [0.0, 0.0, 1.0])
        };
        Pair {
            apart: on_hull - on_triangle,
            on_hull,
            weights,
        }
    }
}

/// The point of a triangle of these weights.
fn at([a, b, c]: [&Vec3; 3], [x, y, z]: &[f64; 3]) -> Vec3 {
    a * *x + b * *y + c * *z
}

fn sum(simplex: &Simplex, of: impl Fn(&Pair) -> Vec3) -> Vec3 {
    let each = simplex.iter();
    each.fold(Vec3::zeros(), |sum, (pair, weight)| {
        sum + of(pair) * *weight
    })
}

/// The pairs of the least simplex on which the point nearest to the origin lies, with the weights of that point.
fn reduced(simplex: &Simplex) -> Simplex {
    match simplex.as_slice() {
        [(a, _), (b, _), (c, _), (d, _)] => {
            let corners = [a, b, c, d];
            if let Some(weights) = inside(corners.map(|pair| &pair.apart)) {
                return corners.into_iter().copied().zip(weights).collect();
            }
            let mut nearest = on_face([a, b, c]);
            let mut least = f64::INFINITY;
            for face in [[a, b, c], [a, b, d], [b, c, d], [c, a, d]] {
                let face = on_face(face);
                let squared = sum(&face, |pair| pair.apart).norm_squared();
                if squared < least {
                    (nearest, least) = (face, squared);
                }
            }
            nearest
        }
        [(a, _), (b, _), (c, _)] => on_face([a, b, c]),
        [(a, _), (b, _)] => on_face([a, b, b]),
        [(a, _)] => on_face([a, a, a]),
        _ => Simplex::new(),
    }
}

/// The corners of a triangle of pairs on which the point nearest to the origin lies.
fn on_face(pairs: [&Pair; 3]) -> Simplex {
    let near = weights(&Vec3::zeros(), pairs.map(|pair| &pair.apart));
    let mut simplex = Simplex::new();
    for (pair, weight) in pairs.into_iter().zip(near) {
        if weight > 0.0 {
            // There is room for three.
            let _ = simplex.push((*pair, weight));
        }
    }
    simplex
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
        ) {
            let corners: Vec<Vec3> = hull.iter().map(|p| p + Vec3::from(moved)).collect();
            let hull = Hull::new(&corners).expect("few corners");
            let [a, b, c] = [0, 1, 2].map(|k| &triangle[k]);
            let near = hull.nearest([a, b, c]);
            let foot = at([a, b, c], &near.weights);
            let apart = near.point - foot;
            if near.are_apart {
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
        ) {
            let (point, half) = (Vec3::from(point), Vec3::from(half));
            let near = cuboid(half).nearest_to(&point);
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
