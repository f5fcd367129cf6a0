//! One device as the controller follows it: which of its readings are believed, and where its proxy goes on after it
//! was away.
//!
//! A reading that no hand can have led to since the last is passed over like a missing one: a count that jumps, a
//! number at its end. Should the device stay there, it has been away: past the limiter's patience it gets no force, and
//! the next sound reading is believed, and it goes on from where it was left: [`crate::clutch`].

use crate::clutch::Clutch;
use crate::device::DeviceState;
use crate::geometry::{Pose, Twist};
use crate::proxy::Proxy;
use crate::safety::{Limiter, SafetyConfig};

/// No hand moves a device faster (m/s); a tap ends a tenth as fast.
const FASTEST: f64 = 20.0;
/// No device reaches further (m).
const FURTHEST: f64 = 10.0;
/// Nor is any turned faster (rad/s).
const GIDDIEST: f64 = 1e3;
/// By how much the length of a rotation's quaternion may differ from one: a report's eight bits do less.
const SKEW: f64 = 0.01;

/// A device, its proxy and its last stage.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    pub(crate) proxy: Proxy,
    pub(crate) limiter: Limiter,
    /// The last state that was believed; at rest before the first.
    pub(crate) state: DeviceState,
    /// When that was (ns).
    seen_ns: Option<u64>,
    clutch: Clutch,
}

impl Channel {
    pub(crate) fn new(proxy: Proxy, safety: SafetyConfig) -> Self {
        Self {
            proxy,
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
                .follow(&self.limiter, &mut self.proxy, &self.state, state);
        }
        self.state = *state;
        self.seen_ns = Some(now_ns);
        true
    }

    /// Where the proxy is.
    pub(crate) fn on_scene(&self) -> (Pose, Twist) {
        let (pose, mut twist) = self.proxy.to_scene(&self.state);
        let share = self.clutch.share(&self.limiter);
        twist.linear *= share;
        twist.angular *= share;
        (pose, twist)
    }

    /// How much more than its hand a proxy is pushed, as the clutch goes: the power is the same on both sides.
    pub(crate) fn lever(&self) -> f64 {
        let share = self.clutch.share(&self.limiter);
        if share > 0.0 { 1.0 / share } else { 0.0 }
    }

    fn can_have_come(&self, within_ns: u64, state: &DeviceState) -> bool {
        let way = state.pose.position - self.state.pose.position;
        let time = (within_ns as f64 * 1e-9).max(self.limiter.period());
        way.norm() <= FASTEST * time
    }
}

/// Whether a device can be where this says.
fn is_sound(state: &DeviceState) -> bool {
    let DeviceState { pose, twist, .. } = state;
    let turn = pose.rotation.coords.norm();
    // An estimate may overshoot what a hand does; a limit of speed is the last stage's business.
    let moves = twist.linear.norm() <= 10.0 * FASTEST && twist.angular.norm() <= GIDDIEST;
    state.is_finite() && pose.position.norm() <= FURTHEST && (turn - 1.0).abs() <= SKEW && moves
}
