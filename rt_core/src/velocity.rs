//! Velocity from encoder positions, for drivers whose device reports none.
//!
//! A backward difference of quantized positions through a first-order low-pass. One encoder count a tick
//! is 30 to 55 mm/s on common devices, so the raw difference cannot be used for damping; at 80 Hz the
//! filter keeps 40 % of it. Its delay (about 2 ms) is the price.

use crate::geometry::Vec3;

/// A first-order low-pass on the backward difference, one axis triple.
#[derive(Clone, Copy, Debug)]
pub struct VelocityEstimator {
    gain: f64,
    period: f64,
    last: Option<Vec3>,
    velocity: Vec3,
}

impl VelocityEstimator {
    /// Cut-off that keeps quantization noise low without a delay that a hand could feel (Hz).
    pub const DEFAULT_CUTOFF: f64 = 80.0;

    /// For positions sampled every `period` (s), with a cut-off frequency in Hz. The gain is that of the
    /// exactly discretized filter, `1 - exp(-2 pi f T)`.
    pub fn new(period: f64, cutoff: f64) -> Self {
        let gain = 1.0 - libm::exp(-2.0 * core::f64::consts::PI * cutoff * period);
        Self {
            gain,
            period,
            last: None,
            velocity: Vec3::zeros(),
        }
    }

    /// Takes the next position (m); returns the velocity (m/s).
    pub fn update(&mut self, position: &Vec3) -> Vec3 {
        if let Some(last) = self.last {
            let raw = (position - last) / self.period;
            self.velocity += (raw - self.velocity) * self.gain;
        }
        self.last = Some(*position);
        self.velocity
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_is_recovered_and_a_lone_count_is_attenuated() {
        let mut estimator = VelocityEstimator::new(1e-3, VelocityEstimator::DEFAULT_CUTOFF);
        let mut v = Vec3::zeros();
        for k in 0..200 {
            v = estimator.update(&Vec3::new(0.1e-3 * f64::from(k), 0.0, 0.0));
        }
        // 200 samples are 44 time constants: what is left of the transient is far below rounding.
        assert!((v.x - 0.1).abs() < 1e-12, "{}", v.x);
        let mut estimator = VelocityEstimator::new(1e-3, VelocityEstimator::DEFAULT_CUTOFF);
        estimator.update(&Vec3::zeros());
        let v = estimator.update(&Vec3::new(38e-6, 0.0, 0.0));
        // g = 1 - exp(-2 pi 80 / 1000) = 0.3951.
        assert!((v.x / 0.038 - 0.3951).abs() < 1e-4, "{}", v.x);
    }
}
