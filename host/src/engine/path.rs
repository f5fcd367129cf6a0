//! The smoothed path along which the host moves a handle.
//!
//! Encoder counts are steps, and a step in a prescribed position is an infinite velocity to the finite
//! elements. So the host follows the proxy with a fading-memory filter of the first degree (an alpha-beta
//! filter whose two gains come from one time constant; Morrison 1969, also Brookner 1998, section 1.2.6).
//! The filter has no lag at constant velocity and adds no overshoot of its own. The tick compensates the
//! remaining lag, because the local model is published with the actual pose of the handle.

use libm::exp;
use nalgebra::UnitQuaternion;
use rt_core::{Pose, TickRecord, Twist, Vec3};

/// A handle's smoothed pose and twist, advanced by one tick record at a time.
#[derive(Clone, Debug)]
pub(super) struct HandlePath {
    device: usize,
    /// Decay rate of the filter's memory (1/s).
    rate: f64,
    time_ns: Option<u64>,
    /// Whether the path starts at the pose in the first record.
    joins: bool,
    pose: Pose,
    twist: Twist,
}

impl HandlePath {
    /// Follows device number `device` with a cut-off in Hz, starting at rest at `start`.
    pub(super) fn new(device: usize, cutoff: f64, start: Pose) -> Self {
        let rate = 2.0 * core::f64::consts::PI * cutoff;
        Self {
            device,
            rate,
            time_ns: None,
            joins: false,
            pose: start,
            twist: Twist::zero(),
        }
    }

    /// Follows device number `device` from its first record on. Until then the path rests at `start`.
    pub(super) fn joining(device: usize, cutoff: f64, start: Pose) -> Self {
        Self {
            joins: true,
            ..Self::new(device, cutoff, start)
        }
    }

    /// Takes the next record. Records may be missing in between: the filter uses the time from record to record.
    pub(super) fn follow(&mut self, record: &TickRecord) {
        if let Some((target, _)) = record.proxies.get(self.device) {
            self.follow_to(record.time_ns, target);
        }
    }

    /// Takes the next pose, that at `time_ns`.
    pub(super) fn follow_to(&mut self, time_ns: u64, target: &Pose) {
        let Some(last_ns) = self.time_ns.replace(time_ns) else {
            if self.joins {
                self.pose = *target;
            }
            return;
        };
        let dt = time_ns.saturating_sub(last_ns) as f64 * 1e-9;
        if dt <= 0.0 {
            return;
        }
        let memory = exp(-self.rate * dt);
        let alpha = 1.0 - memory * memory;
        let beta = (1.0 - memory) * (1.0 - memory) / dt;

        let predicted = self.pose.position + self.twist.linear * dt;
        let innovation = target.position - predicted;
        self.pose.position = predicted + innovation * alpha;
        self.twist.linear += innovation * beta;

        // A device that senses no rotation reports a constant one, which needs no filter.
        if target.rotation != self.pose.rotation {
            let predicted =
                UnitQuaternion::from_scaled_axis(self.twist.angular * dt) * self.pose.rotation;
            let innovation = (target.rotation * predicted.inverse()).scaled_axis();
            self.pose.rotation = UnitQuaternion::from_scaled_axis(innovation * alpha) * predicted;
            self.twist.angular += innovation * beta;
        }
    }

    /// Time of the newest record taken (ns); none before the first.
    pub(super) fn time_ns(&self) -> Option<u64> {
        self.time_ns
    }

    /// The pose at `time_ns`, extrapolated at the path's velocity. For a time before the newest record this is the
    /// pose at that record.
    pub(super) fn pose_at(&self, time_ns: u64) -> Pose {
        let dt = self.time_ns.map_or(0, |last| time_ns.saturating_sub(last)) as f64 * 1e-9;
        let mut pose = self.pose;
        if dt > 0.0 {
            pose.position += self.twist.linear * dt;
            if self.twist.angular != Vec3::zeros() {
                let turn = UnitQuaternion::from_scaled_axis(self.twist.angular * dt);
                pose.rotation = turn * pose.rotation;
            }
        }
        pose
    }

    /// The filter's velocity (m/s).
    pub(super) fn velocity(&self) -> &Vec3 {
        &self.twist.linear
    }

    /// The filter's angular velocity (rad/s).
    pub(super) fn turning(&self) -> &Vec3 {
        &self.twist.angular
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(tick: u64, x: f64) -> TickRecord {
        let mut record = TickRecord::empty();
        record.tick = tick;
        record.time_ns = tick * 1_000_000;
        record.device_count = 1;
        record.proxies[0].0.position.x = x;
        record
    }

    #[test]
    fn a_steady_motion_is_followed_without_lag_also_across_missing_records() {
        let mut path = HandlePath::new(0, 30.0, Pose::identity());
        for tick in (0..2000).filter(|t| t % 7 != 3) {
            path.follow(&record(tick, 0.05e-3 * tick as f64));
        }
        // 2 s are 377 time constants: the transient is gone, and only rounding is left.
        let expected = 0.05e-3 * 1999.0;
        assert!((path.pose.position.x - expected).abs() < 1e-12);
        assert!((path.twist.linear.x - 0.05).abs() < 1e-10);
    }

    #[test]
    fn encoder_counts_are_smoothed() {
        // The motion takes several ticks for one count. Without the filter the handle would jump by whole counts.
        let step = 38e-6;
        let mut path = HandlePath::new(0, 30.0, Pose::identity());
        let mut last = 0.0;
        let mut largest: f64 = 0.0;
        for tick in 0..3000 {
            let x = 5e-6 * tick as f64;
            path.follow(&record(tick, (x / step).round() * step));
            if tick > 200 {
                largest = largest.max((path.pose.position.x - last).abs());
            }
            last = path.pose.position.x;
        }
        // alpha = 1 - exp(-4 pi 30 / 1000) = 0.314 of a count, and the motion itself.
        assert!(largest < 0.5 * step, "{largest}");
    }
}
