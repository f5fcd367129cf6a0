//! The two curves that join the points of a motion: the minimum-jerk step and the cubic Hermite segment.

use rt_core::Vec3;

/// Value and slope of the minimum-jerk step (Flash & Hogan 1985) at `s` from zero to one. At both ends, slope and
/// curvature are zero. The largest slope is 1.875.
pub fn minimum_jerk(s: f64) -> (f64, f64) {
    let s = s.clamp(0.0, 1.0);
    let rest = 1.0 - s;
    (
        s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
        30.0 * s * s * rest * rest,
    )
}

/// One end of a Hermite segment: position (m) and velocity (m/s).
pub(crate) type Knot = (Vec3, Vec3);

/// Position and velocity on the cubic that meets the positions and velocities of both ends. The ends are `duration` (s)
/// apart; `s` is the fraction of that time.
pub(crate) fn hermite(from: &Knot, to: &Knot, duration: f64, s: f64) -> Knot {
    let rest = 1.0 - s;
    let displacement = to.0 - from.0;
    let position = from.0
        + displacement * (s * s * (3.0 - 2.0 * s))
        + (from.1 * rest - to.1 * s) * (duration * s * rest);
    let velocity = displacement * (6.0 * s * rest / duration)
        + from.1 * (rest * (1.0 - 3.0 * s))
        + to.1 * (s * (3.0 * s - 2.0));
    (position, velocity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_reproduced() {
        let cubic = |t: f64| {
            let p = Vec3::new(1.0 + t - 2.0 * t * t + 0.5 * t * t * t, t, t * t);
            let v = Vec3::new(1.0 - 4.0 * t + 1.5 * t * t, 1.0, 2.0 * t);
            (p, v)
        };
        for k in 0..=10 {
            let s = f64::from(k) / 10.0;
            let (p, v) = hermite(&cubic(0.3), &cubic(0.8), 0.5, s);
            let (p_true, v_true) = cubic(0.3 + 0.5 * s);
            // Rounding of a dozen operations on numbers of order one.
            assert!((p - p_true).norm() < 1e-14 && (v - v_true).norm() < 1e-13);
        }
    }
}
