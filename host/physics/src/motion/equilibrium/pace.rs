//! The part of its displacement that an iteration takes, by the last two (Irons and Tuck, "A version of the Aitken accelerator for
//! computer iteration", 1969).
//!
//! The tangent of contacts leaves out that their normals and feet follow the bodies. Under a pressure of a tenth of Young's
//! modulus the iterations swing about the balance without end. A swing is seen in two displacements against each other.

use crate::Vec3;

/// The least part that is taken.
const LEAST: f64 = 0.2;

/// The last iteration.
#[derive(Debug, Default)]
pub(super) struct Pace {
    /// The part that was taken, and the displacements (m) that were solved; empty if there are none to compare with.
    part: f64,
    last: Vec<Vec3>,
}

impl Pace {
    /// The part of the displacements `now` (m) to take.
    pub(super) fn next(&mut self, now: Vec<Vec3>) -> f64 {
        let (mut along, mut square) = (0.0, 0.0);
        for (last, now) in self.last.iter().zip(&now) {
            let change = now - last;
            along += last.dot(&change);
            square += change.norm_squared();
        }
        let part = if square > 0.0 {
            -self.part * along / square
        } else {
            1.0
        };
        self.part = part.clamp(LEAST, 1.0);
        self.last = now;
        self.part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Iterations that swing ever further come to rest, those that fall are not slowed.
    #[test]
    fn a_swing_comes_to_rest() {
        for (factor, slowed) in [(-1.2, true), (-0.5, true), (0.3, false)] {
            let (mut pace, mut apart, mut least) = (Pace::default(), Vec3::new(1.0, 2.0, 0.0), 1.0);
            for _ in 0..6 {
                let part = pace.next(vec![apart * (factor - 1.0)]);
                least = f64::min(least, part);
                apart += apart * ((factor - 1.0) * part);
            }
            assert!(apart.norm() < 1e-2, "{factor}: {apart}");
            assert_eq!(least < 1.0, slowed, "{factor}: {least}");
        }
    }
}
