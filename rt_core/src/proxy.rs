//! The proxy: where a device stands in the scene.
//!
//! "The proxy position is directly coupled to the device position, at haptic rate, as an affine function
//! of the device position" (thesis, chapter 4, section 5). The same map, transposed, brings the wrench
//! back, so that with a force scale of one the power at the hand equals the power in the scene.

use crate::device::DeviceState;
use crate::geometry::{Pose, Twist, Vec3, Wrench};
use nalgebra::UnitQuaternion;

/// An affine map from a device's axes to the scene's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proxy {
    /// Where the device's origin lies in the scene (m).
    pub origin: Vec3,
    /// From device axes to world axes.
    pub rotation: UnitQuaternion<f64>,
    /// Scene metres per device metre.
    pub motion_scale: f64,
    /// Newtons at the hand per newton in the scene, on top of what the motion scale asks for; anything but
    /// one gives up the balance of power.
    pub force_scale: f64,
}

impl Proxy {
    /// Device axes parallel to the world's, unscaled, the device's origin at `origin` (m).
    pub fn at(origin: Vec3) -> Self {
        Self {
            origin,
            rotation: UnitQuaternion::identity(),
            motion_scale: 1.0,
            force_scale: 1.0,
        }
    }

    /// Leaves `share` of a device's way from `left` to `now` behind: with one, the proxy stays where it is.
    pub fn slip(&mut self, share: f64, left: &DeviceState, now: &DeviceState) {
        let way = left.pose.position - now.pose.position;
        self.origin += self.rotation * way * (self.motion_scale * share);
    }

    /// The proxy's pose and twist in the scene.
    pub fn to_scene(&self, state: &DeviceState) -> (Pose, Twist) {
        let pose = Pose {
            position: self.origin + self.rotation * state.pose.position * self.motion_scale,
            rotation: self.rotation * state.pose.rotation * self.rotation.inverse(),
        };
        let twist = Twist {
            linear: self.rotation * state.twist.linear * self.motion_scale,
            angular: self.rotation * state.twist.angular,
        };
        (pose, twist)
    }

    /// A wrench on the proxy (world axes) as the device is to render it (device axes).
    pub fn to_device(&self, wrench: &Wrench) -> Wrench {
        let back = self.rotation.inverse();
        Wrench {
            force: back * wrench.force * (self.motion_scale * self.force_scale),
            moment: back * wrench.moment * self.force_scale,
        }
    }

    /// The other way: the wrench on the proxy (world axes) that a device's wrench (its own axes) renders. Zero where the
    /// scales leave nothing to render.
    pub fn on_proxy(&self, wrench: &Wrench) -> Wrench {
        let back = |scale: f64| if scale == 0.0 { 0.0 } else { 1.0 / scale };
        Wrench {
            force: self.rotation * wrench.force * back(self.motion_scale * self.force_scale),
            moment: self.rotation * wrench.moment * back(self.force_scale),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = Vec3> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn power_is_the_same_on_both_sides(
            turn in vector(), v in vector(), w in vector(), f in vector(), m in vector(),
            scale in 0.1..10.0,
        ) {
            let proxy = Proxy {
                rotation: UnitQuaternion::from_scaled_axis(turn),
                motion_scale: scale,
                ..Proxy::at(Vec3::zeros())
            };
            let state = DeviceState {
                twist: Twist { linear: v, angular: w },
                ..DeviceState::resting()
            };
            let wrench = Wrench { force: f, moment: m };
            let (_, scene) = proxy.to_scene(&state);
            let device = proxy.to_device(&wrench);
            let in_scene = f.dot(&scene.linear) + m.dot(&scene.angular);
            let at_hand = device.force.dot(&v) + device.moment.dot(&w);
            // Rounding of numbers of order ten.
            prop_assert!((in_scene - at_hand).abs() < 1e-13);
        }
    }
}
