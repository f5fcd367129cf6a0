//! The rendered force over a whole run, compared with the force that the body itself exerts at the same pose.
//!
//! The body's own force is that of a copy of the body, moved along the run (`reference::follow`). Whatever moved the
//! hand there, the exact force is the copy's. Ripple and jumps are compared with those of the reference, under the
//! reference's hands: a copy that shakes with the hand would excuse the scheme that shakes the hand.
//!
//! A hold is exact under two conditions. First, the force is that of the host's body at rest, with its handles where the host
//! has them (`reference::rest`): at the poses of the devices as the controller shows them, also after a slip. Second, a handle
//! leaves the pose of its device only in directions that the device cannot render: the part of the distance in the other
//! directions, times the stiffness there, is a negligible force (the module `rendered`).

use super::draw::{BEGIN, Draw};
use super::measure::{DeviceTrace, LEAST_FORCE, Trace, band_rms, mean};
use physics::Vec3;
use serde::{Deserialize, Serialize};

/// Length of the windows in which ripple is measured (s). A window begins every half length.
const WINDOW: f64 = 0.5;

/// Jumps are not related to a friction below this (N): a device may have none.
const LEAST_FRICTION: f64 = 0.01;

/// The errors of the rendered force, each that of the worst device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ForceErrors {
    /// Error of the mean force of the last second, as a fraction of the force that the host's body exerts at rest with its
    /// handles where they are.
    pub hold_error: f64,
    /// Error of the force over the whole run (RMS), as a fraction of the largest of the body's own force.
    pub run_error: f64,
    /// Largest magnitude of the body's own force (N).
    pub peak: f64,
    /// Ripple from 20 to 400 Hz in the worst half second (N, RMS), beyond that of the reference at about the same time.
    pub worst_ripple: f64,
    /// Largest change of the force from one tick to the next, beyond that of the reference at about the same time, a
    /// factor of the friction of the device.
    pub jump: f64,
    /// In the last second, the mean distance of the handles from their devices in the directions that the devices render as
    /// they are: the force of the body over that distance, as a fraction of the mean of the body's own force.
    pub leaves: f64,
    /// Error of the mean moment of the last second (N m).
    pub hold_moment: f64,
    /// Error of the moment over the whole run (N m, RMS).
    pub run_moment: f64,
}

impl ForceErrors {
    /// Measures `run`, along which the copies of the bodies were moved. The errors of the run exclude the times at
    /// which a device was absent, or at which the tick had not yet received a model of the softened body.
    pub(super) fn of(run: &Trace, reference: &Trace, draw: &Draw) -> Self {
        let mut worst = Self::default();
        for (number, (device, expected)) in run.devices.iter().zip(&reference.devices).enumerate() {
            let counts = |tick: usize| {
                let time = tick as f64 * run.period;
                time >= BEGIN && !run.unaware.holds(time) && !draw.is_gone(number, time)
            };
            let found = Self::of_device(run, device, expected, counts);
            worst = Self {
                hold_error: worst.hold_error.max(found.hold_error),
                run_error: worst.run_error.max(found.run_error),
                peak: worst.peak.max(found.peak),
                worst_ripple: worst.worst_ripple.max(found.worst_ripple),
                jump: worst.jump.max(found.jump),
                leaves: worst.leaves.max(found.leaves),
                hold_moment: worst.hold_moment.max(found.hold_moment),
                run_moment: worst.run_moment.max(found.run_moment),
            };
        }
        worst
    }

    fn of_device(
        run: &Trace,
        device: &DeviceTrace,
        expected: &DeviceTrace,
        counts: impl Fn(usize) -> bool,
    ) -> Self {
        let each = || (0..device.own.len()).filter(|tick| counts(*tick));
        let rms = |off: &dyn Fn(usize) -> Vec3| {
            let sum: f64 = each().map(|tick| off(tick).norm_squared()).sum();
            (sum / each().count().max(1) as f64).sqrt()
        };
        // No device renders more than its largest force.
        let own = |tick: usize| {
            let (own, most) = (device.own[tick].force, device.force[tick].norm());
            if device.limited[tick] && own.norm() > most {
                own * (most / own.norm())
            } else {
                own
            }
        };
        let force = |tick: usize| device.force[tick] - own(tick);
        let moment = |tick: usize| device.moment[tick] - device.own[tick].moment;
        let peak = each().map(|tick| own(tick).norm());
        let peak = peak.fold(0.0, f64::max);
        let hold = run.hold()..device.own.len();
        let held = |of: &dyn Fn(usize) -> Vec3| mean(&hold.clone().map(of).collect::<Vec<_>>());
        let rendered = held(&|tick| device.force[tick]);
        let mut rest = device.rest;
        if device
            .limited
            .iter()
            .skip(hold.start)
            .any(|limited| *limited)
        {
            rest *= (rendered.norm() / rest.norm().max(f64::MIN_POSITIVE)).min(1.0);
        }
        let own = rest.norm();
        Self {
            hold_error: (rendered - rest).norm() / own.max(LEAST_FORCE),
            run_error: rms(&force) / peak.max(LEAST_FORCE),
            peak,
            worst_ripple: beyond(run, device, expected, |part| band_rms(part, run.period)),
            jump: beyond(run, device, expected, largest_jump) / device.friction.max(LEAST_FRICTION),
            leaves: device.leaves.norm() / own.max(LEAST_FORCE),
            hold_moment: held(&moment).norm(),
            run_moment: rms(&moment),
        }
    }
}

