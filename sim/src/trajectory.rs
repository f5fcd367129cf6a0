//! The aim of a hand as a function of time: displacement (m) from its start.
//!
//! There are three kinds of trajectories, and sums of them. [`waypoints`] are reaches joined by minimum-jerk segments.
//! [`sines`] are slow rhythmic motions. [`recorded`] is a person's motion, band-limited to voluntary motion. All
//! trajectories are zero at time zero, so that a hand never starts with a stretched arm. All are functions of time
//! alone, so that a run can be repeated. A look-up does not allocate, and searches no longer than a bisection.

pub mod recorded;
pub mod sines;
pub mod waypoints;

use crate::curve::Knot;
use recorded::Recorded;
use rt_core::Vec3;
pub use sines::Sine;
use sines::Sines;
use waypoints::Waypoints;

/// Highest frequency of voluntary motion that a trajectory may carry (Hz).
pub const BAND_HZ: f64 = 5.0;

/// The reason why a trajectory cannot be made. An index counts the samples, waypoints or sinusoids from zero.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// A number is infinite or NaN.
    #[error("entry {index} holds a number that is not finite")]
    NotFinite {
        /// Index of the entry.
        index: usize,
    },
    /// A time does not follow the previous time.
    #[error("entry {index} is at {found} s, which is not after {before} s")]
    TimesNotIncreasing {
        /// Index of the entry.
        index: usize,
        /// The previous time (s).
        before: f64,
        /// The time of the entry (s).
        found: f64,
    },
    /// The first time lies before the start of the run.
    #[error("the first entry is at {found} s; a trajectory starts at 0 s or later")]
    BeforeStart {
        /// The first time (s).
        found: f64,
    },
    /// There are too few entries.
    #[error("{found} entries are too few: at least {needed} are needed")]
    TooFew {
        /// Number of entries.
        found: usize,
        /// Smallest number of entries.
        needed: usize,
    },
    /// A frequency is not above zero and at most [`BAND_HZ`].
    #[error(
        "entry {index} has a frequency of {found} Hz; hands move above 0 and up to {BAND_HZ} Hz"
    )]
    Frequency {
        /// Index of the entry.
        index: usize,
        /// Frequency of the entry (Hz).
        found: f64,
    },
    /// The time of the fade-in is not above zero.
    #[error("a motion cannot fade in over {found} s; give a time above 0 s")]
    Fade {
        /// The time that was given (s).
        found: f64,
    },
    /// A motion to be repeated does not end at its start.
    #[error("a motion that is repeated must end where it begins, not {found} m away")]
    Open {
        /// Distance between its ends (m).
        found: f64,
    },
    /// A recording is longer than [`recorded::MAX_DURATION`].
    #[error("the recording lasts {found} s; at most {limit} s are taken")]
    TooLong {
        /// Duration of the recording (s).
        found: f64,
        /// Largest duration (s).
        limit: f64,
    },
}

#[derive(Clone, Debug)]
enum Term {
    Waypoints(Waypoints),
    Sines(Sines),
    Recorded(Recorded),
}

/// A displacement as a function of time.
///
/// ```
/// use rt_core::Vec3;
/// use sim::{Sine, Trajectory};
///
/// // A reach of 20 mm along x in a second, and a sway of 3 mm along y.
/// let reach = [(0.0, Vec3::zeros()), (1.0, Vec3::new(0.02, 0.0, 0.0))];
/// let sway = Sine {
///     amplitude: Vec3::new(0.0, 0.003, 0.0),
///     frequency: 1.5,
///     phase: 0.0,
/// };
/// let trajectory = Trajectory::new_sum([
///     Trajectory::new_waypoints(&reach).unwrap(),
///     Trajectory::new_sines(&[sway], 0.5).unwrap(),
/// ]);
/// let (position, velocity) = trajectory.at(2.0);
/// assert_eq!(position.x, 0.02);
/// assert_eq!(velocity.x, 0.0);
/// assert!(position.y.abs() <= 0.003);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Trajectory {
    terms: Vec<Term>,
}

impl Trajectory {
    /// A trajectory that stays at its start.
    pub fn still() -> Self {
        Self::default()
    }

    /// Visits each `(time, position)` (s, m) in turn along minimum-jerk segments, at rest at each point. The trajectory
    /// rests before the first point and after the last. Positions are relative to the first point.
    ///
    /// # Errors
    /// No waypoint, a number that is not finite, times that do not increase, or a first time below zero.
    pub fn new_waypoints(waypoints: &[(f64, Vec3)]) -> Result<Self, TrajectoryError> {
        Ok(Self {
            terms: vec![Term::Waypoints(Waypoints::new(waypoints)?)],
        })
    }

    /// Repeats a motion of [`Trajectory::new_waypoints`]: after the last waypoint, the motion continues from the first,
    /// at the same position.
    ///
    /// # Errors
    /// The errors of [`Trajectory::new_waypoints`]; also fewer than two waypoints, or a last position that is not the
    /// first.
    pub(crate) fn new_cycle(waypoints: &[(f64, Vec3)]) -> Result<Self, TrajectoryError> {
        Ok(Self {
            terms: vec![Term::Waypoints(Waypoints::new_cycle(waypoints)?)],
        })
    }

