//! The times within a step at which Coulomb friction stops a motion or releases it.
//!
//! Between two events, the steps of [`super`] are smooth. At an event, a step must be split. Both times are roots of
//! the step's own equations, so a step of that length ends exactly at rest or exactly at the limit of friction.

use rt_core::Vec3;

/// Largest number of pieces of one step. A handle that slides to a stop and leaves again takes three pieces; the other
/// pieces are for a direction that turns within the step. The remainder of the step is taken as the last piece.
pub(super) const PIECES: u32 = 8;
/// Fraction of the earlier speed that counts as rounding at the end of a step that should end at rest.
pub(super) const ROUNDING: f64 = 1e-9;
/// Fraction of the earlier speed that friction may take, if the other forces do not move the handle.
pub(super) const SMALL: f64 = 0.125;

/// A slide along one direction that may come to rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slide {
    /// Mass (kg).
    pub(super) mass: f64,
    /// Speed at the start (m/s).
    pub(super) speed: f64,
    /// Damping on the speed (N s/m).
    pub(super) damping: f64,
    /// Coulomb friction (N).
    pub(super) friction: f64,
    /// The other forces along the motion at the start (N).
    pub(super) drive: f64,
    /// Stiffness of the spring that acts on the mass (N/m).
    pub(super) stiffness: f64,
    /// Speed of the spring's other end along the motion (m/s).
    pub(super) aim_speed: f64,
}

impl Slide {
    /// Duration of a step of the midpoint rule at whose end the speed is zero (s), if it is below `within`. With mean
    /// velocity `v / 2`, the step's equation times `h` reads
    ///
    /// ```text
    /// -M v + h (b v / 2 + f_c - r) + h^2 k (v / 4 - a' / 2) = 0
    /// ```
    pub(super) fn rests_after(&self, within: f64) -> Option<f64> {
        let decided = self.damping * self.speed * 0.5 + self.friction - self.drive;
        let spring = self.stiffness * (0.25 * self.speed - 0.5 * self.aim_speed);
        first_root(-self.mass * self.speed, decided, spring, within)
    }
}

/// Time for which friction holds a pull of `pull` (N) that changes at `rate` (N/s), if it is below `within` (s). `pull`
/// must not exceed `friction`.
pub(super) fn holds_for(pull: &Vec3, rate: &Vec3, friction: f64, within: f64) -> Option<f64> {
    // The forces that friction can hold form a ball, which is convex: if friction holds at the end, it holds
    // throughout.
    if (pull + rate * within).norm() <= friction {
        return None;
    }
    let constant = pull.norm_squared() - friction * friction;
    if constant >= 0.0 {
        return Some(0.0);
    }
    first_root(constant, 2.0 * pull.dot(rate), rate.norm_squared(), within)
}

/// The smallest root of `c0 + c1 t + c2 t^2` above zero and below `within`.
fn first_root(c0: f64, c1: f64, c2: f64, within: f64) -> Option<f64> {
    let discriminant = c1 * c1 - 4.0 * c0 * c2;
    if discriminant < 0.0 {
        return None;
    }
    // Computes the sum that does not cancel, then the other root from the product of the roots.
    let q = -0.5 * (c1 + discriminant.sqrt().copysign(c1));
    let inside = |t: &f64| *t > 0.0 && *t < within;
    let (a, b) = (q / c2, c0 / q);
    match (inside(&a), inside(&b)) {
        (true, true) => Some(a.min(b)),
        (true, false) => Some(a),
        (false, true) => Some(b),
        (false, false) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_root_is_found_wherever_it_lies() {
        // (t - 1)(t - 3), its negative, a line, a double root, no root, and a root with bad cancellation.
        for (c, expected) in [
            ([3.0, -4.0, 1.0], Some(1.0)),
            ([-3.0, 4.0, -1.0], Some(1.0)),
            ([-2.0, 4.0, 0.0], Some(0.5)),
            ([4.0, -4.0, 1.0], Some(2.0)),
            ([1.0, 0.0, 1.0], None),
            ([3.0, 4.0, 1.0], None),
            ([-1.0, 0.0, 0.0], None),
        ] {
            assert_eq!(first_root(c[0], c[1], c[2], 10.0), expected, "{c:?}");
        }
        assert_eq!(first_root(3.0, -4.0, 1.0, 0.9), None);
        let small = first_root(-1e-12, 1.0, 1.0, 1.0).unwrap();
        // 1e-12 (1 - 1e-12): rounding.
        assert!((small / 1e-12 - 1.0).abs() < 2e-12);
    }

    #[test]
    fn friction_holds_until_the_pull_reaches_it() {
        let (pull, rate) = (Vec3::new(0.3, 0.0, 0.0), Vec3::new(0.0, 4.0, 0.0));
        // 0.3^2 + (4 t)^2 = 0.5^2 at t = 0.1.
        let time = holds_for(&pull, &rate, 0.5, 1.0).unwrap();
        assert!((time - 0.1).abs() < 1e-15);
        assert_eq!(holds_for(&pull, &rate, 0.5, 0.099), None);
        assert_eq!(holds_for(&pull, &(-pull), 0.5, 1.9), None);
    }
}
