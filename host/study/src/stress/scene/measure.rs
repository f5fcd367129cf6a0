//! What is measured of a run: how still a hold is, how much energy came out, how far the forces are off.

use super::draw::{BEGIN, Draw, Span};
use super::felt::Felt;
use physics::Vec3;
use rt_core::{Pose, Wrench};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A hold is bounded below this ripple (N, root mean square),
pub const MOST_RIPPLE: f64 = 0.3;
/// below this motion (m, root mean square),
pub const MOST_MOTION: f64 = 0.5e-3;
/// and with at most this much more of its ticks at the device's limit than the reference's.
pub const MOST_SATURATED: f64 = 0.01;
/// The ripple's band (Hz).
const BAND: [f64; 2] = [20.0, 400.0];
/// Forces below this (N) are no measure for an error: about what a device's friction hides.
pub(super) const LEAST_FORCE: f64 = 0.1;
/// Length of the hold at a run's end, in which it is measured how still the hands are (s).
const HOLD: f64 = 1.0;

/// One device through a run, a value a tick.
#[derive(Clone, Debug, Default)]
pub struct DeviceTrace {
    /// What the motors hold (N).
    pub force: Vec<Vec3>,
    /// The same of the handle's rotation (N m).
    pub moment: Vec<Vec3>,
    /// Where the handle truly is (m), from its start.
    pub position: Vec<Vec3>,
    /// Whether the force was shortened to the device's limit.
    pub limited: Vec<bool>,
    /// What the body of the host exerts where its handle is (N).
    pub body: Vec<Vec3>,
    /// Where in the scene a body that is stepped along the run is to be: see `reference::follow`.
    pub proxy: Vec<Pose>,
    /// What such a body exerts there, as the device would render it (its own axes).
    pub own: Vec<Wrench>,
}

impl DeviceTrace {
    /// The direction of the largest force; along x where there is none.
    pub fn main_direction(&self) -> Vec3 {
        let largest = self.force.iter().fold(Vec3::zeros(), |a: Vec3, b| {
            if b.norm_squared() > a.norm_squared() {
                *b
            } else {
                a
            }
        });
        largest.try_normalize(1e-9).unwrap_or_else(Vec3::x)
    }
}

/// A whole run.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// The tick's period (s).
    pub period: f64,
    /// The devices.
    pub devices: Vec<DeviceTrace>,
    /// Work done on the hands, less what was stored at the start (J).
    pub out: Vec<f64>,
    /// The controller's own account: what it has to spend, and what the local model stores (J).
    pub account: Vec<[f64; 2]>,
    /// Ticks in which a cap took something off.
    pub capped: u64,
    /// From when the body softened until the first word of it came to the tick.
    pub unaware: Span,
}

impl Trace {
    /// Tick at `time` (s).
    pub(super) fn tick(&self, time: f64) -> usize {
        (time / self.period).round() as usize
    }

    /// The first tick of the hold.
    pub(super) fn hold(&self) -> usize {
        self.out.len().saturating_sub(self.tick(HOLD))
    }

    /// Net energy that came out at the hands (J): the most that there ever was. Nothing before the first tick.
    pub fn net_energy(&self) -> f64 {
        self.out.iter().copied().fold(0.0, f64::max)
    }

    /// How still the worst device is held.
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

    /// How far the forces are off those of `reference`, as a share of them: root mean squares over all devices and
    /// those ticks since the hands began to move that `counts` (s) names.
    fn error(&self, reference: &Self, counts: impl Fn(f64) -> bool) -> Option<f64> {
        let (mut off, mut whole, mut samples) = (0.0, 0.0, 0.0);
        for (mine, right) in self.devices.iter().zip(&reference.devices) {
            let pairs = mine.force.iter().zip(&right.force).enumerate();
            for (tick, (mine, right)) in pairs.skip(self.tick(BEGIN)) {
                if counts(tick as f64 * self.period) {
                    off += (mine - right).norm_squared();
                    whole += right.norm_squared();
                    samples += 1.0;
                }
            }
        }
        let least = LEAST_FORCE * LEAST_FORCE * samples;
        (samples > 0.0).then(|| (off / whole.max(least)).sqrt())
    }

