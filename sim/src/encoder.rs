//! The encoders of a device, and the velocity that the driver estimates from them.

use nalgebra::UnitQuaternion;
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
    /// Time of the last sample; `None` before the first.
    sampled_at_ns: Option<u64>,
}

impl Encoder {
    /// Encoders with counts of `step` (m), sampled every `period` (s). A gap counts for `longest_gap_ns` at most.
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

    /// Takes the true position (m) at `time_ns`. A repeated time adds no sample.
    pub(crate) fn sample(&mut self, time_ns: u64, position: &Vec3) {
        if self.sampled_at_ns == Some(time_ns) {
            return;
        }
        let counted = position.map(|x| (x / self.step).round() * self.step);
        let from = self.position;
        let periods = periods_since(
            self.sampled_at_ns,
            time_ns,
            self.longest_gap_ns,
            self.period,
        );
        for k in 1..=periods {
            let between = from + (counted - from) * (f64::from(k) / f64::from(periods));
            self.velocity = self.estimator.update(&between);
        }
        self.position = counted;
        self.sampled_at_ns = Some(time_ns);
    }

    /// The position that the encoders show (m), a whole number of counts.
    pub(crate) fn position(&self) -> Vec3 {
        self.position
    }

    /// The estimated velocity (m/s).
    pub(crate) fn velocity(&self) -> Vec3 {
        self.velocity
    }
}

/// Encoders of a rotation, and the driver's estimate of angular velocity from them.
///
/// The encoders count the rotation vector (axis times angle) by coordinate, as a gimbal near its middle counts its
/// joints. The velocity is estimated from the sum of the rotations between samples, which never jumps, unlike angles.
#[derive(Clone, Debug)]
pub(crate) struct TurnEncoder {
    step: f64,
    period: f64,
    longest_gap_ns: u64,
    estimator: VelocityEstimator,
    orientation: UnitQuaternion<f64>,
    /// Sum of the rotations between samples (rad).
    turned: Vec3,
    velocity: Vec3,
    /// Time of the last sample; `None` before the first.
    sampled_at_ns: Option<u64>,
}

impl TurnEncoder {
    /// Encoders with counts of `step` (rad), sampled every `period` (s). A gap counts for `longest_gap_ns` at most.
    pub(crate) fn new(step: f64, period: f64, longest_gap_ns: u64) -> Self {
        Self {
            step,
            period,
            longest_gap_ns,
            estimator: VelocityEstimator::new(period, VelocityEstimator::DEFAULT_CUTOFF),
            orientation: UnitQuaternion::identity(),
            turned: Vec3::zeros(),
            velocity: Vec3::zeros(),
            sampled_at_ns: None,
        }
    }

    /// Takes the true orientation at `time_ns`. A repeated time adds no sample.
    pub(crate) fn sample(&mut self, time_ns: u64, orientation: &UnitQuaternion<f64>) {
        if self.sampled_at_ns == Some(time_ns) {
            return;
        }
        let counts = orientation
            .scaled_axis()
            .map(|x| (x / self.step).round() * self.step);
        let counted = UnitQuaternion::from_scaled_axis(counts);
        let turn = (counted * self.orientation.inverse()).scaled_axis();
        let periods = periods_since(
            self.sampled_at_ns,
            time_ns,
            self.longest_gap_ns,
            self.period,
        );
        for k in 1..=periods {
            let between = self.turned + turn * (f64::from(k) / f64::from(periods));
            self.velocity = self.estimator.update(&between);
        }
        self.turned += turn;
        self.orientation = counted;
        self.sampled_at_ns = Some(time_ns);
    }

    /// The orientation that the encoders show: a rotation vector of whole counts.
    pub(crate) fn orientation(&self) -> UnitQuaternion<f64> {
        self.orientation
    }

    /// The estimated angular velocity (rad/s).
    pub(crate) fn velocity(&self) -> Vec3 {
        self.velocity
    }
}

/// Number of periods between two samples, at least one. The estimator expects one position per period, so after missed
/// ticks it gets evenly interpolated positions.
fn periods_since(last_ns: Option<u64>, now_ns: u64, longest_gap_ns: u64, period: f64) -> u32 {
    last_ns.map_or(1, |last| {
        let gap = now_ns.saturating_sub(last).min(longest_gap_ns);
        (gap as f64 * 1e-9 / period).round().max(1.0) as u32
    })
}
