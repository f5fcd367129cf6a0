//! One device as the controller follows it: which of its readings are believed, and where its proxy goes on after it
//! was away.
//!
//! A reading that no hand can have led to since the last is passed over like a missing one: a count that jumps, a
//! number at its end. Should the device stay there, it has been away: past the limiter's patience it gets no force, and
//! the next sound reading is believed, and it goes on from where it was left: [`crate::clutch`].

use crate::clutch::Clutch;
use crate::device::DeviceState;
use crate::device_frame::DeviceFrame;
use crate::geometry::{Pose, Twist};
use crate::limits::{LARGEST_ANGULAR_RATE, LARGEST_REACH, LARGEST_SPEED};
use crate::safety::{Limiter, SafetyConfig};

/// An estimate of a velocity may overshoot the hand's by so much. How fast a hand may be in the end is the last stage's
/// business.
const OVERSHOOT: f64 = 10.0;
/// By how much the length of a rotation's quaternion may differ from one: a report's eight bits do less.
const SKEW: f64 = 0.01;

/// A device, its frame and its last stage.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    pub(crate) frame: DeviceFrame,
    pub(crate) limiter: Limiter,
    /// The last state that was believed; at rest before the first.
    pub(crate) state: DeviceState,
    /// When that was (ns).
    seen_ns: Option<u64>,
    clutch: Clutch,
}

impl Channel {
    pub(crate) fn new(frame: DeviceFrame, safety: SafetyConfig) -> Self {
        Self {
            frame,
            limiter: Limiter::new(safety),
            state: DeviceState::resting(),
            seen_ns: None,
            clutch: Clutch::new(),
        }
    }

    /// Takes what the device gave; says whether it is believed.
    pub(crate) fn follow(&mut self, now_ns: u64, state: &DeviceState) -> bool {
        if !is_sound(state) {
            return false;
        }
        if let Some(seen_ns) = self.seen_ns {
            let within_ns = now_ns.saturating_sub(seen_ns);
            if !self.limiter.is_stale() && !self.can_have_come(within_ns, state) {
                return false;
            }
            self.clutch
                .follow(&self.limiter, &mut self.frame, &self.state, state);
        }
        self.state = *state;
        self.seen_ns = Some(now_ns);
        true
    }

    /// Where the proxy is.
    pub(crate) fn on_scene(&self) -> (Pose, Twist) {
        let (pose, mut twist) = self.frame.to_scene(&self.state);
        let fraction = self.clutch.fraction(&self.limiter);
        twist.linear *= fraction;
        twist.angular *= fraction;
        (pose, twist)
    }

    /// How much more than its hand a proxy is pushed, as the clutch goes: the power is the same on both sides.
    pub(crate) fn lever(&self) -> f64 {
        let fraction = self.clutch.fraction(&self.limiter);
        if fraction > 0.0 { 1.0 / fraction } else { 0.0 }
    }

    fn can_have_come(&self, within_ns: u64, state: &DeviceState) -> bool {
        let displacement = state.pose.position - self.state.pose.position;
        let time = (within_ns as f64 * 1e-9).max(self.limiter.period());
        displacement.norm() <= LARGEST_SPEED * time
    }
}

/// Whether a device can be where this says.
fn is_sound(state: &DeviceState) -> bool {
    let DeviceState { pose, twist, .. } = state;
    let turn = pose.rotation.coords.norm();
    let moves = twist.linear.norm() <= OVERSHOOT * LARGEST_SPEED
        && twist.angular.norm() <= OVERSHOOT * LARGEST_ANGULAR_RATE;
    let within_reach = pose.position.norm() <= LARGEST_REACH;
    state.is_finite() && within_reach && (turn - 1.0).abs() <= SKEW && moves
}
