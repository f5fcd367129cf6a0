//! Tasks of hands, as trajectories: tap, press and hold, rub, pull apart, move together, shake.
//!
//! A task consists of a few numbers (direction, depth, speed and others) and a seed. No person repeats a motion
//! exactly, so depths, speeds and pauses vary by a fraction of their size. The seed fixes these variations, which recur
//! after [`CYCLE`] repetitions. Reaches are minimum-jerk ([`crate::trajectory::waypoints`]), and rhythms are sinusoids
//! up to [`BAND_HZ`]. A task thus contains only the voluntary motion of a hand.

use crate::trajectory::{BAND_HZ, Sine, Trajectory, TrajectoryError};
use crate::tremor::unit;
use core::f64::consts::TAU;
use rand_pcg::Pcg64;
use rt_core::Vec3;

/// Number of different repetitions of a task, after which the first recurs.
pub const CYCLE: usize = 8;
/// The shortest time of a reach (s).
pub(crate) const SHORTEST_REACH: f64 = 0.05;
/// Time of the fade-in of a shake (s).
const FADE: f64 = 0.5;
/// The stream of the random generator: no other part of the program draws from it.
const STREAM: u128 = 0x7461_736b;

/// Kinds of tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TaskKind {
    /// Goes in by the depth and comes back at once, repeatedly, with a pause in between.
    Tap,
    /// Goes in by the depth after a pause, and stays.
    PressAndHold,
    /// Goes in by the depth after a pause, and swings sideways there.
    Rub,
    /// Pulls out by the depth, holds for the pause, and returns, repeatedly. Each hand has its own direction.
    PullApart,
    /// Goes round a rectangle: out by the depth, sideways by the width, back, and home. Hands of equal seed and
    /// direction move alike.
    MoveTogether,
    /// Swings along the direction by the depth, and less regularly sideways by the width.
    Shake,
}

impl TaskKind {
    /// All kinds, with their names in scenes.
    pub const ALL: [(&str, Self); 6] = [
        ("tap", Self::Tap),
        ("press_and_hold", Self::PressAndHold),
        ("rub", Self::Rub),
        ("pull_apart", Self::PullApart),
        ("move_together", Self::MoveTogether),
        ("shake", Self::Shake),
    ];

    /// The name of the kind in scenes.
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

    /// Whether the task has a speed and a pause. All kinds but the shake have them.
    pub fn has_speed(self) -> bool {
        self != Self::Shake
    }

    /// Whether the task has a width. The kinds that move across the direction have one.
    pub fn has_width(self) -> bool {
        matches!(self, Self::Rub | Self::MoveTogether | Self::Shake)
    }

    /// Whether the task has a frequency. The kinds that oscillate have one.
    pub fn has_frequency(self) -> bool {
        matches!(self, Self::Rub | Self::Shake)
    }
}

/// A task and its numbers. A number that the kind does not use has no effect.
///
/// ```
/// use rt_core::Vec3;
/// use sim::{Task, TaskKind};
///
/// // Taps downwards, 10 mm deep: a pause of 0.3 s, then in and out at 0.1 m/s.
/// let task = Task {
///     variation: 0.0,
///     ..Task::new(TaskKind::Tap, Vec3::new(0.0, 0.0, -1.0))
/// };
/// let (deepest, velocity) = task.trajectory(1).unwrap().at(0.4);
/// assert!((deepest.z + 0.01).abs() < 1e-12 && velocity.norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// The kind of the task.
    pub kind: TaskKind,
    /// Direction of the task (device axes); its length has no effect.
    pub direction: Vec3,
    /// Distance along the direction (m).
    pub depth: f64,
    /// Mean speed of a reach (m/s). The peak speed is 1.875 times the mean.
    pub speed: f64,
    /// Time at rest before each reach (s).
    pub pause: f64,
    /// Distance sideways (m).
    pub width: f64,
    /// Frequency of the rhythm (Hz).
    pub frequency: f64,
    /// Largest relative variation of depths, speeds, pauses and frequencies, in both directions; from 0 to 0.5.
    pub variation: f64,
}

/// The reason why a task cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TaskError {
    /// The direction is zero or not finite.
    #[error("a task's direction must be finite and not zero, not {found:?}")]
    Direction {
        /// The direction that was given.
        found: [f64; 3],
    },
    /// A number is out of its range.
    #[error("a task's {field} must be {allowed}, not {found}")]
    Number {
        /// The name of the number.
        field: &'static str,
        /// The value that was given.
        found: f64,
        /// The range that is allowed.
        allowed: &'static str,
    },
    /// The reach is faster than any hand.
    #[error(
        "a reach of {distance} m at {speed} m/s takes less than {SHORTEST_REACH} s, and no hand is so fast: \
         lower the speed"
    )]
    TooFast {
        /// Distance of the reach (m).
        distance: f64,
        /// Speed of the reach (m/s).
        speed: f64,
    },
    /// The numbers give no trajectory.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
}

impl Task {
    /// A task with usual numbers: movements of 5 to 20 mm at 3 to 10 cm/s, varying by a tenth.
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

    /// The displacement over time of this task with `seed`.
    ///
    /// # Errors
    /// [`TaskError`] if a number is out of its range, or if no hand could follow the trajectory.
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
                // The swing fades in during the press.
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

    /// Goes in and stays. Returns the trajectory and the time of arrival (s).
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

/// A list of waypoints under construction.
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

/// The variation between the repetitions of a person.
struct Variation {
    random: Pcg64,
    fraction: f64,
}

impl Variation {
    /// The number, larger or smaller by a random part of at most the fraction.
    fn of(&mut self, number: f64) -> f64 {
        number * (1.0 + self.fraction * (2.0 * unit(&mut self.random) - 1.0))
    }

    /// A direction at right angles to `along`.
    fn side(&mut self, along: &Vec3) -> Vec3 {
        // The direction starts from the axis most nearly at right angles to `along`, and turns by a random angle if the
        // task varies.
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
