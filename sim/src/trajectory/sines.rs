//! Rhythmic motion: a sum of slow sinusoids that fades in from rest.

use super::{BAND_HZ, TrajectoryError};
use crate::curve::{Knot, minimum_jerk};
use core::f64::consts::TAU;
use rt_core::Vec3;

/// One sinusoid, `amplitude sin(2 pi frequency t + phase)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine {
    /// Direction and amplitude (m).
    pub amplitude: Vec3,
    /// Frequency (Hz), above zero and at most [`BAND_HZ`].
    pub frequency: f64,
    /// Phase at time zero (rad).
    pub phase: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Sines {
    sines: Vec<Sine>,
    fade: f64,
}

impl Sines {
    pub(super) fn new(sines: &[Sine], fade: f64) -> Result<Self, TrajectoryError> {
        for (index, sine) in sines.iter().enumerate() {
            let found = sine.frequency;
            let finite = sine
                .amplitude
                .iter()
                .chain([&sine.phase, &found])
                .all(|x| x.is_finite());
            if !finite {
                return Err(TrajectoryError::NotFinite { index });
            }
            if found <= 0.0 || found > BAND_HZ {
                return Err(TrajectoryError::Frequency { index, found });
            }
        }
        if !(fade.is_finite() && fade > 0.0) {
            return Err(TrajectoryError::Fade { found: fade });
        }
        Ok(Self {
            sines: sines.to_vec(),
            fade,
        })
    }

    pub(super) fn at(&self, time: f64) -> Knot {
        let mut position = Vec3::zeros();
        let mut velocity = Vec3::zeros();
        for sine in &self.sines {
            let speed = TAU * sine.frequency;
            let (sin, cos) = libm::sincos(speed * time + sine.phase);
            position += sine.amplitude * sin;
            velocity += sine.amplitude * (speed * cos);
        }
        let (weight, slope) = minimum_jerk(time / self.fade);
        (
            position * weight,
            velocity * weight + position * (slope / self.fade),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_starts_at_rest_and_is_the_plain_sum_after_the_fade() {
        let one = Sine {
            amplitude: Vec3::new(0.01, 0.0, 0.0),
            frequency: 0.7,
            phase: 1.0,
        };
        let two = Sine {
            amplitude: Vec3::new(0.0, 0.004, 0.002),
            frequency: 5.0,
            phase: -0.3,
        };
        let sines = Sines::new(&[one, two], 0.8).unwrap();
        assert_eq!(sines.at(0.0), (Vec3::zeros(), Vec3::zeros()));
        let t = 1.7;
        let plain = one.amplitude * libm::sin(TAU * 0.7 * t + 1.0)
            + two.amplitude * libm::sin(TAU * 5.0 * t - 0.3);
        // The same operations in another order: rounding of numbers below 0.02.
        assert!((sines.at(t).0 - plain).norm() < 1e-16);
        for k in 1..300 {
            let t = 0.01 * f64::from(k);
            let h = 1e-5;
            let slope = (sines.at(t + h).0 - sines.at(t - h).0) / (2.0 * h);
            // Central difference: h^2 / 6 times a jerk of (2 pi 5)^3 * 0.0045 = 140 m/s^3 is 2.4e-9. The fade adds less
            // than the same again; rounding adds 2e-18 / h.
            assert!((slope - sines.at(t).1).norm() < 5e-9);
        }
    }
}
