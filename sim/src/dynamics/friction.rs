//! When Coulomb friction brings something to rest and when it lets go, as times within a step.
//!
//! Between two events the steps of [`super`] are smooth; an event is where a step must be split. Both times
//! are roots of the step's own equations, so a step of that length ends exactly at rest or exactly at the
//! limit of friction.

use rt_core::Vec3;

/// Most pieces that one step is split into. A handle that slides to a stop and leaves again takes three; the
/// rest is for a direction that turns within the step. What is left after the last is taken in one.
pub(super) const PIECES: u32 = 8;
/// Speed left where a step was to end at rest, as a fraction of the speed before, that is rounding.
pub(super) const ROUNDING: f64 = 1e-9;
/// The same, that is a small enough part for friction to take where the other forces do not move it.
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
    /// Stiffness of the spring that acts on it (N/m).
    pub(super) stiffness: f64,
    /// How fast the spring's other end moves along the motion (m/s).
    pub(super) aim_speed: f64,
}

impl Slide {
    /// How long a step of the midpoint rule must be for the speed at its end to be zero (s), if it is below
    /// `within`. With mean velocity `v / 2` the step's equation reads, times `h`,
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

/// How long friction still holds what pulls with `pull` (N) now and with `rate` (N/s) more every second, if
/// it is below `within` (s). `pull` must not be beyond `friction`.
pub(super) fn holds_for(pull: &Vec3, rate: &Vec3, friction: f64, within: f64) -> Option<f64> {
    // It holds to the end where it holds there: what friction can hold is a ball, which is convex.
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
    // The sum that does not cancel, then the other root by their product.
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
        // (t - 1)(t - 3), its negative, a line, a double root, none, one that cancels badly.
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
