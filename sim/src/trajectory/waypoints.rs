//! Reaches: minimum-jerk segments between points of rest (Flash & Hogan 1985).
//!
//! A hand that reaches a distance `d` in the time `T` moves along `d (10 s^3 - 15 s^4 + 6 s^5)` with `s = t / T`. Its
//! peak velocity is `1.875 d / T`, at half time.

use super::{TrajectoryError, check_timed};
use crate::curve::{Knot, minimum_jerk};
use rt_core::Vec3;

#[derive(Clone, Debug)]
pub(super) struct Waypoints {
    /// Time (s) and displacement from the first waypoint (m).
    points: Vec<(f64, Vec3)>,
    /// Whether the motion repeats after the last waypoint.
    again: bool,
}

impl Waypoints {
    pub(super) fn new(waypoints: &[(f64, Vec3)]) -> Result<Self, TrajectoryError> {
        check_timed(waypoints, 1)?;
        let first = waypoints
            .first()
            .map_or((0.0, Vec3::zeros()), |point| *point);
        if first.0 < 0.0 {
            return Err(TrajectoryError::BeforeStart { found: first.0 });
        }
        Ok(Self {
            points: waypoints.iter().map(|(t, p)| (*t, p - first.1)).collect(),
            again: false,
        })
    }

    /// A motion that repeats. The motion must end at its start.
    pub(super) fn new_cycle(waypoints: &[(f64, Vec3)]) -> Result<Self, TrajectoryError> {
        check_timed(waypoints, 2)?;
        let path = Self::new(waypoints)?;
        match path.points.last() {
            Some((_, last)) if *last != Vec3::zeros() => {
                Err(TrajectoryError::Open { found: last.norm() })
            }
            _ => Ok(Self {
                again: true,
                ..path
            }),
        }
    }

    pub(super) fn at(&self, time: f64) -> Knot {
        let time = match (self.points.first(), self.points.last()) {
            (Some((first, _)), Some((last, _))) if self.again && time >= *last => {
                first + (time - first) % (last - first)
            }
            _ => time,
        };
        let next = self.points.partition_point(|(t, _)| *t <= time);
        let before = next.checked_sub(1).and_then(|k| self.points.get(k));
        match (before, self.points.get(next)) {
            (Some((t0, p0)), Some((t1, p1))) => {
                let duration = t1 - t0;
                let (value, slope) = minimum_jerk((time - t0) / duration);
                let displacement = p1 - p0;
                (p0 + displacement * value, displacement * (slope / duration))
            }
            (Some((_, held)), None) | (None, Some((_, held))) => (*held, Vec3::zeros()),
            (None, None) => (Vec3::zeros(), Vec3::zeros()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_reach_starts_and_ends_at_rest_and_peaks_at_1_875_of_its_mean_velocity() {
        let to = Vec3::new(0.03, -0.04, 0.0);
        let origin = Vec3::new(1.0, 2.0, 3.0);
        let reach = Waypoints::new(&[(0.5, origin), (1.3, origin + to)]).unwrap();
        assert_eq!(reach.at(0.2), (Vec3::zeros(), Vec3::zeros()));
        assert_eq!(reach.at(0.5), (Vec3::zeros(), Vec3::zeros()));
        let (p, v) = reach.at(1.3);
        // `origin + to - origin` rounds at the size of `origin`.
        assert!((p - to).norm() < 1e-15 && v == Vec3::zeros());
        let (p, v) = reach.at(0.9);
        // As above, and a few roundings of numbers below 0.1.
        assert!((p - to / 2.0).norm() < 1e-15);
        assert!((v.norm() - 1.875 * 0.05 / 0.8).abs() < 1e-14);
        let peak = (0..=800).map(|k| reach.at(0.5 + 1e-3 * f64::from(k)).1.norm());
        assert!(peak.fold(0.0, f64::max) <= 1.875 * 0.05 / 0.8 + 1e-14);
        // The acceleration vanishes at the ends: near them, the velocity grows as the square of time, 30 d t^2 / T^3.
        let (_, v) = reach.at(0.5 + 1e-4);
        // The next term is 2 t / T = 2.5e-4 of it; rounding of t about 1e-12.
        assert!((v.norm() / (30.0 * 0.05 * 1e-8 / 0.512) - 1.0).abs() < 3e-4);
    }

    #[test]
    fn a_cycle_begins_anew_and_must_close() {
        let out = Vec3::new(0.01, 0.0, 0.0);
        let points = [(0.5, Vec3::zeros()), (0.75, out), (1.5, Vec3::zeros())];
        let once = Waypoints::new(&points).unwrap();
        let cycle = Waypoints::new_cycle(&points).unwrap();
        for k in 0..150 {
            // Eighths and halves of numbers near one: the times are exact.
            let t = f64::from(k) / 128.0;
            assert_eq!(cycle.at(t), once.at(t));
            if t >= 0.5 {
                assert_eq!(cycle.at(t + 3.0), once.at(t));
            }
        }
        assert_eq!(
            Waypoints::new_cycle(&points[..2]).unwrap_err(),
            TrajectoryError::Open { found: 0.01 }
        );
    }

    proptest! {
        #[test]
        fn each_point_is_met_at_rest_and_velocity_is_the_slope(
            steps in proptest::collection::vec((0.1..2.0_f64, -0.1..0.1_f64, -0.1..0.1_f64), 1..8),
            fraction in 0.05..0.95_f64,
        ) {
            let mut time = 0.0;
            let mut points = vec![(0.0, Vec3::zeros())];
            for (dt, x, z) in steps {
                time += dt;
                points.push((time, Vec3::new(x, 0.0, z)));
            }
            let path = Waypoints::new(&points).unwrap();
            for (t, p) in &points {
                prop_assert_eq!(path.at(*t), (*p, Vec3::zeros()));
            }
            let t = fraction * time;
            let h = 1e-5;
            let slope = (path.at(t + h).0 - path.at(t - h).0) / (2.0 * h);
            // Central difference: h^2 / 6 times the largest jerk (60 d / T^3 = 12,000 m/s^3) is 2e-7. Across a
            // waypoint, where the jerk jumps, the error is at most three times as large; rounding 1e-17 / h = 1e-12.
            prop_assert!((slope - path.at(t).1).norm() < 6e-7 * 2.0);
        }
    }
}
