//! A recorded motion, band-limited to voluntary motion.
//!
//! The band is limited once, when the trajectory is built:
//!
//! 1. A cubic Hermite curve joins the samples. Its slope at each sample is that of the parabola through the sample and
//!    its neighbours (Catmull–Rom for even spacing). The curve is sampled every millisecond.
//! 2. A second-order Butterworth low-pass runs over the samples forwards, then backwards. Both passes together have no
//!    delay and the gain `1 / (1 + (f / 6.23 Hz)^4)`, which is -3 dB at 5 Hz (Winter, Biomechanics and Motor Control of
//!    Human Movement: a cut-off of 5 Hz / 0.802). The gain falls short of one by 0.07 % at 1 Hz and by 1.1 % at 2 Hz,
//!    and is 0.9 % at 20 Hz. The first and last positions are taken to last for ever.
//!
//! Sampling every millisecond aliases the part of a recording above 500 Hz into the band, so the recording must not
//! have such a part. Between milliseconds, the curve is Catmull–Rom again.

use super::{BAND_HZ, TrajectoryError, check_timed};
use crate::curve::{Knot, hermite};
use core::f64::consts::{PI, SQRT_2};
use rt_core::Vec3;

/// Largest duration of a recording (s); an hour takes 86 MB.
pub const MAX_DURATION: f64 = 3600.0;

/// Interval between the stored points (s).
const STEP: f64 = 1e-3;
/// Number of points by which the held ends extend the recording. The filter's transient decays as `exp(-27.7 t)`, to
/// 1e-12 in a second.
const MARGIN: usize = 1000;
/// Two passes of a second-order Butterworth filter at `f` have -3 dB at 0.802 f.
const TWO_PASSES: f64 = 0.802;

#[derive(Clone, Debug)]
pub(super) struct Recorded {
    /// Displacement (m) every [`STEP`].
    points: Vec<Vec3>,
}

impl Recorded {
    pub(super) fn new(samples: &[(f64, Vec3)]) -> Result<Self, TrajectoryError> {
        check_timed(samples, 2)?;
        let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
            return Err(TrajectoryError::TooFew {
                found: samples.len(),
                needed: 2,
            });
        };
        let found = last.0 - first.0;
        if found > MAX_DURATION {
            return Err(TrajectoryError::TooLong {
                found,
                limit: MAX_DURATION,
            });
        }
        let mut points = vec![Vec3::zeros(); MARGIN];
        resample(samples, first, &mut points);
        points.resize(points.len() + MARGIN, last.1 - first.1);
        low_pass(&mut points);
        points.reverse();
        low_pass(&mut points);
        points.reverse();
        points.drain(..MARGIN);
        let start = points.first().copied().unwrap_or_else(Vec3::zeros);
        for point in &mut points {
            *point -= start;
        }
        Ok(Self { points })
    }

    pub(super) fn at(&self, time: f64) -> Knot {
        let place = (time / STEP).max(0.0);
        let k = place as usize;
        let (Some(from), Some(to)) = (self.points.get(k), self.points.get(k + 1)) else {
            return (
                self.points.last().copied().unwrap_or_else(Vec3::zeros),
                Vec3::zeros(),
            );
        };
        let before = k
            .checked_sub(1)
            .and_then(|k| self.points.get(k))
            .unwrap_or(from);
        let after = self.points.get(k + 2).unwrap_or(to);
        let slopes = ((to - before) / (2.0 * STEP), (after - from) / (2.0 * STEP));
        hermite(&(*from, slopes.0), &(*to, slopes.1), STEP, place - k as f64)
    }
}

/// Appends the displacement from `first` every [`STEP`] from the first sample to the last.
fn resample(samples: &[(f64, Vec3)], first: &(f64, Vec3), points: &mut Vec<Vec3>) {
    let slope = |a: &(f64, Vec3), b: &(f64, Vec3)| (b.1 - a.1) / (b.0 - a.0);
    let mut slope_before: Option<Vec3> = None;
    let mut count = 0_u32;
    for (k, pair) in samples.windows(2).enumerate() {
        let [a, b] = pair else { continue };
        let here = slope(a, b);
        // The slope at `a`, then at `b`, of the parabola through the point and its neighbours.
        let at_a = slope_before.unwrap_or(here);
        let at_b = samples.get(k + 2).map_or(here, |c| {
            let (h0, h1) = (b.0 - a.0, c.0 - b.0);
            (here * h1 + slope(b, c) * h0) / (h0 + h1)
        });
        slope_before = Some(at_b);
        let duration = b.0 - a.0;
        loop {
            let time = first.0 + f64::from(count) * STEP;
            if time >= b.0 {
                break;
            }
            let (p, _) = hermite(
                &(a.1, at_a),
                &(b.1, at_b),
                duration,
                (time - a.0) / duration,
            );
            points.push(p - first.1);
            count += 1;
        }
    }
}

