//! A person's hand: an arm that follows a trajectory, with tremor.
//!
//! The arm is a mass, a spring and a damper. The spring and the damper act between the handle and the aim of the hand.
//! The mass moves with the handle, which the hand holds rigidly. This is the usual second-order model of a relaxed arm,
//! valid for the first fraction of a second after a push, before reflexes. On a device of six degrees of freedom, the
//! wrist also holds the handle's rotation.

use crate::arm::{Arm, Wrist};
use crate::curve::{Knot, hermite};
use crate::trace::{Felt, Trace, Tracing};
use crate::trajectory::Trajectory;
use crate::tremor::Tremor;
use nalgebra::UnitQuaternion;
use rt_core::Vec3;

/// A button that a hand holds down for a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Press {
    /// The button, from zero to fifteen.
    pub button: u8,
    /// Start (s).
    pub from: f64,
    /// End (s).
    pub to: f64,
}

/// A hand with an aim.
///
/// ```
/// use rt_core::Vec3;
/// use sim::{Arm, Hand, Trajectory, Tremor};
///
/// // A firm grip that moves 20 mm along x in half a second, with a tremor of 0.1 mm.
/// let path = [(0.0, Vec3::zeros()), (0.5, Vec3::new(0.02, 0.0, 0.0))];
/// let hand = Hand::new(Trajectory::new_waypoints(&path).unwrap())
///     .with_arm(Arm::FIRM)
///     .with_tremor(Tremor::new(1e-4, 7).unwrap());
/// assert_eq!(hand.aim(0.0), (Vec3::zeros(), Vec3::zeros()));
/// let (displacement, _) = hand.aim(2.0);
/// assert!((displacement - Vec3::new(0.02, 0.0, 0.0)).norm() < 5e-4);
/// ```
#[derive(Clone, Debug)]
pub struct Hand {
    /// The arm's impedance at the handle.
    pub arm: Arm,
    /// The wrist's impedance at the handle.
    pub wrist: Wrist,
    /// The aim of the hand over time.
    pub trajectory: Trajectory,
    /// The rotation vector (rad) of the orientation at which the wrist aims over time; `None`: the orientation at the start.
    pub turns: Option<Trajectory>,
    /// The tremor, if there is any.
    pub tremor: Option<Tremor>,
    /// The buttons that the hand presses.
    pub presses: Vec<Press>,
    /// The contours that the hand traces. Afterwards it goes on with its trajectory from where it is.
    pub traces: Vec<Trace>,
    /// The motion of the hand before its own time begins: a trajectory, and its duration (s). An operator homes a
    /// device by such a motion.
    pub opening: Option<(Trajectory, f64)>,
}

impl Hand {
    /// A typical arm on a trajectory, without tremor.
    pub fn new(trajectory: Trajectory) -> Self {
        Self {
            arm: Arm::TYPICAL,
            wrist: Wrist::default(),
            trajectory,
            turns: None,
            tremor: None,
            presses: Vec::new(),
            traces: Vec::new(),
            opening: None,
        }
    }

    /// The same hand with another arm.
    pub fn with_arm(self, arm: Arm) -> Self {
        Self { arm, ..self }
    }

    /// The same hand with another wrist.
    pub fn with_wrist(self, wrist: Wrist) -> Self {
        Self { wrist, ..self }
    }

    /// The same hand, which turns the handle: the trajectory of a rotation vector (rad).
    pub fn with_turns(self, turns: Trajectory) -> Self {
        Self {
            turns: Some(turns),
            ..self
        }
    }

    /// The same hand with a tremor.
    pub fn with_tremor(self, tremor: Tremor) -> Self {
        Self {
            tremor: Some(tremor),
            ..self
        }
    }

    /// The same hand with buttons that it presses.
    pub fn with_presses(self, presses: Vec<Press>) -> Self {
        Self { presses, ..self }
    }

    /// The same hand with contours that it traces.
    pub fn with_traces(self, traces: Vec<Trace>) -> Self {
        Self { traces, ..self }
    }

    /// The same hand, which first follows the trajectory `opening` for `duration` (s).
    pub fn after(self, opening: Trajectory, duration: f64) -> Self {
        Self {
            opening: Some((opening, duration)),
            ..self
        }
    }

    /// The hand's own time (s); below zero during the opening.
    fn own(&self, time: f64) -> f64 {
        let opening = self.opening.as_ref();
        time - opening.map_or(0.0, |(_, duration)| *duration)
    }

    /// The buttons that the hand holds down at `time` (s), one bit each.
    pub fn buttons(&self, time: f64) -> u32 {
        let time = self.own(time);
        let down = self.presses.iter();
        let down = down.filter(|press| (press.from..press.to).contains(&time));
        down.fold(0, |buttons, press| {
            buttons | 1_u32.checked_shl(press.button.into()).unwrap_or(0)
        })
    }

    /// The contour that the hand traces at `time` (s).
    fn trace(&self, time: f64) -> Option<&Trace> {
        let time = self.own(time);
        let mut now = self.traces.iter();
        now.find(|trace| (trace.from..trace.to).contains(&time))
    }

