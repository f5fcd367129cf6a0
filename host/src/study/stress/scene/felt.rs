//! What was felt over a whole run, against what the body itself exerts at the same pose.
//!
//! The body's own is that of a copy that is led along the run ([`super::reference::follow`]): whatever led the hand
//! there, an exact force is the copy's. Ripple is compared with that of the reference in its own hands instead: a copy
//! that is shaken along with the hand shakes, too, and would excuse the scheme that shakes them.

use super::draw::{BEGIN, Draw};
use super::measure::{DeviceTrace, LEAST_FORCE, Trace, band_rms, mean};
use physics::Vec3;
use serde::{Deserialize, Serialize};

/// Length of the windows in which ripple is measured (s); they begin every half of it.
const WINDOW: f64 = 0.5;

/// What was felt, by the worst device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Felt {
    /// By how much the mean force of the last second is off the body's own, as a share of that.
    pub hold_error: f64,
    /// By how much the force is off over the whole run (root mean square), as a share of the largest of the body's own.
    pub run_error: f64,
    /// Largest force of the body's own (N).
    pub peak: f64,
    /// Ripple from 20 to 400 Hz in the worst half second (N, root mean square), beyond the reference's about then.
    pub worst_ripple: f64,
    /// By how much the mean moment of the last second is off (N m).
    pub hold_moment: f64,
    /// By how much the moment is off over the whole run (N m, root mean square).
    pub run_moment: f64,
}

impl Felt {
    /// Measures `run`, along which the bodies were led. Times in which a device was gone, or no word had come of what
    /// the body is made of, count in none of the errors of the run.
    pub(super) fn of(run: &Trace, reference: &Trace, draw: &Draw) -> Self {
        let mut worst = Self::default();
        for (number, (mine, right)) in run.devices.iter().zip(&reference.devices).enumerate() {
            let counts = |tick: usize| {
                let time = tick as f64 * run.period;
                time >= BEGIN && !run.unaware.holds(time) && !draw.is_gone(number, time)
            };
            let found = Self::of_device(run, mine, right, counts);
            worst = Self {
                hold_error: worst.hold_error.max(found.hold_error),
                run_error: worst.run_error.max(found.run_error),
                peak: worst.peak.max(found.peak),
                worst_ripple: worst.worst_ripple.max(found.worst_ripple),
                hold_moment: worst.hold_moment.max(found.hold_moment),
                run_moment: worst.run_moment.max(found.run_moment),
            };
        }
        worst
    }

    fn of_device(
        run: &Trace,
        mine: &DeviceTrace,
        right: &DeviceTrace,
        counts: impl Fn(usize) -> bool,
    ) -> Self {
        let each = || (0..mine.own.len()).filter(|tick| counts(*tick));
        let rms = |off: &dyn Fn(usize) -> Vec3| {
            let sum: f64 = each().map(|tick| off(tick).norm_squared()).sum();
            (sum / each().count().max(1) as f64).sqrt()
        };
        // More than a device's largest force nobody can render.
        let own = |tick: usize| {
            let (own, most) = (mine.own[tick].force, mine.force[tick].norm());
            if mine.limited[tick] && own.norm() > most {
                own * (most / own.norm())
            } else {
                own
            }
        };
        let force = |tick: usize| mine.force[tick] - own(tick);
        let moment = |tick: usize| mine.moment[tick] - mine.own[tick].moment;
        let peak = each().map(|tick| own(tick).norm());
        let peak = peak.fold(0.0, f64::max);
        let hold = run.hold()..mine.own.len();
        let held = |of: &dyn Fn(usize) -> Vec3| mean(&hold.clone().map(of).collect::<Vec<_>>());
        let own = held(&own).norm();
        Self {
            hold_error: held(&force).norm() / own.max(LEAST_FORCE),
            run_error: rms(&force) / peak.max(LEAST_FORCE),
            peak,
            worst_ripple: worst_ripple(run, mine, right),
            hold_moment: held(&moment).norm(),
            run_moment: rms(&moment),
        }
    }
}

/// The most by which the ripple in a window is beyond the reference's in that window or one beside it: hands that feel a
/// little else get everywhere a little sooner or later.
fn worst_ripple(run: &Trace, mine: &DeviceTrace, right: &DeviceTrace) -> f64 {
    let (length, hop) = (run.tick(WINDOW), run.tick(0.5 * WINDOW).max(1));
    let each = |device: &DeviceTrace| -> Vec<f64> {
        let from = device.force.get(run.tick(BEGIN)..).unwrap_or_default();
        let windows = from.windows(length.max(1)).step_by(hop);
        windows.map(|part| band_rms(part, run.period)).collect()
    };
    let (mine, right) = (each(mine), each(right));
    let beyond = mine.iter().enumerate().map(|(at, ripple)| {
        let about = right.iter().take(at + 3).skip(at.saturating_sub(2));
        ripple - about.copied().fold(0.0, f64::max)
    });
    beyond.fold(0.0, f64::max)
}
