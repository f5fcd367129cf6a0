//! The delay from the command of a force to the motion that the device reports, from short pulses of force.
//!
//! A pulse begins at rest, and ends at the first state in which the handle has moved by two counts of its encoder. The time
//! until that state is the delay to the **first motion**. This delay consists of the transfer of the command to the
//! device, the rise of the motors' force, the time in which the handle passes the counts, and the transfer of the state
//! back. The handle passes between one and two counts in `t = sqrt(2 m x / (F - f))`. With the mass and the friction of
//! the profile, the rest follows: the **delay of the device**, up to half of a count and half of a tick.
//!
//! [`Pulses`] computes the motion, one tick at a time: pulses along the first free axis in alternating directions.
//! Between the pulses, a weak spring and a damper bring the handle back to its start. The motion ends by itself beyond
//! its limits.
#![cfg_attr(
    not(test),
    deny(
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

use crate::models::DeviceModel;
use rt_core::Reading;
use rt_core::{Freedom, Vec3, Wrench};

/// Pulses of force, half of them in each direction.
const PULSES: usize = 20;
/// Fraction of the device's largest force that a pulse uses, and its largest force (N).
const FORCE: (f64, f64) = (0.3, 1.5);
/// Displacement beyond which the motion ends as a whole (m).
const LARGEST_DISTANCE: f64 = 0.02;
/// Displacement at which the spring between two pulses has the force of a pulse (m).
const SPRING: f64 = 0.01;
/// Counts of the encoder that make a motion. One count may be the noise of a handle that rests between two counts.
const COUNTS: f64 = 2.0;
/// Longest pulse, and the time between two pulses (s).
const LONGEST_PULSE: f64 = 0.15;
const REST: f64 = 0.3;
/// Ticks in a row without a reading that end the motion.
const SILENT_TICKS: u32 = 5;
/// Number of positions from which the speed follows.
const SPAN: usize = 8;
/// The reason why there is no delay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ResponseError {
    /// The device gave no state in several ticks.
    #[error("the device gave no state in {SILENT_TICKS} ticks in a row")]
    Silent,
    /// The handle left the allowed range of the motion.
    #[error(
        "the handle moved by more than 20 mm: let nobody hold the device, and keep its way free"
    )]
    TooFar,
    /// Too few pulses moved the handle.
    #[error(
        "the handle moved in {moved} of {PULSES} pulses: does somebody hold the device, or are its motors off?"
    )]
    Still {
        /// Pulses that moved the handle far enough.
        moved: usize,
    },
}

/// The delay from force to motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Time from the command to the first state that shows a motion (s): the smallest, the median and the largest over the
    /// pulses.
    pub first_motion: [f64; 3],
    /// The part of the median that is not the motion itself (s), by mass and friction of the profile.
    pub delay: f64,
    /// The delay is known up to this time either way (s).
    pub bound: f64,
    /// Pulses that moved the handle.
    pub pulses: usize,
    /// The force of a pulse (N).
    pub force: f64,
}

/// The motion, one tick at a time.
#[derive(Clone, Debug)]
pub struct Pulses {
    period: f64,
    force: f64,
    model: DeviceModel,
    axis: Vec3,
    /// Position along the axis at which the handle started (m).
    start: Option<f64>,
    /// The newest positions along the axis, newest first (m).
    recent: [f64; SPAN],
    /// Ticks since the last pulse began or ended.
    ticks: u32,
    /// The pulse that acts: its direction, and the position at which it began (m).
    pulse: Option<(f64, f64)>,
    done: usize,
    delays: Vec<f64>,
    silent: u32,
    ended: Option<Result<(), ResponseError>>,
}

impl Pulses {
    /// The motion of a device of this profile, which is read and written every `period` (s). The handle starts at the
    /// position of the first reading.
    pub fn new(model: &DeviceModel, period: f64) -> Self {
        let axis = match model.freedom() {
            Freedom::Three | Freedom::Six => Vec3::x(),
            Freedom::Along(axes) => {
                let [x, y, _] = axes.free();
                if x {
                    Vec3::x()
                } else if y {
                    Vec3::y()
                } else {
                    Vec3::z()
                }
            }
        };
        Self {
            period,
            force: (FORCE.0 * model.max_force).min(FORCE.1),
            model: *model,
            axis,
            start: None,
            recent: [0.0; SPAN],
            ticks: 0,
            pulse: None,
            done: 0,
            delays: Vec::new(),
            silent: 0,
            ended: None,
        }
    }

