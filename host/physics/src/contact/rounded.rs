//! Rounded hulls: all points within a radius of the convex hull of a few points. Spheres and capsules are among them, and the shapes
//! of tools (`rt_core::tool`).

use super::shape::Nearest;
use crate::Vec3;
use nalgebra::{Isometry3, Point3};
use rt_core::hull::{Hull, MAX_CORNERS, Near};

/// The sine of an angle below which three points lie on a line, and the distance, as a fraction of the size of the hull, up to which
/// a point lies in a plane.
const STRAIGHT: f64 = 1e-9;

/// A hull with a radius.
#[derive(Clone, Debug, PartialEq)]
pub struct Rounded {
    hull: Hull,
    radius: f64,
    /// The planes that bound the hull: outward normals, and their distances from the origin (m). A flat hull has its two sides, a
    /// segment and a point have one plane in which they lie.
    planes: Vec<(Vec3, f64)>,
}

impl Rounded {
    /// The points within `radius` (m) of a hull.
    pub fn new(hull: &Hull, radius: f64) -> Self {
        Self {
            planes: planes(hull.corners()),
            hull: *hull,
            radius,
        }
    }

    /// A sphere about the origin.
    pub(super) fn sphere(radius: f64) -> Self {
        Self::new(&Hull::POINT, radius)
    }

    /// All points near a segment of the z axis of this half length (m) about the origin.
    pub(super) fn capsule(half: f64, radius: f64) -> Self {
        let ends = [Vec3::z() * half, Vec3::z() * -half];
        Self::new(&Hull::new(&ends).unwrap_or(Hull::POINT), radius)
    }

    /// The hull.
    pub fn hull(&self) -> &Hull {
        &self.hull
    }

    /// The radius (m).
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The nearest point of the surface to `p` (m). Inside the hull, the direction is that of the nearest plane.
    pub fn nearest(&self, p: &Vec3) -> Nearest {
        let near = self.hull.nearest_to(p);
        let (normal, from) = if near.are_apart {
            let apart = p - near.point;
            (apart / apart.norm(), apart.norm())
        } else {
            let each = self.planes.iter().map(|(n, at)| (*n, n.dot(p) - at));
            let nearest = each.max_by(|a, b| a.1.total_cmp(&b.1));
            nearest.unwrap_or((Vec3::z(), 0.0))
        };
        Nearest {
            distance: from - self.radius,
            normal,
        }
    }

    /// The nearest points of the hull, at a pose, and of a triangle (m); that of the hull in the axes of the hull.
    pub fn near(&self, pose: &Isometry3<f64>, triangle: [&Vec3; 3]) -> Near {
        let own = own(pose, triangle);
        self.hull.nearest(own.each_ref())
    }

    /// The distance of a triangle from the hull at a pose (m).
    pub fn distance_from_hull(&self, pose: &Isometry3<f64>, triangle: [&Vec3; 3]) -> f64 {
        let own = own(pose, triangle);
        self.hull.distance(own.each_ref())
    }

    /// The point of the surface that lies furthest along a direction of length one (m).
    pub fn furthest(&self, direction: &Vec3) -> Vec3 {
        self.hull.lowest(&-direction) + direction * self.radius
    }
}

/// The hull of points (m) with as few corners as leave no point further outside than `tolerance` (m): the furthest point is a corner of
/// the whole hull, and becomes one until none is too far.
///
/// # Errors
/// The distance (m) by which the furthest point lies outside of a hull of [`MAX_CORNERS`] corners.
pub fn hull_of(points: &[Vec3], tolerance: f64) -> Result<Hull, f64> {
    let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f64;
    let mut hull = Hull::new(&[middle]).unwrap_or(Hull::POINT);
    let mut corners: Vec<Vec3> = Vec::new();
    loop {
        let outside = |p: &Vec3| (p - hull.nearest_to(p).point).norm();
        let furthest = points.iter().map(|p| (outside(p), p));
        let Some((distance, point)) = furthest.max_by(|a, b| a.0.total_cmp(&b.0)) else {
            return Ok(hull);
        };
        if !corners.is_empty() && distance <= tolerance {
            return Ok(hull);
        }
        if corners.len() == MAX_CORNERS {
            return Err(distance);
        }
        corners.push(*point);
        hull = Hull::new(&corners).ok_or(f64::INFINITY)?;
    }
}

/// Points in the axes of a pose (m).
fn own(pose: &Isometry3<f64>, points: [&Vec3; 3]) -> [Vec3; 3] {
    points.map(|p| pose.inverse_transform_point(&Point3::from(*p)).coords)
}