/// A second-order Butterworth low-pass (bilinear transform, direct form II transposed) in place. It starts as if the
/// first value had lasted for ever.
fn low_pass(values: &mut [Vec3]) {
    let k = libm::tan(PI * (BAND_HZ / TWO_PASSES) * STEP);
    let scale = 1.0 / (1.0 + SQRT_2 * k + k * k);
    let b = k * k * scale;
    let (a1, a2) = (
        2.0 * (k * k - 1.0) * scale,
        (1.0 - SQRT_2 * k + k * k) * scale,
    );
    let rest = values.first().copied().unwrap_or_else(Vec3::zeros);
    let (mut s1, mut s2) = (Vec3::zeros(), Vec3::zeros());
    for value in values {
        let x = *value - rest;
        let y = x * b + s1;
        s1 = x * (2.0 * b) - y * a1 + s2;
        s2 = x * b - y * a2;
        *value = y + rest;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    fn sampled(step: f64, count: u32, f: impl Fn(f64) -> f64) -> Recorded {
        let sample = |k| {
            let t = f64::from(k) * step;
            (100.0 + t, Vec3::new(0.5 + f(t), 0.0, 1.0))
        };
        Recorded::new(&(0..count).map(sample).collect::<Vec<_>>()).unwrap()
    }

    /// Gain at `frequency`, by correlation over whole periods in the middle of a long recording.
    fn gain(frequency: f64) -> (f64, f64) {
        let recorded = sampled(2e-3, 5000, |t| 0.01 * libm::sin(TAU * frequency * t));
        let (mut sine, mut cosine) = (0.0, 0.0);
        for k in 0..4000 {
            let t = 3.0 + 1e-3 * f64::from(k);
            let x = recorded.at(t).0.x;
            let (s, c) = libm::sincos(TAU * frequency * t);
            sine += x * s;
            cosine += x * c;
        }
        (sine / 2000.0 / 0.01, cosine / 2000.0 / 0.01)
    }

    #[test]
    fn the_band_passes_without_delay_and_higher_frequencies_are_cut() {
        for (frequency, tolerance) in [
            (0.5, 1e-6),
            (1.0, 2e-6),
            (2.0, 2e-5),
            (5.0, 1e-4),
            (20.0, 1e-4),
        ] {
            let (in_phase, quadrature) = gain(frequency);
            let expected = 1.0 / (1.0 + (frequency * 0.802 / 5.0_f64).powi(4));
            // The bilinear transform warps the frequency axis by (pi f dt)^2 / 3, and the gain falls by four times its
            // loss: 1e-8, 5e-7, 2e-5, 7e-5 and 5e-5 in turn. The interpolations err by less.
            assert!(
                (in_phase - expected).abs() < tolerance,
                "{frequency} {in_phase} {expected}"
            );
            // No delay: only rounding, and the rest of the transient at the ends.
            assert!(quadrature.abs() < 1e-11, "{frequency} {quadrature}");
        }
        assert!(gain(20.0).0 < 0.01);
    }

    #[test]
    fn a_slow_reach_is_met_sample_by_sample() {
        // 0.1 m in 2 s, recorded unevenly (2 to 8 ms).
        let reach = |t: f64| 0.1 * crate::curve::minimum_jerk(t / 2.0).0;
        let mut samples = Vec::new();
        let mut t = 0.0;
        for k in 0..500_u32 {
            samples.push((t, Vec3::new(0.0, reach(t), 0.0)));
            t += 2e-3 + 6e-3 * f64::from(k % 7) / 6.0;
        }
        let recorded = Recorded::new(&samples).unwrap();
        let worst = samples
            .iter()
            .map(|(t, p)| (recorded.at(*t).0 - p).norm())
            .fold(0.0, f64::max);
        // Inside, the filter removes f^(4)(t) / (2 pi 6.23)^4 = 0.1 * 360 / 16 / 2.35e6 = 1 µm. The jump of the jerk at
        // the ends, 60 d / T^3 = 0.75 m/s^3 over (2 pi 6.23)^3, adds up to 13 µm.
        assert!(worst < 1.5e-5, "{worst}");
        assert!(worst > 1e-9, "the filter must have been at work");
    }

    #[test]
    fn it_starts_at_zero_and_comes_to_rest_after_the_end() {
        // The recording ends in full motion.
        let recorded = sampled(1e-2, 200, |t| 0.05 * t);
        assert_eq!(recorded.at(0.0).0, Vec3::zeros());
        assert_eq!(recorded.at(-1.0).0, Vec3::zeros());
        let (held, velocity) = recorded.at(50.0);
        // The straight line reaches 0.05 * 1.99. At the start, the filter rounds the corner by less than velocity / (2
        // pi 6.23 Hz) = 1.3 mm.
        assert!((held.x - 0.0995).abs() < 1.3e-3 && velocity == Vec3::zeros());
        let mut last = recorded.at(2.0).1;
        for k in 1..4000 {
            let now = recorded.at(2.0 + 1e-3 * f64::from(k)).1;
            // No jump of the velocity: from 0.05 m/s to rest at less than 0.05 * 2 pi 6.23 = 2 m/s^2.
            assert!((now - last).norm() < 2e-3);
            last = now;
        }
    }
}
