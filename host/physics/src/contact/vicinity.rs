//! The surface of an obstacle near a tool, as triangles: what the tool can touch in the tick.
//!
//! A mesh and a box have triangles of their own. The other shapes get triangles around their nearest point to the tool, with corners that
//! lie on the shape. Those of a plane and of the flat ends of a cylinder are exact. A triangle with sides of length `l` lies by
//! up to `l^2 / (6 R)` below a surface of radius `R`; the nearest point itself is a corner.

use super::obstacle::{Geometry, Obstacle};
use super::shape::Shape;
use crate::Vec3;
use nalgebra::{Isometry3, Point3};
use rt_core::hull::Hull;

/// Corners in a ring around the nearest point of a curved surface.
const RING: usize = 6;
/// Columns of corners on the side of a cylinder.
const COLUMNS: usize = 5;
/// Columns of a cylinder whose axis is as near as its rim.
const AROUND: usize = 7;
/// Largest number of projections to find the nearest point of a hull, and the way (m) of a projection that ends them.
const PROJECTIONS: usize = 100;
const FOUND: f64 = 1e-9;

/// The surface of an obstacle near a tool.
#[derive(Clone, Debug, Default)]
pub struct Vicinity {
    corners: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    near: Vec<(f64, [u32; 3])>,
    are_kept: bool,
}

impl Vicinity {
    /// No shape but a box has more corners near a point.
    pub const MOST_CORNERS: u32 = 16;

    /// The corners (m, world).
    pub fn corners(&self) -> &[Vec3] {
        &self.corners
    }

    /// The triangles within reach, by their distance (m) and corners, counterclockwise seen from outside.
    pub fn triangles(&self) -> &[(f64, [u32; 3])] {
        &self.near
    }

    /// Whether a corner is the same point of the obstacle as the corner of the same number in all other calls.
    pub fn are_kept(&self) -> bool {
        self.are_kept
    }

    /// Finds the triangles of an obstacle at `time` (s) within `reach` (m) of a hull that is moved by `centre` (m). The surface of a
    /// shape is followed for `extent` (m) around its nearest point.
    pub fn find(
        &mut self,
        obstacle: &Obstacle,
        time: f64,
        hull: &Hull,
        centre: &Vec3,
        [reach, extent]: [f64; 2],
    ) {
        self.corners.clear();
        self.triangles.clear();
        self.near.clear();
        let pose = obstacle.pose(time);
        self.are_kept = true;
        match obstacle.geometry() {
            Geometry::Mesh(_) | Geometry::Shape(Shape::Box { .. }) => {
                if let Some((positions, triangles)) = obstacle.surface() {
                    self.corners.resize(positions.len(), Vec3::zeros());
                    obstacle.write_positions(time, &mut self.corners);
                    self.triangles.extend(triangles);
                }
            }
            Geometry::Shape(shape) => {
                self.are_kept = false;
                let p = nearest_point(shape, &pose, hull, centre);
                let own = pose.inverse_transform_point(&Point3::from(p)).coords;
                // A plane is followed under the whole hull at no cost.
                let extent = match shape {
                    Shape::Plane => extent + 2.0 * hull.extent(),
                    _ => extent,
                };
                if shape.nearest(&own).distance <= reach {
                    match shape {
                        Shape::Cylinder { half, radius } => {
                            self.cylinder([*half, *radius], &own, extent);
                        }
                        _ => self.fan(shape, &own, extent),
                    }
                    self.place(&pose);
                }
            }
        }
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|corner| self.corners[corner as usize]);
            let [low, high] = [a.inf(&b).inf(&c), a.sup(&b).sup(&c)];
            if (low - centre).sup(&(centre - high)).max() <= reach + hull.extent() {
                let own = [a, b, c].map(|corner| corner - centre);
                let distance = hull.distance(own.each_ref());
                if distance <= reach {
                    self.near.push((distance, *triangle));
                }
            }
        }
    }

    fn place(&mut self, pose: &Isometry3<f64>) {
        for corner in &mut self.corners {
            *corner = (pose * Point3::from(*corner)).coords;
        }
    }

    /// Two rings of corners around the nearest point of a smooth surface.
    fn fan(&mut self, shape: &Shape, p: &Vec3, extent: f64) {
        let onto = |p: Vec3| {
            let nearest = shape.nearest(&p);
            p - nearest.normal * nearest.distance
        };
        let foot = onto(*p);
        let normal = shape.nearest(p).normal;
        let along = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize();
        let across = normal.cross(&along);
        self.corners.push(foot);
        // A plane needs one ring.
        let rings: &[f64] = if *shape == Shape::Plane {
            &[1.0]
        } else {
            &[0.5, 1.0]
        };
        for part in rings {
            for number in 0..RING {
                let (sin, cos) = (core::f64::consts::TAU * number as f64 / RING as f64).sin_cos();
                let aside = (along * cos + across * sin) * (part * extent);
                self.corners.push(onto(foot + aside));
            }
        }
        let at = |ring: usize, number: usize| (1 + ring * RING + number % RING) as u32;
        for number in 0..RING {
            let (here, next) = (at(0, number), at(0, number + 1));
            self.triangles.push([0, here, next]);
            for ring in 1..rings.len() {
                let (out, beyond) = (at(ring, number), at(ring, number + 1));
                let (here, next) = (at(ring - 1, number), at(ring - 1, number + 1));
                self.triangles
                    .extend([[here, out, beyond], [here, beyond, next]]);
            }
        }
    }

    /// Columns of corners on the side of a cylinder about the z axis, and the sector of its nearer end.
    fn cylinder(&mut self, [half, radius]: [f64; 2], p: &Vec3, extent: f64) {
        let out = p.x.hypot(p.y);
        let is_closed = out < extent || extent > radius;
        let count = if is_closed { AROUND } else { COLUMNS };
        let step = if is_closed {
            core::f64::consts::TAU / AROUND as f64
        } else {
            2.0 * extent / (radius * (COLUMNS - 1) as f64)
        };
        let middle = if is_closed { 0.0 } else { (COLUMNS / 2) as f64 };
        let towards = p.y.atan2(p.x);
        let centre = p.z.clamp(-half, half);
        let ends = [(centre - extent).max(-half), (centre + extent).min(half)];
        for z in ends {
            for number in 0..count {
                let (sin, cos) = (towards + step * (number as f64 - middle)).sin_cos();
                self.corners.push(Vec3::new(radius * cos, radius * sin, z));
            }
        }
        let is_upper = p.z >= 0.0;
        let cap = if is_upper { half } else { -half };
        let tip = self.corners.len() as u32;
        let has_cap = ends[usize::from(is_upper)] == cap;
        if has_cap {
            self.corners.push(Vec3::new(0.0, 0.0, cap));
        }
        let columns = if is_closed { count } else { count - 1 };
        for number in 0..columns {
            let next = (number + 1) % count;
            let [a, b] = [number as u32, next as u32];
            let [above, beyond] = [a + count as u32, b + count as u32];
            self.triangles.extend([[a, b, beyond], [a, beyond, above]]);
            if has_cap {
                self.triangles.push(if is_upper {
                    [tip, above, beyond]
                } else {
                    [tip, b, a]
                });
            }
        }
    }
}