/// The planes that bound the hull of points.
fn planes(points: &[Vec3]) -> Vec<(Vec3, f64)> {
    let size = points.iter().map(Vec3::norm).fold(0.0, f64::max);
    let mut planes: Vec<(Vec3, f64)> = Vec::new();
    let mut along = Vec3::zeros();
    for (i, a) in points.iter().enumerate() {
        for (j, b) in points.iter().enumerate().skip(i + 1) {
            if (b - a).norm() > along.norm() {
                along = b - a;
            }
            for c in &points[j + 1..] {
                let (ab, ac) = (b - a, c - a);
                let across = ab.cross(&ac);
                if across.norm() <= STRAIGHT * ab.norm() * ac.norm() {
                    continue;
                }
                for normal in [across.normalize(), -across.normalize()] {
                    let at = normal.dot(a);
                    let is_known = |(n, d): &(Vec3, f64)| {
                        n.dot(&normal) > 1.0 - STRAIGHT && (d - at).abs() <= STRAIGHT * size
                    };
                    let bounds = points.iter().all(|p| normal.dot(p) - at <= STRAIGHT * size);
                    if bounds && !planes.iter().any(is_known) {
                        planes.push((normal, at));
                    }
                }
            }
        }
    }
    if planes.is_empty() {
        let across = along.cross(&Vec3::ith(along.iamin(), 1.0));
        let normal = across.try_normalize(0.0).unwrap_or(Vec3::z());
        planes.push((normal, points.first().map_or(0.0, |p| normal.dot(p))));
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::shape::box_of;

    fn at(x: f64, y: f64, z: f64) -> Vec3 {
        Vec3::new(x, y, z)
    }

    #[test]
    fn a_rounded_box_has_the_distances_of_geometry() {
        let (corners, _) = box_of(&at(0.3, 0.5, 0.7));
        let shape = Rounded::new(&Hull::new(&corners).expect("eight corners"), 0.1);
        assert_eq!(shape.planes.len(), 6);
        let cases = [
            (at(0.6, 0.9, 0.0), 0.4),
            (at(0.0, 0.0, 0.75), -0.05),
            (at(0.25, 0.0, 0.0), -0.15),
            (at(0.0, 0.0, 0.0), -0.4),
        ];
        for (point, expected) in cases {
            let found = shape.nearest(&point);
            assert!(
                (found.distance - expected).abs() < 1e-12,
                "{point} {found:?}"
            );
        }
        assert_eq!(shape.nearest(&at(0.25, 0.0, 0.0)).normal, Vec3::x());
        assert_eq!(shape.furthest(&Vec3::z()).z, 0.7 + 0.1);
    }

    #[test]
    fn a_hull_of_many_points_has_the_corners_alone() {
        let (corners, _) = box_of(&at(0.3, 0.5, 0.7));
        let mut points = corners.clone();
        for [a, b] in [[0, 1], [2, 7], [3, 3]] {
            points.push(corners[a] * 0.4 + corners[b] * 0.5);
        }
        let hull = hull_of(&points, 1e-6).expect("a box");
        assert_eq!(hull.corners().len(), 8);
        // A ball of points has too many corners, unless a part of it may stand out.
        let ball: Vec<Vec3> = (0..2000)
            .map(|k| {
                let (z, turn) = (1.0 - f64::from(k) / 1000.0, 2.4 * f64::from(k));
                let out = (1.0 - z * z).sqrt();
                at(out * turn.cos(), out * turn.sin(), z)
            })
            .collect();
        let outside = hull_of(&ball, 0.01).expect_err("a ball");
        assert!(outside > 0.05 && outside < 0.3, "{outside}");
        assert!(hull_of(&ball, 1.01 * outside).is_ok());
    }

    #[test]
    fn hulls_without_volume_have_a_direction_for_points_in_them() {
        let plate = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        let plate = plate.map(|[x, y]| at(x, y, 0.5));
        for points in [&plate[..], &plate[..2], &plate[..1]] {
            let shape = Rounded::new(&Hull::new(points).expect("few points"), 0.1);
            let middle = points.iter().sum::<Vec3>() / points.len() as f64;
            let found = shape.nearest(&middle);
            assert!((found.distance + 0.1).abs() < 1e-12, "{found:?}");
            let out = shape.nearest(&(middle + found.normal * 0.3)).distance;
            assert!((out - 0.2).abs() < 1e-12, "{out}");
        }
    }
}