    /// The force of a pulse (N), and the largest displacement of the handle (m).
    pub fn limits(&self) -> (f64, f64) {
        (self.force, LARGEST_DISTANCE)
    }

    /// Whether the motion has ended.
    pub fn ended(&self) -> bool {
        self.ended.is_some()
    }

    /// The fraction of the motion that is complete.
    pub fn progress(&self) -> f64 {
        self.done as f64 / PULSES as f64
    }

    /// The delay, after the end of the motion; `None` before.
    pub fn result(&self) -> Option<Result<Response, ResponseError>> {
        Some(self.ended?.and_then(|()| {
            let mut delays = self.delays.clone();
            delays.sort_by(f64::total_cmp);
            let few = ResponseError::Still {
                moved: delays.len(),
            };
            if 2 * delays.len() < PULSES {
                return Err(few);
            }
            let at = |index: usize| delays.get(index).copied().ok_or(few);
            let median = at(delays.len() / 2)?;
            let [soonest, latest] = [COUNTS - 1.0, COUNTS].map(|counts| self.moving(counts));
            Ok(Response {
                first_motion: [at(0)?, median, at(delays.len().saturating_sub(1))?],
                delay: median - 0.5 * (soonest + latest) - 0.5 * self.period,
                bound: 0.5 * (latest - soonest) + 0.5 * self.period,
                pulses: delays.len(),
                force: self.force,
            })
        }))
    }

    /// The time in which the handle of the profile moves by some counts (s).
    fn moving(&self, counts: f64) -> f64 {
        let left = (self.force - self.model.friction).max(0.1 * self.force);
        (2.0 * self.model.mass * counts * self.model.position_step / left).sqrt()
    }

    /// Takes the reading of a tick, and returns the wrench to command in that tick.
    pub fn tick(&mut self, reading: &Reading) -> Wrench {
        if self.ended() {
            return Wrench::zero();
        }
        let Ok(state) = reading else {
            self.silent = self.silent.saturating_add(1);
            if self.silent >= SILENT_TICKS {
                self.ended = Some(Err(ResponseError::Silent));
            }
            return Wrench::zero();
        };
        // A device that is slower than the ticks gives the force time to act: a pulse lasts through missing states.
        self.ticks = self
            .ticks
            .saturating_add(1 + std::mem::take(&mut self.silent));
        let x = state.pose.position.dot(&self.axis);
        let start = *self.start.get_or_insert(x);
        if self.done == 0 && self.ticks <= 1 {
            self.recent = [x; SPAN];
        }
        self.recent.rotate_right(1);
        if let Some(newest) = self.recent.first_mut() {
            *newest = x;
        }
        if (x - start).abs() > LARGEST_DISTANCE {
            self.ended = Some(Err(ResponseError::TooFar));
            return Wrench::zero();
        }
        let force = match self.pulse {
            Some((direction, from)) => self.push(direction, direction * (x - from)),
            None => self.rest(x, start),
        };
        Wrench {
            force: self.axis * force,
            moment: Vec3::zeros(),
        }
    }

    /// A tick of a pulse; the handle has moved by `moved` (m) in its direction. Returns the force along the axis (N).
    fn push(&mut self, direction: f64, moved: f64) -> f64 {
        let time = f64::from(self.ticks) * self.period;
        // The positions are rounded to counts in the firmware and again in the report.
        let moves = moved >= (COUNTS - 0.25) * self.model.position_step;
        if !moves && time < LONGEST_PULSE {
            return direction * self.force;
        }
        self.delays.extend(moves.then_some(time));
        self.pulse = None;
        self.ticks = 0;
        self.done += 1;
        if self.done == PULSES {
            self.ended = Some(Ok(()));
        }
        0.0
    }

