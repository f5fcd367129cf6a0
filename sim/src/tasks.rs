//! What hands are asked to do, as trajectories: tap, press and hold, rub, pull apart, move together, shake.
//!
//! A task is a few numbers (direction, depth, speed and so on) and a seed. No person does the same thing
//! twice, so depths, speeds and pauses vary by a fraction of themselves, drawn from the seed once; after
//! [`CYCLE`] repetitions they come again. Reaches are minimum-jerk ([`crate::trajectory::waypoints`]),
//! rhythms are sinusoids up to [`BAND_HZ`], so a task has what a hand's purpose has, and no more.

use crate::trajectory::{BAND_HZ, Sine, Trajectory, TrajectoryError};
use crate::tremor::unit;
use core::f64::consts::TAU;
use rand_pcg::Pcg64;
use rt_core::Vec3;

/// Repetitions of a task that differ before the first comes again.
pub const CYCLE: usize = 8;
/// The shortest time in which a hand reaches (s).
pub const SHORTEST_REACH: f64 = 0.05;
/// Time in which a shaking hand fades in (s).
const FADE: f64 = 0.5;
/// The generator's stream: tasks draw from no other part's numbers.
const STREAM: u128 = 0x7461_736b;

/// Kinds of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskKind {
    /// Goes in by the depth and comes back at once, again and again with a pause in between.
    Tap,
    /// Goes in by the depth after a pause, and stays.
    PressAndHold,
    /// Goes in by the depth after a pause, and swings sideways there.
    Rub,
    /// Pulls out by the depth, holds for the pause, lets back, again and again. Each hand has its own
    /// direction.
    PullApart,
    /// Goes round: out by the depth, sideways by the width, back, and home. Hands of equal seed and direction
    /// go alike.
    MoveTogether,
    /// Swings along the direction by the depth, and less regularly sideways by the width.
    Shake,
}

impl TaskKind {
    /// All of them, under the names by which scenes call them.
    pub const ALL: [(&str, Self); 6] = [
        ("tap", Self::Tap),
        ("press_and_hold", Self::PressAndHold),
        ("rub", Self::Rub),
        ("pull_apart", Self::PullApart),
        ("move_together", Self::MoveTogether),
        ("shake", Self::Shake),
    ];

    /// Its name in scenes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tap => "tap",
            Self::PressAndHold => "press_and_hold",
            Self::Rub => "rub",
            Self::PullApart => "pull_apart",
            Self::MoveTogether => "move_together",
            Self::Shake => "shake",
        }
    }

    /// Whether the task has a speed and a pause: all but shaking.
    pub fn reaches(self) -> bool {
        self != Self::Shake
    }

    /// Whether the task has a width: those that go sideways.
    pub fn goes_sideways(self) -> bool {
        matches!(self, Self::Rub | Self::MoveTogether | Self::Shake)
    }

    /// Whether the task has a frequency: those with a rhythm of their own.
    pub fn swings(self) -> bool {
        matches!(self, Self::Rub | Self::Shake)
    }
}

/// A task and its numbers. A number that the kind does not use changes nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// What is done.
    pub kind: TaskKind,
    /// Where to, device axes; only its direction counts.
    pub direction: Vec3,
    /// How far along the direction (m).
    pub depth: f64,
    /// Mean speed of a reach (m/s); its peak is 1.875 times that.
    pub speed: f64,
    /// Time at rest before each reach (s).
    pub pause: f64,
    /// How far sideways (m).
    pub width: f64,
    /// Frequency of the rhythm (Hz).
    pub frequency: f64,
    /// Fraction by which depths, speeds, pauses and frequencies vary, to both sides; from 0 to 0.5.
    pub variation: f64,
}

