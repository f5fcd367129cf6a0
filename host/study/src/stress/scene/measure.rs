//! The measurements of a run: the stillness of its hold, the net energy, the error of the forces.

use super::draw::{BEGIN, Draw, Span};
use super::force_errors::ForceErrors;
use physics::Vec3;
use rt_core::{Pose, Vec6, Wrench};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A hold is bounded if its ripple is below this (N, RMS),
pub(crate) const MOST_RIPPLE: f64 = 0.3;
/// its motion is below this (m, RMS),
pub(crate) const MOST_MOTION: f64 = 0.5e-3;
/// and the fraction of its ticks at the device's limit exceeds the reference's by at most this.
pub(crate) const MOST_SATURATED: f64 = 0.01;
/// The band of the ripple (Hz).
const BAND: [f64; 2] = [20.0, 400.0];
/// Errors are not related to forces below this (N), about as large as the friction of a device.
pub(crate) const LEAST_FORCE: f64 = 0.1;
/// Length of the hold at the end of a run (s).
pub(crate) const HOLD: f64 = 1.0;

/// One device in a run, one value for each tick.
#[derive(Clone, Debug, Default)]
pub struct DeviceTrace {
    /// The force of the motors (N).
    pub force: Vec<Vec3>,
    /// The moment of the motors (N m).
    pub moment: Vec<Vec3>,
    /// The true position of the handle (m), relative to its start.
    pub position: Vec<Vec3>,
    /// Whether the force was reduced to the device's limit.
    pub limited: Vec<bool>,
    /// The force that the body of the host exerts at the position of its handle (N).
    pub body: Vec<Vec3>,
    /// The pose in the scene of a body that is moved along the run: see `reference::follow`.
    pub proxy: Vec<Pose>,
    /// The wrench that such a body exerts there, as the device would render it (axes of the device).
    pub own: Vec<Wrench>,
    /// The force that the bodies of the host exert on the device with their handles at rest where they are in the hold (N,
    /// axes of the device): see `reference::rest`.
    pub rest: Vec3,
    /// The Coulomb friction of the device (N).
    pub friction: f64,
    /// The mean distance of the handles from their devices in the hold, in the directions that the devices render as they
    /// are, as a force of the body (N, axes of the device): see the module `rendered`.
    pub leaves: Vec3,
}

impl DeviceTrace {
    /// The direction of the largest force; the x axis if there is no force.
    pub fn main_direction(&self) -> Vec3 {
        main_direction(&self.force)
    }
}

/// Where a handle is in the hold, in the axes of the scene.
#[derive(Clone, Copy, Debug, Default)]
pub struct Apart {
    /// The pose of the handle in the first tick of the hold; none before.
    pub begin: Option<Pose>,
    /// The mean displacement of the handle from that pose (m, rad).
    pub moved: Vec6,
    /// The mean displacement of the handle from the pose of its device (m, rad).
    pub mean: Vec6,
}

/// A whole run.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// The tick's period (s).
    pub period: f64,
    /// The devices.
    pub devices: Vec<DeviceTrace>,
    /// Work done on the hands, less the energy stored at the start (J).
    pub out: Vec<f64>,
    /// The controller's own account: the available energy, and the energy stored in the local model (J).
    pub account: Vec<[f64; 2]>,
    /// Ticks in which a cap withheld force.
    pub capped: u64,
    /// Where each handle of each body is in the hold.
    pub apart: Vec<Vec<Apart>>,
    /// From the softening of the body to the arrival of the first model of the softened body at the tick.
    pub unaware: Span,
}

impl Trace {
    /// The tick at `time` (s).
    pub(super) fn tick(&self, time: f64) -> usize {
        (time / self.period).round() as usize
    }

    /// The first tick of the hold.
    pub(super) fn hold(&self) -> usize {
        self.out.len().saturating_sub(self.tick(HOLD))
    }

    /// Net energy (J): the largest value over time; zero before the first tick.
    pub fn net_energy(&self) -> f64 {
        self.out.iter().copied().fold(0.0, f64::max)
    }

