//! A person's hand: an arm that follows a trajectory, and trembles.
//!
//! The arm is a mass, a spring and a damper; the spring and the damper reach to where the hand wants to be
//! (its aim), the mass moves with the handle, which the hand holds rigidly. That is the usual second-order
//! model of a relaxed arm, good for the first fraction of a second after a push, before reflexes. Of a device
//! of six degrees of freedom it also holds the handle's rotation, by the wrist.

use crate::arm::{Arm, Wrist};
use crate::curve::{Knot, hermite};
use crate::trajectory::Trajectory;
use crate::tremor::Tremor;
use rt_core::Vec3;

/// A hand that wants to be somewhere.
#[derive(Clone, Debug)]
pub struct Hand {
    /// What it feels like from the handle.
    pub arm: Arm,
    /// What turning the handle feels like; the hand goes on wanting the orientation at the start.
    pub wrist: Wrist,
    /// Where it wants to be.
    pub trajectory: Trajectory,
    /// How it trembles, if at all.
    pub tremor: Option<Tremor>,
}

impl Hand {
    /// A typical arm on a trajectory, without tremor.
    pub fn new(trajectory: Trajectory) -> Self {
        Self {
            arm: Arm::TYPICAL,
            wrist: Wrist::default(),
            trajectory,
            tremor: None,
        }
    }

    /// The same with another arm.
    pub fn with_arm(self, arm: Arm) -> Self {
        Self { arm, ..self }
    }

    /// The same with another wrist.
    pub fn with_wrist(self, wrist: Wrist) -> Self {
        Self { wrist, ..self }
    }

    /// The same with a tremor.
    pub fn with_tremor(self, tremor: Tremor) -> Self {
        Self {
            tremor: Some(tremor),
            ..self
        }
    }

    /// Where it wants to be: displacement from its start (m) and velocity (m/s) at `time` (s).
    pub fn aim(&self, time: f64) -> (Vec3, Vec3) {
        let (mut position, mut velocity) = self.trajectory.at(time);
        if let Some(tremor) = &self.tremor {
            let (p, v) = tremor.at(time);
            position += p;
            velocity += v;
        }
        (position, velocity)
    }
}

/// The aim between whole milliseconds, by the cubic through both ends.
///
/// A substep asks every few tens of microseconds and a hand has nothing to say above 12 Hz: the cubic errs
/// by `(2 pi f dt)^4 / 384`, 1e-7 of the amplitude at 12 Hz. The milliseconds are the hand's own, so what it
/// does depends on nobody's steps.
#[derive(Clone, Debug)]
pub(crate) struct Aim {
    hand: Hand,
    /// Number of the millisecond that `from` stands at; `to` is one later.
    at_ms: u64,
    from: Knot,
    to: Knot,
}

const MS_NS: u64 = 1_000_000;

impl Aim {
    pub(crate) fn new(hand: Hand) -> Self {
        let (from, to) = (hand.aim(0.0), hand.aim(1e-3));
        Self {
            hand,
            at_ms: 0,
            from,
            to,
        }
    }

    pub(crate) fn arm(&self) -> Arm {
        self.hand.arm
    }

    /// Displacement (m) at `time_ns`.
    pub(crate) fn at(&mut self, time_ns: u64) -> Vec3 {
        let ms = time_ns / MS_NS;
        if ms != self.at_ms {
            let next = |ms: u64| self.hand.aim(ms as f64 * 1e-3);
            self.from = if ms == self.at_ms + 1 {
                self.to
            } else {
                next(ms)
            };
            self.to = next(ms + 1);
            self.at_ms = ms;
        }
        let fraction = (time_ns % MS_NS) as f64 / MS_NS as f64;
        hermite(&self.from, &self.to, 1e-3, fraction).0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::Sine;

    #[test]
    fn the_aim_between_milliseconds_is_the_hands() {
        let sine = Sine {
            amplitude: Vec3::new(0.02, 0.0, 0.0),
            frequency: 5.0,
            phase: 0.0,
        };
        let hand = Hand::new(Trajectory::new_sines(&[sine], 0.2).unwrap())
            .with_tremor(Tremor::new(1e-4, 3).unwrap());
        let mut aim = Aim::new(hand.clone());
        // Steps that meet no millisecond, then a jump ahead and one back.
        for time_ns in (0..3000)
            .map(|k| k * 333_333)
            .chain([9_000_000_000, 1_234_567])
        {
            let (exact, _) = hand.aim(time_ns as f64 * 1e-9);
            // (2 pi f dt)^4 / 384 of 20 mm at 5 Hz and of 0.1 mm * sqrt(12) at 12 Hz: 0.05 nm each; while it
            // fades in over 0.2 s a few times as much.
            assert!((aim.at(time_ns) - exact).norm() < 0.3e-9);
        }
    }
}
