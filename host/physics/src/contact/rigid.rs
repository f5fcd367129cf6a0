//! The rigid motion that fits a motion of points, and how far the points depart from it.
//!
//! Distances between points do not change under a rigid motion. If two clusters move by a rigid motion and by at most
//! `a` and `b` beside it, the distance of no pair of their points changes by more than `a + b`. The proof holds for any
//! rotation; the best rotation gives the smallest departures. Newton steps find the rotation from that of the previous
//! step (its conditions: Horn, Hilden and Negahdaripour, "Closed-form solution of absolute orientation using orthonormal
//! matrices", 1988).

use crate::{Mat3, Vec3};
use nalgebra::{Unit, UnitQuaternion};

/// Newton steps for the rotation. Two follow a turn of 0.1 rad to 1e-9.
const ITERATIONS: usize = 2;

/// A rigid motion.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    rotation: Mat3,
    /// The centre of the points before the motion, and after it (m).
    from: Vec3,
    to: Vec3,
}

impl Motion {
    /// Nothing moves.
    pub fn none() -> Self {
        Self {
            rotation: Mat3::identity(),
            from: Vec3::zeros(),
            to: Vec3::zeros(),
        }
    }

    /// The rigid motion of `count` points from `before` to `after` (m). `rotation` is the rotation to begin with, and
    /// then that of the motion.
    pub fn fit(
        count: usize,
        before: impl Fn(usize) -> Vec3,
        after: impl Fn(usize) -> Vec3,
        rotation: &mut UnitQuaternion<f64>,
    ) -> Self {
        if count == 0 {
            return Self::none();
        }
        let (mut from, mut to) = (Vec3::zeros(), Vec3::zeros());
        for i in 0..count {
            from += before(i);
            to += after(i);
        }
        from /= count as f64;
        to /= count as f64;
        let mut moments = Mat3::zeros();
        for i in 0..count {
            let (here, there) = (before(i) - from, after(i) - to);
            for column in 0..3 {
                let mut sum = moments.column_mut(column);
                sum += there * here[column];
            }
        }
        turn(&moments, rotation);
        Self {
            rotation: rotation.to_rotation_matrix().into_inner(),
            from,
            to,
        }
    }

    /// The square of the distance (m²) between where a point came and where the motion would have brought it.
    pub fn departure(&self, before: &Vec3, after: &Vec3) -> f64 {
        ((after - self.to) - self.rotation * (before - self.from)).norm_squared()
    }
}

/// The largest departures (m) of the first `split` points, and of the other ones, from a rigid motion of all from
/// `before` to `after`. `rotation` is as in [`Motion::fit`].
pub fn departure(
    before: &[Vec3],
    after: impl Fn(usize) -> Vec3,
    split: usize,
    rotation: &mut UnitQuaternion<f64>,
) -> [f64; 2] {
    let motion = Motion::fit(before.len(), |i| before[i], &after, rotation);
    let mut most = [0.0_f64; 2];
    for (i, x) in before.iter().enumerate() {
        let side = usize::from(i >= split);
        most[side] = most[side].max(motion.departure(x, &after(i)));
    }
    most.map(f64::sqrt)
}

/// Turns `rotation` towards the rotational part of `moments`: Newton steps for the largest sum of products of the turned
/// points with where they came.
fn turn(moments: &Mat3, rotation: &mut UnitQuaternion<f64>) {
    for _ in 0..ITERATIONS {
        let turned = moments * rotation.to_rotation_matrix().into_inner().transpose();
        let axis = Vec3::new(
            turned[(2, 1)] - turned[(1, 2)],
            turned[(0, 2)] - turned[(2, 0)],
            turned[(1, 0)] - turned[(0, 1)],
        );
        let trace = turned.trace();
        // The small addition serves points on a line, which have no rotation about it.
        let slope =
            Mat3::from_diagonal_element(trace * (1.0 + 1e-9)) - (turned + turned.transpose()) * 0.5;
        let Some(inverse) = slope.try_inverse() else {
            return;
        };
        let step = inverse * axis;
        let angle = step.norm();
        // No turn is left, or the points have no extent.
        if !(angle > 1e-15 && angle < 1.0) {
            return;
        }
        let by = UnitQuaternion::from_axis_angle(&Unit::new_unchecked(step / angle), angle);
        *rotation = by * *rotation;
        rotation.renormalize_fast();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Vec3> {
        let coordinate = |i: u32, k: u32| f64::from((i * 37 + k * 11) % 17) / 17.0;
        (0..20)
            .map(|i| Vec3::new(coordinate(i, 1), coordinate(i, 2), coordinate(i, 3)))
            .collect()
    }

    #[test]
    fn a_rigid_motion_has_no_departure_and_a_bump_has_its_height() {
        let before = points();
        let mut rotation = UnitQuaternion::identity();
        // Twenty steps of 0.1 rad, and a translation.
        for step in 1..=20 {
            let axis = Vec3::new(0.3, -0.5, 0.8);
            let turn = UnitQuaternion::from_scaled_axis(axis.normalize() * (0.1 * f64::from(step)));
            let shift = Vec3::new(0.1, 0.2, -0.4) * f64::from(step);
            let at = |i: usize| turn * before[i] + shift;
            let apart = departure(&before, at, 10, &mut rotation);
            // The error of a Newton step is at most the cube of the turn before it: 1e-3, then 1e-9.
            assert!(apart.iter().all(|a| *a < 1e-8), "{step} {apart:?}");
        }
        let bump = |i: usize| {
            before[i]
                + if i == 3 {
                    Vec3::z() * 0.01
                } else {
                    Vec3::zeros()
                }
        };
        let mut rotation = UnitQuaternion::identity();
        let [first, second] = departure(&before, bump, 10, &mut rotation);
        assert!(
            (0.008..0.0101).contains(&first) && second < 0.003,
            "{first} {second}"
        );
    }

    #[test]
    fn one_point_and_points_on_a_line_have_a_departure() {
        let mut rotation = UnitQuaternion::identity();
        let one = [Vec3::x()];
        assert_eq!(departure(&one, |_| Vec3::y(), 1, &mut rotation), [0.0; 2]);
        let line: Vec<Vec3> = (0..5).map(|i| Vec3::x() * f64::from(i)).collect();
        for step in 1..=15 {
            let angle = 0.1 * f64::from(step);
            let along = Vec3::new(angle.cos(), angle.sin(), 0.0);
            let apart = departure(&line, |i| along * (i as f64), 2, &mut rotation);
            assert!(apart.iter().all(|a| *a < 1e-7), "{step} {apart:?}");
        }
        assert_eq!(
            departure(&[], |_| Vec3::zeros(), 0, &mut rotation),
            [0.0; 2]
        );
    }
}