    /// The stillness of the hold, each number that of the worst device.
    pub fn stillness(&self) -> Stillness {
        let from = self.hold();
        let mut worst = Stillness::default();
        for device in &self.devices {
            let limited = device.limited.iter().skip(from);
            let ticks = limited.len().max(1) as f64;
            let found = Stillness {
                ripple: band_rms(&device.force[from..], self.period),
                motion: spread(&device.position[from..]),
                saturated: limited.filter(|limited| **limited).count() as f64 / ticks,
            };
            worst.ripple = worst.ripple.max(found.ripple);
            worst.motion = worst.motion.max(found.motion);
            worst.saturated = worst.saturated.max(found.saturated);
        }
        worst
    }

    /// Error of the forces against those of `reference`, as a fraction of their root mean square: over all devices and
    /// over the ticks since the hands began to move whose time (s) `counts` accepts. None if `counts` accepts no tick.
    fn error(&self, reference: &Self, counts: impl Fn(f64) -> bool) -> Option<f64> {
        let (mut off, mut whole, mut samples) = (0.0, 0.0, 0.0);
        for (found, expected) in self.devices.iter().zip(&reference.devices) {
            let pairs = found.force.iter().zip(&expected.force).enumerate();
            for (tick, (found, expected)) in pairs.skip(self.tick(BEGIN)) {
                if counts(tick as f64 * self.period) {
                    off += (found - expected).norm_squared();
                    whole += expected.norm_squared();
                    samples += 1.0;
                }
            }
        }
        let least = LEAST_FORCE * LEAST_FORCE * samples;
        (samples > 0.0).then(|| (off / whole.max(least)).sqrt())
    }

    /// Error of the mean force of the hold against the force that the body itself exerts at the same place, as a
    /// fraction.
    fn stiffness_error(&self) -> f64 {
        let from = self.hold();
        let (mut off, mut whole) = (0.0, 0.0);
        for device in &self.devices {
            let (found, expected) = (mean(&device.force[from..]), mean(&device.body[from..]));
            off += (found - expected).norm_squared();
            whole += expected.norm_squared();
        }
        let least = LEAST_FORCE * LEAST_FORCE * self.devices.len() as f64;
        (off / whole.max(least)).sqrt()
    }
}

/// How still a hold is: the worst device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stillness {
    /// Force from 20 to 400 Hz (N, RMS).
    pub ripple: f64,
    /// Motion about the mean position (m, RMS).
    pub motion: f64,
    /// Fraction of the ticks at the device's limit.
    pub saturated: f64,
}

/// The measurements of one scheme in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Whether the hold is bounded.
    pub bounded: bool,
    /// The stillness of the hold.
    #[serde(flatten)]
    pub stillness: Stillness,
    /// Net energy (J).
    pub net_energy: f64,
    /// Force error against the reference over the whole motion, a fraction.
    pub error: f64,
    /// Force error as a fraction, without the time between a softening and the arrival of its first model: the reference needs no model
    /// and responds at once, which no tick can.
    pub error_aware: Option<f64>,
    /// Force error as a fraction, without the times of faults and their consequences; none if no time is left.
    pub error_untroubled: Option<f64>,
    /// Force error of the hold against the body's own force at the same place, a fraction.
    pub stiffness_error: f64,
    /// Fraction of the ticks in which a cap withheld force.
    pub capped: f64,
    /// The rendered force over the whole run, compared with the body's own.
    #[serde(flatten)]
    pub force_errors: ForceErrors,
}

impl Outcome {
    /// Measures a run, along which a body was moved (`reference::follow`), against its reference.
    pub fn of(run: &Trace, reference: &Trace, draw: &Draw) -> Self {
        let stillness = run.stillness();
        let expected = reference.stillness();
        let ticks = run.out.len().max(1) as f64;
        Self {
            bounded: stillness.ripple < MOST_RIPPLE
                && stillness.motion < MOST_MOTION
                && stillness.saturated <= expected.saturated + MOST_SATURATED,
            stillness,
            net_energy: run.net_energy(),
            error: run.error(reference, |_| true).unwrap_or_default(),
            error_aware: run.error(reference, |time| !run.unaware.holds(time)),
            error_untroubled: run.error(reference, |time| !draw.is_troubled(time)),
            stiffness_error: run.stiffness_error(),
            capped: run.capped as f64 / ticks,
            force_errors: ForceErrors::of(run, reference, draw),
        }
    }
}