    /// A sum of sinusoids that fades in along a minimum-jerk step over `fade` (s).
    ///
    /// # Errors
    /// A number that is not finite, a frequency outside the hand's band, or a fade-in time that is not above zero.
    pub fn new_sines(sines: &[Sine], fade: f64) -> Result<Self, TrajectoryError> {
        Ok(Self {
            terms: vec![Term::Sines(Sines::new(sines, fade)?)],
        })
    }

    /// A recorded motion, `(time, position)` (s, m), band-limited as described in [`recorded`]. The trajectory starts
    /// at the first sample, whatever its time, and rests after the last.
    ///
    /// # Errors
    /// Fewer than two samples, a number that is not finite, times that do not increase, or a recording beyond
    /// [`recorded::MAX_DURATION`].
    pub fn new_recorded(samples: &[(f64, Vec3)]) -> Result<Self, TrajectoryError> {
        Ok(Self {
            terms: vec![Term::Recorded(Recorded::new(samples)?)],
        })
    }

    /// The sum of several trajectories.
    pub fn new_sum(trajectories: impl IntoIterator<Item = Self>) -> Self {
        Self {
            terms: trajectories.into_iter().flat_map(|t| t.terms).collect(),
        }
    }

    /// Displacement (m) and velocity (m/s) at `time` (s).
    pub fn at(&self, time: f64) -> (Vec3, Vec3) {
        let mut sum: Knot = (Vec3::zeros(), Vec3::zeros());
        for term in &self.terms {
            let (position, velocity) = match term {
                Term::Waypoints(term) => term.at(time),
                Term::Sines(term) => term.at(time),
                Term::Recorded(term) => term.at(time),
            };
            sum.0 += position;
            sum.1 += velocity;
        }
        sum
    }
}

/// Checks a list of timed positions: all numbers are finite, and the times increase.
fn check_timed(entries: &[(f64, Vec3)], needed: usize) -> Result<(), TrajectoryError> {
    if entries.len() < needed {
        return Err(TrajectoryError::TooFew {
            found: entries.len(),
            needed,
        });
    }
    let mut before = f64::NEG_INFINITY;
    for (index, (time, position)) in entries.iter().enumerate() {
        if !(time.is_finite() && position.iter().all(|x| x.is_finite())) {
            return Err(TrajectoryError::NotFinite { index });
        }
        if *time <= before {
            return Err(TrajectoryError::TimesNotIncreasing {
                index,
                before,
                found: *time,
            });
        }
        before = *time;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_adds_displacements_and_velocities() {
        let reach =
            Trajectory::new_waypoints(&[(0.0, Vec3::zeros()), (1.0, Vec3::new(0.02, 0.0, 0.0))])
                .unwrap();
        let sway = Sine {
            amplitude: Vec3::new(0.0, 0.003, 0.0),
            frequency: 1.5,
            phase: 0.4,
        };
        let sway = Trajectory::new_sines(&[sway], 0.5).unwrap();
        let sum = Trajectory::new_sum([reach.clone(), sway.clone(), Trajectory::still()]);
        for k in 0..40 {
            let t = f64::from(k) * 0.05;
            let (a, b, c) = (reach.at(t), sway.at(t), sum.at(t));
            assert_eq!(c, (a.0 + b.0, a.1 + b.1));
        }
    }

    #[test]
    fn bad_input_is_reported_with_its_index() {
        let at = |t: f64| (t, Vec3::zeros());
        let nan = (1.0, Vec3::new(f64::NAN, 0.0, 0.0));
        let cases = [
            (
                Trajectory::new_waypoints(&[]).unwrap_err(),
                TrajectoryError::TooFew {
                    found: 0,
                    needed: 1,
                },
            ),
            (
                Trajectory::new_recorded(&[at(0.0)]).unwrap_err(),
                TrajectoryError::TooFew {
                    found: 1,
                    needed: 2,
                },
            ),
            (
                Trajectory::new_recorded(&[at(0.0), nan]).unwrap_err(),
                TrajectoryError::NotFinite { index: 1 },
            ),
            (
                Trajectory::new_waypoints(&[at(0.0), at(1.0), at(1.0)]).unwrap_err(),
                TrajectoryError::TimesNotIncreasing {
                    index: 2,
                    before: 1.0,
                    found: 1.0,
                },
            ),
            (
                Trajectory::new_waypoints(&[at(-0.5), at(1.0)]).unwrap_err(),
                TrajectoryError::BeforeStart { found: -0.5 },
            ),
            (
                Trajectory::new_recorded(&[at(0.0), at(1e300)]).unwrap_err(),
                TrajectoryError::TooLong {
                    found: 1e300,
                    limit: recorded::MAX_DURATION,
                },
            ),
        ];
        for (found, expected) in cases {
            assert_eq!(found, expected);
        }
        let sine = |frequency| Sine {
            amplitude: Vec3::zeros(),
            frequency,
            phase: 0.0,
        };
        assert_eq!(
            Trajectory::new_sines(&[sine(5.0), sine(5.1)], 1.0).unwrap_err(),
            TrajectoryError::Frequency {
                index: 1,
                found: 5.1
            }
        );
        assert_eq!(
            Trajectory::new_sines(&[sine(1.0)], 0.0).unwrap_err(),
            TrajectoryError::Fade { found: 0.0 }
        );
    }
}