    /// The aim of the hand at `time` (s), without what it traces: displacement from the start (m) and velocity (m/s).
    pub fn aim(&self, time: f64) -> (Vec3, Vec3) {
        let own = self.own(time);
        if let Some((opening, _)) = &self.opening
            && own < 0.0
        {
            return opening.at(time);
        }
        let time = own;
        let (mut position, mut velocity) = self.trajectory.at(time);
        if let Some(tremor) = &self.tremor {
            let (p, v) = tremor.at(time);
            position += p;
            velocity += v;
        }
        (position, velocity)
    }
}

/// The aim between whole milliseconds, by the cubic Hermite segment through both ends.
///
/// Substeps ask for the aim every few tens of microseconds, and a hand has no motion above 12 Hz. The cubic errs by
/// `(2 pi f dt)^4 / 384`: 1e-7 of the amplitude at 12 Hz. The milliseconds are those of the hand itself, so the aim
/// does not depend on the substeps. A hand that traces moves its aim each millisecond by what it feels then.
#[derive(Clone, Debug)]
pub(crate) struct Aim {
    hand: Hand,
    tracing: Tracing,
    /// By how much, and how fast, tracing has moved the aim.
    traced: Knot,
    /// The millisecond of `from`; `to` is one millisecond later.
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
            tracing: Tracing::default(),
            traced: (Vec3::zeros(), Vec3::zeros()),
            at_ms: 0,
            from,
            to,
        }
    }

    pub(crate) fn arm(&self) -> Arm {
        self.hand.arm
    }

    /// The buttons that the hand holds down at `time_ns`.
    pub(crate) fn buttons(&self, time_ns: u64) -> u32 {
        self.hand.buttons(time_ns as f64 * 1e-9)
    }

    /// Replaces the trajectory from the next call on. While the hand waits, this replaces the trajectory of the
    /// opening.
    pub(crate) fn guide(&mut self, trajectory: Trajectory) {
        match &mut self.hand.opening {
            Some((opening, f64::INFINITY)) => *opening = trajectory,
            _ => self.hand.trajectory = trajectory,
        }
        self.renew();
    }

    /// Lets the hand's own time wait until [`Self::begin`]. The hand stays at its start.
    pub(crate) fn wait(&mut self) {
        self.hand.opening = Some((Trajectory::still(), f64::INFINITY));
        self.renew();
    }

    /// Begins the own time of a hand that waits at `time` (s).
    pub(crate) fn begin(&mut self, time: f64) {
        if let Some((_, duration @ f64::INFINITY)) = &mut self.hand.opening {
            *duration = time;
            self.renew();
        }
    }

    fn renew(&mut self) {
        (self.from, self.to) = (self.knot(self.at_ms), self.knot(self.at_ms + 1));
    }

    fn knot(&self, ms: u64) -> Knot {
        let (position, velocity) = self.hand.aim(ms as f64 * 1e-3);
        (position + self.traced.0, velocity + self.traced.1)
    }

    /// Moves the aim along the contour that the hand traces in the millisecond `ms`.
    fn trace(&mut self, ms: u64, felt: &Felt) {
        let Some(trace) = self.hand.trace(ms as f64 * 1e-3) else {
            (self.tracing, self.traced.1) = (Tracing::default(), Vec3::zeros());
            return;
        };
        let stiffness = self.hand.arm.stiffness;
        let aim = &self.from.0;
        self.traced.1 = self.tracing.step(trace, stiffness, aim, felt, 1e-3);
        self.traced.0 += self.traced.1 * 1e-3;
    }

    /// The orientation at which the wrist aims at `time_ns`; `None` for that at the start.
    pub(crate) fn turned(&self, time_ns: u64) -> Option<UnitQuaternion<f64>> {
        let turns = self.hand.turns.as_ref()?;
        let time = self.hand.own(time_ns as f64 * 1e-9).max(0.0);
        Some(UnitQuaternion::from_scaled_axis(turns.at(time).0))
    }

    /// Displacement (m) at `time_ns`, by what the hand feels.
    pub(crate) fn at(&mut self, time_ns: u64, felt: &Felt) -> Vec3 {
        let ms = time_ns / MS_NS;
        if ms != self.at_ms {
            self.from = if ms == self.at_ms + 1 {
                self.to
            } else {
                self.knot(ms)
            };
            self.trace(ms, felt);
            self.to = self.knot(ms + 1);
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
        let felt = Felt {
            place: Vec3::zeros(),
            velocity: Vec3::zeros(),
            force: Vec3::x(),
        };
        // Steps that meet no whole millisecond, then a jump ahead and one back.
        for time_ns in (0..3000)
            .map(|k| k * 333_333)
            .chain([9_000_000_000, 1_234_567])
        {
            let (exact, _) = hand.aim(time_ns as f64 * 1e-9);
            // (2 pi f dt)^4 / 384 of 20 mm at 5 Hz and of 0.1 mm * sqrt(12) at 12 Hz: 0.05 nm each. During the fade
            // over 0.2 s, the error is a few times larger.
            assert!((aim.at(time_ns, &felt) - exact).norm() < 0.3e-9);
        }
    }
}