/// Why there is no such task.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TaskError {
    /// The direction is zero or not finite.
    #[error("a task's direction must be finite and not zero: {found:?}")]
    Direction {
        /// What was given.
        found: [f64; 3],
    },
    /// A number is out of its range.
    #[error("a task's {field} must be {allowed}, not {found}")]
    Number {
        /// Which.
        field: &'static str,
        /// What was given.
        found: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// The reach is faster than any hand.
    #[error(
        "a reach of {distance} m at {speed} m/s takes less than {SHORTEST_REACH} s, faster than a hand: \
         lower the speed"
    )]
    TooFast {
        /// How far (m).
        distance: f64,
        /// How fast (m/s).
        speed: f64,
    },
    /// The numbers make no trajectory.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
}

impl Task {
    /// The task with usual numbers: movements of 5 to 20 mm at 3 to 10 cm/s, varying by a tenth.
    pub fn new(kind: TaskKind, direction: Vec3) -> Self {
        let (depth, speed, pause) = match kind {
            TaskKind::Tap => (0.01, 0.1, 0.3),
            TaskKind::PressAndHold => (0.01, 0.05, 0.2),
            TaskKind::Rub => (0.005, 0.05, 0.2),
            TaskKind::PullApart => (0.02, 0.03, 0.5),
            TaskKind::MoveTogether => (0.02, 0.05, 0.2),
            TaskKind::Shake => (0.01, 0.1, 0.0),
        };
        Self {
            kind,
            direction,
            depth,
            speed,
            pause,
            width: if kind == TaskKind::Shake { 0.003 } else { 0.01 },
            frequency: if kind == TaskKind::Shake { 3.0 } else { 1.0 },
            variation: 0.1,
        }
    }

    /// The displacement over time that `seed` makes of it.
    ///
    /// # Errors
    /// [`TaskError`] where a number makes no sense, or no hand could follow.
    pub fn trajectory(&self, seed: u64) -> Result<Trajectory, TaskError> {
        self.check()?;
        let mut vary = Variation {
            random: Pcg64::new(u128::from(seed), STREAM),
            fraction: self.variation,
        };
        let along = self.direction.normalize();
        let side = vary.side(&along);
        match self.kind {
            TaskKind::Tap => {
                let mut path = Path::new();
                for _ in 0..CYCLE {
                    self.rest(&mut path, &mut vary);
                    self.reach(&mut path, along * vary.of(self.depth), &mut vary)?;
                    self.reach(&mut path, Vec3::zeros(), &mut vary)?;
                }
                Ok(Trajectory::new_cycle(&path.points)?)
            }
            TaskKind::PressAndHold => Ok(self.press(&along, &mut vary)?.0),
            TaskKind::Rub => {
                let (press, there) = self.press(&along, &mut vary)?;
                let swing = Sine {
                    amplitude: side * vary.of(self.width),
                    frequency: vary.of(self.frequency).min(BAND_HZ),
                    phase: TAU * unit(&mut vary.random),
                };
                // It swings in while it goes there.
                let swing = Trajectory::new_sines(&[swing], there)?;
                Ok(Trajectory::new_sum([press, swing]))
            }
            TaskKind::PullApart => {
                let mut path = Path::new();
                for _ in 0..CYCLE {
                    self.rest(&mut path, &mut vary);
                    self.reach(&mut path, along * vary.of(self.depth), &mut vary)?;
                    self.rest(&mut path, &mut vary);
                    self.reach(&mut path, Vec3::zeros(), &mut vary)?;
                }
                Ok(Trajectory::new_cycle(&path.points)?)
            }
            TaskKind::MoveTogether => {
                let mut path = Path::new();
                for _ in 0..CYCLE {
                    let out = along * vary.of(self.depth);
                    let across = side * vary.of(self.width);
                    for place in [out, out + across, across, Vec3::zeros()] {
                        self.rest(&mut path, &mut vary);
                        self.reach(&mut path, place, &mut vary)?;
                    }
                }
                Ok(Trajectory::new_cycle(&path.points)?)
            }
            TaskKind::Shake => {
                let mut sine = |amplitude: Vec3, ratio: f64| Sine {
                    amplitude,
                    frequency: (vary.of(self.frequency) * ratio).min(BAND_HZ),
                    phase: TAU * unit(&mut vary.random),
                };
                let across = along.cross(&side);
                let sines = [
                    sine(along * self.depth, 1.0),
                    sine(side * self.width, 0.83),
                    sine(across * self.width, 1.21),
                ];
                Ok(Trajectory::new_sines(&sines, FADE)?)
            }
        }
    }

