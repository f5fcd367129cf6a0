//! What a device's encoders show, and the velocity that its driver makes of it.

use rt_core::Vec3;
use rt_core::velocity::VelocityEstimator;

/// Encoders, and the driver's estimate of velocity from them.
#[derive(Clone, Debug)]
pub(crate) struct Encoder {
    step: f64,
    period: f64,
    longest_gap_ns: u64,
    estimator: VelocityEstimator,
    position: Vec3,
    velocity: Vec3,
    /// Time of the last sample; none before the first.
    sampled_at_ns: Option<u64>,
}

impl Encoder {
    /// Counts of `step` (m), sampled every `period` (s); a gap counts for `longest_gap_ns` at most.
    pub(crate) fn new(step: f64, period: f64, longest_gap_ns: u64) -> Self {
        Self {
            step,
            period,
            longest_gap_ns,
            estimator: VelocityEstimator::for_encoder(period, step),
            position: Vec3::zeros(),
            velocity: Vec3::zeros(),
            sampled_at_ns: None,
        }
    }

    /// Takes the true position (m) at `time_ns`; twice the same time is one sample.
    pub(crate) fn sample(&mut self, time_ns: u64, position: &Vec3) {
        if self.sampled_at_ns == Some(time_ns) {
            return;
        }
        let counted = position.map(|x| (x / self.step).round() * self.step);
        let from = self.position;
        // After missed ticks the estimator, which thinks in periods, gets the missing positions evenly.
        let periods = self.sampled_at_ns.map_or(1, |last| {
            let gap = time_ns.saturating_sub(last).min(self.longest_gap_ns);
            (gap as f64 * 1e-9 / self.period).round().max(1.0) as u32
        });
        for k in 1..=periods {
            let between = from + (counted - from) * (f64::from(k) / f64::from(periods));
            self.velocity = self.estimator.update(&between);
        }
        self.position = counted;
        self.sampled_at_ns = Some(time_ns);
    }

    /// The position shown (m), a whole number of counts.
    pub(crate) fn position(&self) -> Vec3 {
        self.position
    }

    /// The velocity estimated (m/s).
    pub(crate) fn velocity(&self) -> Vec3 {
        self.velocity
    }
}
