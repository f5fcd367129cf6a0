//! What was felt over a whole run, against what the body itself exerts at the same pose.
//!
//! The body's own is that of a copy that is led along the run (`reference::follow`): whatever led the hand
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

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Wrench;
    use std::f64::consts::TAU;

    const TICKS: usize = 4000;

    /// A run of four seconds whose force at a time (s) is given; the body's own is 2 N.
    fn run(force: impl Fn(f64) -> f64) -> Trace {
        let along = |force: f64| Vec3::new(0.0, 0.0, force);
        let times = (0..TICKS).map(|tick| tick as f64 * 1e-3);
        let own = Wrench {
            force: along(2.0),
            ..Wrench::zero()
        };
        Trace {
            period: 1e-3,
            devices: vec![DeviceTrace {
                force: times.map(|time| along(force(time))).collect(),
                moment: vec![Vec3::new(0.01, 0.0, 0.0); TICKS],
                limited: vec![false; TICKS],
                own: vec![own; TICKS],
                ..DeviceTrace::default()
            }],
            out: vec![0.0; TICKS],
            ..Trace::default()
        }
    }

    fn felt(force: impl Fn(f64) -> f64) -> Felt {
        let draw = Draw::untroubled(100.0, 0.0);
        Felt::of(&run(force), &run(|_| 2.0), &draw)
    }

    #[test]
    fn a_force_is_measured_against_the_bodys_own() {
        let found = felt(|_| 1.9);
        // Sums of thousands of numbers of order one.
        let is = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        is(found.hold_error, 0.05);
        is(found.run_error, 0.05);
        is(found.peak, 2.0);
        is(found.hold_moment, 0.01);
        is(found.run_moment, 0.01);
        assert!(found.worst_ripple < 1e-12);
    }

    #[test]
    fn what_happens_early_counts_in_the_run_and_not_in_the_hold() {
        // For half a second in the middle: nothing of it is left in the last.
        let found = felt(|time| {
            let shakes = (1.5..2.0).contains(&time);
            2.0 + if shakes {
                0.4 * (TAU * 60.0 * time).sin()
            } else {
                0.0
            }
        });
        assert!(found.hold_error < 1e-12);
        // Half a second of 3.6, of an amplitude of a fifth: 0.2 sqrt(0.5 x 0.5 / 3.6), but for half a tick.
        let expected = 0.2 * (0.25_f64 / 3.6).sqrt();
        assert!((found.run_error - expected).abs() < 0.01 * expected);
        // A window begins every quarter second from 0.4 s, so one holds nine tenths of it at least under its taper.
        let ripple = found.worst_ripple / (0.4 / 2.0_f64.sqrt());
        assert!((0.9..1.1).contains(&ripple), "{ripple}");
    }

    #[test]
    fn ripple_that_the_reference_has_about_then_is_nobodys_fault() {
        let shaken = |time: f64| 2.0 + 0.4 * (TAU * 60.0 * time).sin();
        let draw = Draw::untroubled(100.0, 0.0);
        let found = Felt::of(&run(shaken), &run(shaken), &draw);
        assert!(found.worst_ripple < 1e-12);
        let early = |time: f64| if time < 1.0 { shaken(time) } else { 2.0 };
        let found = Felt::of(&run(shaken), &run(early), &draw);
        assert!(found.worst_ripple > 0.2, "{}", found.worst_ripple);
    }

    #[test]
    fn a_device_at_its_limit_is_not_to_blame() {
        let mut limited = run(|_| 1.5);
        limited.devices[0].limited.fill(true);
        let draw = Draw::untroubled(100.0, 0.0);
        assert!(Felt::of(&limited, &run(|_| 1.5), &draw).hold_error < 1e-12);
    }
}