/// The largest `measure` in a window beyond the reference's in that window or in a neighbouring one. Hands under a
/// slightly different force reach every place slightly earlier or later.
fn beyond(
    run: &Trace,
    device: &DeviceTrace,
    expected: &DeviceTrace,
    measure: impl Fn(&[Vec3]) -> f64,
) -> f64 {
    let (length, hop) = (run.tick(WINDOW), run.tick(0.5 * WINDOW).max(1));
    let each = |device: &DeviceTrace| -> Vec<f64> {
        let from = device.force.get(run.tick(BEGIN)..).unwrap_or_default();
        let windows = from.windows(length.max(1)).step_by(hop);
        windows.map(&measure).collect()
    };
    let (found, expected) = (each(device), each(expected));
    let beyond = found.iter().enumerate().map(|(at, found)| {
        let about = expected.iter().take(at + 3).skip(at.saturating_sub(2));
        found - about.copied().fold(0.0, f64::max)
    });
    beyond.fold(0.0, f64::max)
}

/// The largest change of a force from one tick to the next (N).
fn largest_jump(forces: &[Vec3]) -> f64 {
    let pairs = forces.windows(2);
    pairs
        .map(|pair| (pair[1] - pair[0]).norm())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_core::Wrench;
    use std::f64::consts::TAU;

    const TICKS: usize = 4000;

    /// A run of four seconds with the force `force` of the time (s). The body's own force is 2 N.
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
                rest: along(2.0),
                ..DeviceTrace::default()
            }],
            out: vec![0.0; TICKS],
            ..Trace::default()
        }
    }

    fn errors(force: impl Fn(f64) -> f64) -> ForceErrors {
        let draw = Draw::untroubled(100.0, 0.0);
        ForceErrors::of(&run(force), &run(|_| 2.0), &draw)
    }

    #[test]
    fn a_force_is_measured_against_the_bodys_own() {
        let found = errors(|_| 1.9);
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
    fn an_early_error_counts_in_the_run_and_not_in_the_hold() {
        // Half a second in the middle shakes; the last second does not.
        let found = errors(|time| {
            let shakes = (1.5..2.0).contains(&time);
            2.0 + if shakes {
                0.4 * (TAU * 60.0 * time).sin()
            } else {
                0.0
            }
        });
        assert!(found.hold_error < 1e-12);
        // Half a second of 3.6 s, with an amplitude of a fifth: 0.2 sqrt(0.5 x 0.5 / 3.6), to half a tick.
        let expected = 0.2 * (0.25_f64 / 3.6).sqrt();
        assert!((found.run_error - expected).abs() < 0.01 * expected);
        // A window begins every quarter second from 0.4 s on, so the taper of one window keeps at least nine tenths of
        // it.
        let ripple = found.worst_ripple / (0.4 / 2.0_f64.sqrt());
        assert!((0.9..1.1).contains(&ripple), "{ripple}");
    }

    #[test]
    fn ripple_that_the_reference_has_at_about_the_same_time_does_not_count() {
        let shaken = |time: f64| 2.0 + 0.4 * (TAU * 60.0 * time).sin();
        let draw = Draw::untroubled(100.0, 0.0);
        let found = ForceErrors::of(&run(shaken), &run(shaken), &draw);
        assert!(found.worst_ripple < 1e-12);
        let early = |time: f64| if time < 1.0 { shaken(time) } else { 2.0 };
        let found = ForceErrors::of(&run(shaken), &run(early), &draw);
        assert!(found.worst_ripple > 0.2, "{}", found.worst_ripple);
    }

    #[test]
    fn a_force_beyond_the_devices_limit_is_no_error() {
        let mut limited = run(|_| 1.5);
        limited.devices[0].limited.fill(true);
        let draw = Draw::untroubled(100.0, 0.0);
        assert!(ForceErrors::of(&limited, &run(|_| 1.5), &draw).hold_error < 1e-12);
    }
}
