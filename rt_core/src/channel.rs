//! One device as the controller follows it: which readings the controller believes, and where the proxy continues after
//! the device was away.
//!
//! The controller rejects a reading that no motion of a hand since the last reading explains: a count that jumps, or a
//! coordinate at the end of its range. A rejected reading counts as a missing reading. If such readings persist, the
//! device counts as away, and gets no force once the patience of the limiter is over. The controller then believes the
//! next sound reading, and the proxy continues from where the device left it ([`crate::clutch`]). The proxy of a device
//! that has to be engaged first waits where the handle rests.

use crate::clutch::Clutch;
use crate::coupling::Passed;
use crate::device::{DeviceState, Freedom, Reading};
use crate::device_frame::DeviceFrame;
use crate::engage::Engagement;
use crate::geometry::{Pose, Twist, Vec6, Wrench};
use crate::held_back::HeldBackByDevice;
use crate::limits::{LARGEST_ANGULAR_RATE, LARGEST_REACH, LARGEST_SPEED};
use crate::safety::{Limiter, SafetyConfig};
use crate::slip::{Asked, Slip};
use crate::square_wave::SquareWave;
use nalgebra::UnitQuaternion;

/// Factor by which an estimated velocity may exceed the largest velocity of a hand. The last stage limits the speed of
/// the hand itself.
const OVERSHOOT: f64 = 10.0;
/// Largest difference between one and the length of a rotation's quaternion. The 16-bit numbers of a report err by
/// less.
const SKEW: f64 = 0.01;

/// A device, its frame and its last stage.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    /// The number of the device in the lists of the controller.
    pub(crate) device: usize,
    pub(crate) frame: DeviceFrame,
    pub(crate) limiter: Limiter,
    pub(crate) engagement: Engagement,
    /// The force that the last stage held back.
    pub(crate) held_back: HeldBackByDevice,
    /// The last state that was believed. Before the first, a state at rest at the place where the proxy waits.
    pub(crate) state: DeviceState,
    /// Whether the believed state is that of this tick.
    pub(crate) fresh: bool,
    /// The sum of the bodies' wrenches on the proxy in this tick, and of the square wave (scene axes).
    pub(crate) wrench: Wrench,
    /// The square wave that the device is commanded beside the forces of bodies.
    pub(crate) square_wave: Option<SquareWave>,
    /// The part of its force that the last stage passed, times the lever.
    pub(crate) passed: Passed,
    /// Time of the believed state (ns).
    seen_ns: Option<u64>,
    clutch: Clutch,
    slip: Slip,
    /// The fraction of a force that the limits of the device let pass last.
    allowed: f64,
}

impl Channel {
    pub(crate) fn new(device: usize, frame: DeviceFrame, safety: SafetyConfig) -> Self {
        let limiter = Limiter::new(safety);
        let clutch = Clutch::before(&limiter);
        let mut state = DeviceState::resting();
        if clutch.is_open() {
            state.pose.position = safety.engage.waits_at;
        }
        Self {
            device,
            frame,
            clutch,
            slip: Slip::none(),
            limiter,
            engagement: Engagement::new(safety.engage),
            held_back: HeldBackByDevice::default(),
            state,
            fresh: false,
            wrench: Wrench::zero(),
            square_wave: None,
            passed: Passed::NONE,
            seen_ns: None,
            allowed: 1.0,
        }
    }

    /// Takes the reading of a tick, before any body acts on the proxy.
    pub(crate) fn read(&mut self, now_ns: u64, reading: &Reading) {
        let state = reading.as_ref();
        self.fresh = state.is_ok_and(|state| self.follow(now_ns, state));
        self.wrench = Wrench::zero();
        if let Some(wave) = &self.square_wave {
            self.wrench.force = wave.at(now_ns);
        }
    }

    /// Takes the state that the device gave. Returns whether the state is believed.
    pub(crate) fn follow(&mut self, now_ns: u64, state: &DeviceState) -> bool {
        if !is_sound(state) {
            return false;
        }
        if let Some(seen_ns) = self.seen_ns {
            let within_ns = now_ns.saturating_sub(seen_ns);
            if !self.limiter.is_stale() && !self.can_have_come(within_ns, state) {
                return false;
            }
        }
        self.engagement.see(state.buttons);
        self.limiter.hear(state.rendering);
        // The proxy of a device that is engaged from the start begins where the device first appears.
        let before = if self.seen_ns.is_some() || self.clutch.is_open() {
            &self.state
        } else {
            state
        };
        (self.clutch).follow(&self.limiter, &mut self.frame, before, state);
        self.state = *state;
        self.seen_ns = Some(now_ns);
        true
    }