    /// Goes in and stays; also when it is there (s).
    fn press(&self, along: &Vec3, vary: &mut Variation) -> Result<(Trajectory, f64), TaskError> {
        let mut path = Path::new();
        self.rest(&mut path, vary);
        self.reach(&mut path, along * vary.of(self.depth), vary)?;
        Ok((Trajectory::new_waypoints(&path.points)?, path.time))
    }

    fn rest(&self, path: &mut Path, vary: &mut Variation) {
        let pause = vary.of(self.pause);
        if pause > 0.0 {
            path.go(path.place, pause);
        }
    }

    fn reach(&self, path: &mut Path, to: Vec3, vary: &mut Variation) -> Result<(), TaskError> {
        let distance = (to - path.place).norm();
        let duration = distance / vary.of(self.speed);
        if duration < SHORTEST_REACH {
            let speed = self.speed;
            return Err(TaskError::TooFast { distance, speed });
        }
        path.go(to, duration);
        Ok(())
    }

    fn check(&self) -> Result<(), TaskError> {
        let length = self.direction.norm();
        if !(length.is_finite() && length > 0.0) {
            let found = self.direction.into();
            return Err(TaskError::Direction { found });
        }
        let positive = "above 0 and up to 10";
        let not_negative = "from 0 to 10";
        let band = "above 0 and up to 5";
        let half = "from 0 to 0.5";
        let numbers: [(&str, f64, &str, bool); 6] = [
            (
                "depth",
                self.depth,
                positive,
                self.depth > 0.0 && self.depth <= 10.0,
            ),
            (
                "speed",
                self.speed,
                positive,
                self.speed > 0.0 && self.speed <= 10.0,
            ),
            (
                "pause",
                self.pause,
                not_negative,
                (0.0..=10.0).contains(&self.pause),
            ),
            (
                "width",
                self.width,
                positive,
                self.width > 0.0 && self.width <= 10.0,
            ),
            (
                "frequency",
                self.frequency,
                band,
                self.frequency > 0.0 && self.frequency <= BAND_HZ,
            ),
            (
                "variation",
                self.variation,
                half,
                (0.0..=0.5).contains(&self.variation),
            ),
        ];
        for (field, found, allowed, sound) in numbers {
            if !sound {
                return Err(TaskError::Number {
                    field,
                    found,
                    allowed,
                });
            }
        }
        Ok(())
    }
}

/// Waypoints in the making.
struct Path {
    points: Vec<(f64, Vec3)>,
    time: f64,
    place: Vec3,
}

impl Path {
    fn new() -> Self {
        Self {
            points: vec![(0.0, Vec3::zeros())],
            time: 0.0,
            place: Vec3::zeros(),
        }
    }

    fn go(&mut self, to: Vec3, duration: f64) {
        self.time += duration;
        self.place = to;
        self.points.push((self.time, to));
    }
}

/// How a person varies.
struct Variation {
    random: Pcg64,
    fraction: f64,
}

impl Variation {
    /// The number, up to the fraction larger or smaller.
    fn of(&mut self, number: f64) -> f64 {
        number * (1.0 + self.fraction * (2.0 * unit(&mut self.random) - 1.0))
    }

    /// A direction at right angles to `along`.
    fn side(&mut self, along: &Vec3) -> Vec3 {
        // From the axis that it leans to least; then turned about it at random where anything varies.
        let axis = Vec3::ith(along.iamin(), 1.0);
        let first = along.cross(&axis).normalize();
        if self.fraction <= 0.0 {
            return first;
        }
        let (sin, cos) = libm::sincos(TAU * unit(&mut self.random));
        first * cos + along.cross(&first) * sin
    }
}

#[cfg(test)]
mod tests;