    /// A tick between two pulses. Returns the force along the axis (N).
    fn rest(&mut self, x: f64, start: f64) -> f64 {
        if f64::from(self.ticks) * self.period >= REST {
            let direction = if self.done.is_multiple_of(2) {
                1.0
            } else {
                -1.0
            };
            self.pulse = Some((direction, x));
            self.ticks = 0;
            return direction * self.force;
        }
        let oldest = self.recent.last().copied().unwrap_or(x);
        let speed = (x - oldest) / ((SPAN - 1) as f64 * self.period);
        let stiffness = self.force / SPRING;
        let damping = 2.0 * (stiffness * self.model.mass).sqrt();
        let force = -stiffness * (x - start) - damping * speed;
        force.clamp(-self.force, self.force)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::DeviceError;

    #[test]
    fn a_silent_device_and_one_that_does_not_move_give_no_delay() {
        let model = DeviceModel::named("falcon").expect("a built-in device");
        let mut pulses = Pulses::new(&model, 1e-3);
        for _ in 0..SILENT_TICKS {
            assert!(!pulses.ended());
            assert_eq!(pulses.tick(&Err(DeviceError::NoReport)), Wrench::zero());
        }
        assert_eq!(pulses.result(), Some(Err(ResponseError::Silent)));
        let mut pulses = Pulses::new(&model, 1e-3);
        let still = Ok(rt_core::DeviceState::resting());
        let mut ticks = 0;
        while !pulses.ended() {
            assert!(pulses.tick(&still).force.norm() <= 1.5);
            ticks += 1;
        }
        // Twenty rests and twenty pulses of their longest duration.
        assert_eq!(ticks, 20 * (300 + 150));
        let none = ResponseError::Still { moved: 0 };
        assert_eq!(pulses.result(), Some(Err(none)));
    }

    #[test]
    fn a_handle_that_is_taken_away_ends_the_motion() {
        let model = DeviceModel::named("falcon").expect("a built-in device");
        let mut pulses = Pulses::new(&model, 1e-3);
        for step in 0.. {
            let mut state = rt_core::DeviceState::resting();
            state.pose.position.x = 1e-4 * f64::from(step);
            pulses.tick(&Ok(state));
            if pulses.ended() {
                break;
            }
        }
        assert_eq!(pulses.result(), Some(Err(ResponseError::TooFar)));
    }

    const STEP: f64 = 1e-5;
    /// The force of a pulse of [`model`] (N).
    const PULSE: f64 = 1.2;

    fn model() -> DeviceModel {
        DeviceModel {
            max_force: 4.0,
            mass: 0.2,
            friction: 0.2,
            position_step: STEP,
            ..DeviceModel::named("falcon").expect("a built-in device")
        }
    }

    /// The reading of a handle at a position; `None` for a missing one.
    fn at(position: impl Into<Option<Vec3>>) -> Reading {
        let mut state = rt_core::DeviceState::resting();
        state.pose.position = position.into().ok_or(DeviceError::NoReport)?;
        Ok(state)
    }

    /// A device on which the handle moves by two counts after the given ticks of each pulse, or not at all.
    fn pulsed(model: &DeviceModel, axis: Vec3, moves: [Option<u32>; PULSES]) -> Pulses {
        let mut pulses = Pulses::new(model, 1e-3);
        let (force, most) = pulses.limits();
        assert_eq!(most, 0.02);
        let start = Vec3::new(0.01, 0.02, 0.03);
        for (done, moved) in moves.into_iter().enumerate() {
            assert_eq!(pulses.progress(), done as f64 / 20.0);
            let direction = if done % 2 == 0 { 1.0 } else { -1.0 };
            let push = axis * (direction * force);
            let mut wrench = Wrench::zero();
            // A rest of 0.3 s. The last states of the pulse before still brake the handle for some ticks.
            for tick in 1..=300 {
                assert!(tick < 10 || wrench == Wrench::zero(), "{tick}");
                wrench = pulses.tick(&at(start));
            }
            assert_eq!((wrench.force, wrench.moment), (push, Vec3::zeros()));
            let moved = moved.unwrap_or(150);
            for tick in 1..moved {
                // Neither less than two counts nor a motion against the force is a motion.
                let counts = if tick % 2 == 0 { 1.7 } else { -3.0 };
                wrench = pulses.tick(&at(start + axis * (direction * counts * STEP)));
                assert_eq!(wrench.force, push);
            }
            assert_eq!(pulses.result(), None);
            let counts = if moved < 150 { 1.8 } else { 0.0 };
            wrench = pulses.tick(&at(start + axis * (direction * counts * STEP)));
            assert_eq!(wrench, Wrench::zero());
        }
        assert!(pulses.ended() && pulses.progress() == 1.0);
        assert_eq!(pulses.tick(&at(start + axis * 0.01)), Wrench::zero());
        pulses
    }

    #[test]
    fn the_delay_is_the_time_to_the_first_motion_less_the_motion_itself() {
        let moves = core::array::from_fn(|k| Some(5 + (k as u32 * 7) % 20));
        let found = pulsed(&model(), Vec3::x(), moves).result().expect("an end");
        let found = found.expect("a delay");
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        // Delays from 5 to 24 ms, each once.
        for (found, expected) in found.first_motion.iter().zip([5e-3, 15e-3, 24e-3]) {
            assert!(near(*found, expected), "{found} {expected}");
        }
        // One count and two, at (1.2 N - 0.2 N) / 0.2 kg.
        let [one, two] = [1.0, 2.0].map(|counts: f64| (2.0 * counts * STEP / 5.0).sqrt());
        assert!(
            near(found.delay, 15e-3 - 0.5 * (one + two) - 0.5e-3),
            "{found:?}"
        );
        assert!(near(found.bound, 0.5 * (two - one) + 0.5e-3), "{found:?}");
        assert_eq!((found.pulses, found.force), (20, PULSE));
    }

    #[test]
    fn friction_takes_nine_tenths_of_the_force_at_most() {
        let stiff = DeviceModel {
            friction: 5.0,
            ..model()
        };
        let found = pulsed(&stiff, Vec3::x(), [Some(10); PULSES]).result();
        let found = found.expect("an end").expect("a delay");
        let [one, two] = [1.0, 2.0].map(|counts: f64| (2.0 * counts * STEP * 0.2 / 0.12).sqrt());
        assert!(
            (found.bound - (0.5 * (two - one) + 0.5e-3)).abs() < 1e-12,
            "{found:?}"
        );
    }

    #[test]
    fn half_of_the_pulses_must_move_the_handle() {
        let moves = |count: usize| core::array::from_fn(|k| (k < count).then_some(12));
        let found = pulsed(&model(), Vec3::x(), moves(10)).result();
        assert_eq!(found.expect("an end").map(|found| found.pulses), Ok(10));
        let few = pulsed(&model(), Vec3::x(), moves(9)).result();
        assert_eq!(few, Some(Err(ResponseError::Still { moved: 9 })));
    }

    #[test]
    fn the_pulses_act_along_the_first_free_axis() {
        for (free, axis) in [
            ([true, true, false], Vec3::x()),
            ([false, true, true], Vec3::y()),
            ([false, false, true], Vec3::z()),
        ] {
            let flat = DeviceModel {
                axes: rt_core::Axes::new(free),
                ..model()
            };
            pulsed(&flat, axis, [Some(3); PULSES]);
        }
    }

    #[test]
    fn a_spring_and_a_damper_bring_the_handle_back_between_two_pulses() {
        let mut pulses = Pulses::new(&model(), 1e-3);
        let mut force = |x: f64| pulses.tick(&at(Vec3::x() * (0.05 + x))).force.x;
        let stiffness = PULSE / 0.01;
        let damping = 2.0 * (stiffness * 0.2_f64).sqrt();
        assert_eq!(force(0.0), 0.0);
        // The speed is the mean over seven periods; the handle had rested before.
        for k in 1..20_u32 {
            let x = 1e-4 * f64::from(k);
            let speed = 0.1 * f64::from(k.min(7)) / 7.0;
            let expected = (-stiffness * x - damping * speed).max(-PULSE);
            assert!((force(x) - expected).abs() < 1e-9, "{k}");
        }
        for _ in 0..8 {
            force(-0.015);
        }
        // Beyond 10 mm the force is that of a pulse.
        assert_eq!(force(-0.015), PULSE);
        assert_eq!(force(0.019_9), -PULSE);
        assert_eq!(force(0.020_1), 0.0);
        assert_eq!(pulses.result(), Some(Err(ResponseError::TooFar)));
    }

    #[test]
    fn missing_states_are_time_that_passes() {
        let mut pulses = Pulses::new(&model(), 1e-3);
        let start = at(Vec3::zeros());
        let mut ticks = 0;
        while pulses.tick(&start) == Wrench::zero() {
            ticks += 1;
            for _ in 0..4 {
                ticks += 1;
                assert_eq!(pulses.tick(&at(None)), Wrench::zero());
            }
        }
        // Sixty states, each with the four that are missing before the next one.
        assert_eq!(ticks, 300);
    }
}