/// The direction of the largest of `forces`; the x axis if there is no force.
pub(crate) fn main_direction(forces: &[Vec3]) -> Vec3 {
    let largest = forces.iter().fold(Vec3::zeros(), |a: Vec3, b| {
        if b.norm_squared() > a.norm_squared() {
            *b
        } else {
            a
        }
    });
    largest.try_normalize(1e-9).unwrap_or_else(Vec3::x)
}

pub(super) fn mean(values: &[Vec3]) -> Vec3 {
    values.iter().sum::<Vec3>() / values.len().max(1) as f64
}

/// Root mean square of the distances from the mean.
fn spread(values: &[Vec3]) -> f64 {
    let mean = mean(values);
    let sum: f64 = values.iter().map(|v| (v - mean).norm_squared()).sum();
    (sum / values.len().max(1) as f64).sqrt()
}

/// Root mean square of the components in [`BAND`]. A Hann window keeps a slow drift out of the band; the result is
/// divided by the mean square of the window.
pub(crate) fn band_rms(values: &[Vec3], period: f64) -> f64 {
    let n = values.len();
    if n == 0 {
        return 0.0;
    }
    let (mean, turn) = (mean(values), TAU / n as f64);
    let waves: Vec<[f64; 2]> = (0..n)
        .map(|k| turn * k as f64)
        .map(|angle| [libm::cos(angle), libm::sin(angle)])
        .collect();
    let windowed: Vec<Vec3> = values
        .iter()
        .zip(&waves)
        .map(|(value, [cosine, _])| (value - mean) * (0.5 - 0.5 * cosine))
        .collect();
    let line = |hertz: f64| hertz * period * n as f64;
    let (first, last) = (line(BAND[0]).ceil() as usize, line(BAND[1]) as usize);
    let mut power = 0.0;
    for number in first..=last.min(n / 2) {
        let (mut real, mut imaginary) = (Vec3::zeros(), Vec3::zeros());
        let mut at = 0;
        for value in &windowed {
            let [cosine, sine] = waves[at];
            real += value * cosine;
            imaginary += value * sine;
            at += number;
            if at >= n {
                at -= n;
            }
        }
        power += real.norm_squared() + imaginary.norm_squared();
    }
    // Parseval: each line and its mirror, for n samples, divided by the window's mean square of 3/8.
    (2.0 * power / (n as f64 * n as f64) / 0.375).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second of a sine of `amplitude` (N) at `hertz`, with a drift.
    fn sine(hertz: f64, amplitude: f64) -> Vec<Vec3> {
        (0..1000)
            .map(|k| f64::from(k) * 1e-3)
            .map(|t| Vec3::new(amplitude * (TAU * hertz * t).sin(), 1.0 + 0.5 * t, 0.0))
            .collect()
    }

    #[test]
    fn ripple_is_the_rms_in_its_band() {
        for hertz in [40.0, 123.4, 350.0] {
            let found = band_rms(&sine(hertz, 0.3), 1e-3);
            // A line of a Hann window is three lines wide, and none of these is at the end of the band here. A drift of
            // 0.5 N/s leaks 1e-4 N past 20 Hz.
            assert!(
                (found - 0.3 / 2.0_f64.sqrt()).abs() < 3e-4,
                "{hertz} {found}"
            );
        }
        for hertz in [3.0, 12.0, 450.0] {
            let found = band_rms(&sine(hertz, 0.3), 1e-3);
            assert!(found < 1e-3, "{hertz} {found}");
        }
    }

    #[test]
    fn errors_are_fractions_of_the_references_force() {
        let run = |force: f64| Trace {
            period: 1e-3,
            devices: vec![DeviceTrace {
                force: vec![Vec3::new(force, 0.0, 0.0); 4500],
                position: vec![Vec3::zeros(); 4500],
                limited: vec![false; 4500],
                body: vec![Vec3::new(2.0, 0.0, 0.0); 4500],
                ..DeviceTrace::default()
            }],
            out: vec![-1.0; 4500],
            ..Trace::default()
        };
        let draw = Draw::new(1, 0, 1);
        let found = Outcome::of(&run(2.1), &run(2.0), &draw);
        assert!((found.error - 0.05).abs() < 1e-12);
        assert!((found.stiffness_error - 0.05).abs() < 1e-12);
        assert!(found.bounded && found.net_energy == 0.0);
        // A force of a tenth of a gram's weight against no force is not an error of 100 %.
        assert!(Outcome::of(&run(1e-3), &run(0.0), &draw).error < 0.011);
    }
}