    /// By how much the mean force of the hold is off what the body itself exerts at the same place, as a share.
    fn stiffness_error(&self) -> f64 {
        let from = self.hold();
        let (mut off, mut whole) = (0.0, 0.0);
        for device in &self.devices {
            let (mine, right) = (mean(&device.force[from..]), mean(&device.body[from..]));
            off += (mine - right).norm_squared();
            whole += right.norm_squared();
        }
        let least = LEAST_FORCE * LEAST_FORCE * self.devices.len() as f64;
        (off / whole.max(least)).sqrt()
    }
}

/// How still a hold is, by its least still device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stillness {
    /// Force from 20 to 400 Hz (N, root mean square).
    pub ripple: f64,
    /// Motion about its mean (m, root mean square).
    pub motion: f64,
    /// Share of the ticks at the device's limit.
    pub saturated: f64,
}

/// What one scheme made of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Whether the hold is bounded.
    pub bounded: bool,
    /// How still it is.
    #[serde(flatten)]
    pub stillness: Stillness,
    /// Net energy that came out at the hands (J).
    pub net_energy: f64,
    /// Force error against the reference over the whole motion, a share.
    pub error: f64,
    /// The same without the time in which the body had softened and no word of it had come: the reference, which needs
    /// none, knows at once what no tick can.
    pub error_aware: Option<f64>,
    /// The same without the times of faults and what they left behind; none where nothing is left.
    pub error_untroubled: Option<f64>,
    /// Error of the force of the hold against the body's own at the same place, a share.
    pub stiffness_error: f64,
    /// Share of the ticks in which a cap took something off.
    pub capped: f64,
    /// What was felt over the whole run against the body's own.
    #[serde(flatten)]
    pub felt: Felt,
}

impl Outcome {
    /// Measures a run, along which a body was led (`reference::follow`), against its reference.
    pub fn of(run: &Trace, reference: &Trace, draw: &Draw) -> Self {
        let stillness = run.stillness();
        let right = reference.stillness();
        let ticks = run.out.len().max(1) as f64;
        Self {
            bounded: stillness.ripple < MOST_RIPPLE
                && stillness.motion < MOST_MOTION
                && stillness.saturated <= right.saturated + MOST_SATURATED,
            stillness,
            net_energy: run.net_energy(),
            error: run.error(reference, |_| true).unwrap_or_default(),
            error_aware: run.error(reference, |time| !run.unaware.holds(time)),
            error_untroubled: run.error(reference, |time| !draw.is_troubled(time)),
            stiffness_error: run.stiffness_error(),
            capped: run.capped as f64 / ticks,
            felt: Felt::of(run, reference, draw),
        }
    }
}

pub(super) fn mean(values: &[Vec3]) -> Vec3 {
    values.iter().sum::<Vec3>() / values.len().max(1) as f64
}

/// Root mean square of the distance from the mean.
fn spread(values: &[Vec3]) -> f64 {
    let mean = mean(values);
    let sum: f64 = values.iter().map(|v| (v - mean).norm_squared()).sum();
    (sum / values.len().max(1) as f64).sqrt()
}

/// Root mean square of what lies in the band. A Hann window keeps a slow drift out of it; the window's own mean
/// square is made up for.
pub(super) fn band_rms(values: &[Vec3], period: f64) -> f64 {
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
    // Parseval: each line and its mirror, of n samples, by the window's mean square of 3/8.
    (2.0 * power / (n as f64 * n as f64) / 0.375).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A second of `amplitude` (N) at `hertz` on a drift.
    fn sine(hertz: f64, amplitude: f64) -> Vec<Vec3> {
        (0..1000)
            .map(|k| f64::from(k) * 1e-3)
            .map(|t| Vec3::new(amplitude * (TAU * hertz * t).sin(), 1.0 + 0.5 * t, 0.0))
            .collect()
    }

    #[test]
    fn ripple_is_what_lies_in_its_band() {
        for hertz in [40.0, 123.4, 350.0] {
            let found = band_rms(&sine(hertz, 0.3), 1e-3);
            // A line of a Hann window is three wide, of which none is at the band's end here. A drift of 0.5 N/s
            // leaks 1e-4 N past 20 Hz.
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
    fn errors_are_shares_of_the_references_force() {
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
        // No error of nothing: a force of a milliagram's weight is not 100 % off.
        assert!(Outcome::of(&run(1e-3), &run(0.0), &draw).error < 0.011);
    }
}