    /// Pose and twist of the proxy in the scene, without its slip.
    pub(crate) fn on_scene(&self) -> (Pose, Twist) {
        let (pose, mut twist) = self.frame.to_scene(&self.state);
        let fraction = self.clutch.fraction(&self.limiter);
        twist.linear *= fraction;
        twist.angular *= fraction;
        (pose, twist)
    }

    /// Slips the proxy as `asked`. Returns the displacement by which its slip would go back in the next tick (m, rad; axes of
    /// the scene). The proxy of a device that renders no force stays.
    pub(crate) fn slip(&mut self, asked: &Asked) -> Option<Vec6> {
        if self.clutch.is_open() || self.limiter.is_apart() {
            return None;
        }
        let (period, scale) = (self.limiter.period(), self.frame.motion_scale.abs());
        // Only a turn needs to know how the proxy is oriented.
        let rotation = if self.limiter.actuated().turns() {
            let (mut pose, _) = self.on_scene();
            self.slip.carry(&mut pose);
            pose.rotation
        } else {
            UnitQuaternion::identity()
        };
        let by = match asked {
            Asked::Nothing | Asked::Stay => return None,
            Asked::Back => self.slip.way_back(&rotation, period, scale),
            Asked::Away(by) => self.slip.bound(&self.rendered(by), period, scale),
        };
        self.slip.shift(&by, &rotation);
        Some(self.slip.way_back(&rotation, period, scale))
    }

    /// The part of a displacement (m, rad; axes of the scene) along the motions whose force the device renders.
    fn rendered(&self, by: &Vec6) -> Vec6 {
        let mut by = *by;
        let actuated = self.limiter.actuated();
        if let Freedom::Along(axes) = actuated {
            let along = self
                .frame
                .rendered_along(axes, &by.fixed_rows::<3>(0).into());
            by.fixed_rows_mut::<3>(0).copy_from(&along);
        }
        if !actuated.turns() {
            by.fixed_rows_mut::<3>(3).fill(0.0);
        }
        by
    }

    /// The slip of the proxy.
    pub(crate) fn slipped(&self) -> &Slip {
        &self.slip
    }

    /// Ratio of the force on the proxy to the force on its hand. The clutch is a transformer, so the power is the same
    /// on both sides.
    pub(crate) fn lever(&self) -> f64 {
        let fraction = self.clutch.fraction(&self.limiter);
        if fraction > 0.0 { 1.0 / fraction } else { 0.0 }
    }

    /// The fraction of a force that the limits of the device let pass, in a tick in which this fraction `passed` the last
    /// stage. A force that fades, comes in or is away says nothing of the limits.
    pub(crate) fn allow(&mut self, passed: f64) -> f64 {
        let fraction = self.limiter.fraction();
        if fraction > 0.0 {
            self.allowed = (passed / fraction).min(1.0);
        }
        self.allowed
    }

    fn can_have_come(&self, within_ns: u64, state: &DeviceState) -> bool {
        let displacement = state.pose.position - self.state.pose.position;
        let time = (within_ns as f64 * 1e-9).max(self.limiter.period());
        displacement.norm() <= LARGEST_SPEED * time
    }
}

/// Whether a device can be in this state. No comparison holds for a number that is not finite, and each number of the
/// state is in a comparison.
fn is_sound(state: &DeviceState) -> bool {
    let DeviceState { pose, twist, .. } = state;
    let turn = pose.rotation.coords.norm();
    let moves = twist.linear.norm() <= OVERSHOOT * LARGEST_SPEED
        && twist.angular.norm() <= OVERSHOOT * LARGEST_ANGULAR_RATE;
    let within_reach = pose.position.norm() <= LARGEST_REACH;
    within_reach && (turn - 1.0).abs() <= SKEW && moves
}

#[cfg(test)]
mod tests;