/// The point of a hull, moved by `centre` (m), that is nearest to a shape at a pose: by projections onto the one and onto the other.
pub fn nearest_point(shape: &Shape, pose: &Isometry3<f64>, hull: &Hull, centre: &Vec3) -> Vec3 {
    let onto_hull = |p: Vec3| centre + hull.nearest_to(&(p - centre)).point;
    let mut p = onto_hull(*centre);
    for _ in 0..PROJECTIONS {
        let own = pose.inverse_transform_point(&Point3::from(p)).coords;
        let nearest = shape.nearest(&own);
        let before = p;
        p = onto_hull(p - pose.rotation * nearest.normal * nearest.distance);
        if nearest.distance <= 0.0 || (p - before).norm() < FOUND {
            break;
        }
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::obstacle::Motion;
    use proptest::prelude::*;

    const RADIUS: f64 = 0.05;

    fn shapes() -> impl Strategy<Value = Shape> {
        prop_oneof![
            Just(Shape::Plane),
            Just(Shape::sphere(RADIUS)),
            Just(Shape::capsule(0.04, RADIUS)),
            Just(Shape::Cylinder {
                half: 0.04,
                radius: RADIUS
            }),
            Just(Shape::Box {
                half: Vec3::new(0.04, 0.05, 0.06)
            }),
        ]
    }

    proptest! {
        #[test]
        fn the_triangles_lie_on_the_shape_and_look_outwards(
            shape in shapes(),
            p in proptest::array::uniform3(-0.12..0.12_f64),
            turn in proptest::array::uniform3(-2.0..2.0_f64),
        ) {
            let (reach, extent) = (0.012, 0.006);
            let pose = Isometry3::new(Vec3::new(0.1, -0.2, 0.3), turn.into());
            let own = Vec3::from(p);
            let world = (pose * Point3::from(own)).coords;
            let obstacle = Obstacle::new(Geometry::Shape(shape.clone()), Motion::Still(pose)).unwrap();
            let mut vicinity = Vicinity::default();
            vicinity.find(&obstacle, 0.0, &Hull::POINT, &world, [reach, extent]);
            let nearest = shape.nearest(&own);
            prop_assume!(nearest.distance > 1e-3);
            prop_assert_eq!(nearest.distance > reach, vicinity.triangles().is_empty());
            prop_assert!(vicinity.corners().len() <= Vicinity::MOST_CORNERS as usize);
            for (distance, corners) in vicinity.triangles() {
                let [a, b, c] = corners.map(|corner| vicinity.corners()[corner as usize]);
                // Corners lie on the surface.
                for corner in [a, b, c] {
                    let corner = pose.inverse_transform_point(&Point3::from(corner)).coords;
                    prop_assert!(shape.nearest(&corner).distance.abs() < 1e-9, "{corner}");
                }
                // No triangle is nearer than the shape, and each looks to the side of the point or away from it.
                prop_assert!(*distance >= nearest.distance - 1e-9);
                let centre = (a + b + c) / 3.0;
                let outward = (b - a).cross(&(c - a)).normalize();
                let middle = pose.inverse_transform_point(&Point3::from(centre)).coords;
                let normal = pose.rotation * shape.nearest(&middle).normal;
                prop_assert!(outward.dot(&normal) > 0.6, "{outward} {normal}");
            }
            if nearest.distance <= reach {
                // The nearest triangle is as near as the shape: its corner is the nearest point, or lies beside it.
                let least = vicinity.triangles().iter().map(|of| of.0).fold(f64::INFINITY, f64::min);
                let sagitta = extent * extent / (6.0 * RADIUS);
                prop_assert!(least - nearest.distance < sagitta, "{least} {nearest:?}");
            }
        }
    }
}
