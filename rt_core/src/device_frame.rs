//! The device frame: the place and the axes of a device in the scene, which give the pose of its proxy.
//!
//! "The proxy position is directly coupled to the device position, at haptic rate, as an affine function
//! of the device position" (thesis, chapter 4, section 5). The same map, transposed, brings the wrench
//! back, so that with a force scale of one the power at the hand equals the power in the scene.

use crate::device::{Axes, DeviceState};
use crate::geometry::{Pose, Twist, Vec3, Wrench};
use nalgebra::{Quaternion, UnitQuaternion};

/// An affine map from a device's axes to the scene's.
///
/// ```
/// use rt_core::device_frame::DeviceFrame;
/// use rt_core::{DeviceState, Pose, Vec3, Wrench};
///
/// // A device whose origin lies 0.1 m beside that of the scene, and whose motions are doubled.
/// let mut frame = DeviceFrame::at(Vec3::new(0.1, 0.0, 0.0));
/// frame.motion_scale = 2.0;
/// let mut state = DeviceState::resting();
/// state.pose = Pose::at(Vec3::new(0.0, 0.0, 0.01));
/// let (pose, _) = frame.to_scene(&state);
/// assert_eq!(pose.position, Vec3::new(0.1, 0.0, 0.02));
///
/// // The device renders twice the force, so that its work is the work in the scene.
/// let wrench = Wrench { force: Vec3::new(0.0, 0.0, -3.0), moment: Vec3::zeros() };
/// assert_eq!(frame.to_device(&wrench).force, Vec3::new(0.0, 0.0, -6.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceFrame {
    /// Position of the device's origin in the scene (m).
    pub origin: Vec3,
    /// From device axes to world axes.
    pub rotation: UnitQuaternion<f64>,
    /// The part of the device's rotation that a clutch left out. It multiplies the device's rotation from the right.
    pub turned: UnitQuaternion<f64>,
    /// Scene metres per device metre.
    pub motion_scale: f64,
    /// Newtons at the hand per newton in the scene, beside the factor that the motion scale implies. With any value but
    /// one, the power at the hand differs from the power in the scene.
    pub force_scale: f64,
}

impl DeviceFrame {
    /// Device axes parallel to the world's, unscaled, the device's origin at `origin` (m).
    pub fn at(origin: Vec3) -> Self {
        Self {
            origin,
            rotation: UnitQuaternion::identity(),
            turned: UnitQuaternion::identity(),
            motion_scale: 1.0,
            force_scale: 1.0,
        }
    }

    /// Leaves a `fraction` of the device's displacement and rotation from `left` to `now` out of the proxy's motion.
    /// With a fraction of one, the proxy stays where it is.
    pub fn slip(&mut self, fraction: f64, left: &DeviceState, now: &DeviceState) {
        let displacement = left.pose.position - now.pose.position;
        self.origin += self.rotation * displacement * (self.motion_scale * fraction);
        // A device that senses no rotation reports the same rotation in every tick.
        if left.pose.rotation != now.pose.rotation {
            let [from, to] = [left, now].map(|state| self.on_axes(state));
            // Blends quaternions to get a part of the rotation. A hand turns so little in a tick that the blend equals
            // the exact part, and no angle is needed.
            let turn = (to * from.inverse()).coords;
            let turn = if turn.w < 0.0 { -turn } else { turn };
            let part = turn * (1.0 - fraction) + Quaternion::identity().coords * fraction;
            let part = UnitQuaternion::new_normalize(Quaternion::from(part));
            let turned = to.inverse() * part * from * self.turned;
            // The few bits of a report leave the length of a quaternion slightly off one. These errors must not
            // accumulate.
            self.turned = UnitQuaternion::new_normalize(turned.into_inner());
        }
    }

    /// The orientation of a device, in world axes.
    fn on_axes(&self, state: &DeviceState) -> UnitQuaternion<f64> {
        self.rotation * state.pose.rotation * self.rotation.inverse()
    }

    /// The proxy's pose and twist in the scene.
    pub fn to_scene(&self, state: &DeviceState) -> (Pose, Twist) {
        let pose = Pose {
            position: self.origin + self.rotation * state.pose.position * self.motion_scale,
            rotation: self.on_axes(state) * self.turned,
        };
        let twist = Twist {
            linear: self.rotation * state.twist.linear * self.motion_scale,
            angular: self.rotation * state.twist.angular,
        };
        (pose, twist)
    }

    /// The wrench on the device (its own axes) that renders a wrench on the proxy (world axes).
    pub fn to_device(&self, wrench: &Wrench) -> Wrench {
        let back = self.rotation.inverse();
        Wrench {
            force: back * wrench.force * (self.motion_scale * self.force_scale),
            moment: back * wrench.moment * self.force_scale,
        }
    }

    /// The part of a force (world axes) that a device of one or two degrees of freedom renders: its part along the axes
    /// of the device.
    pub fn rendered_along(&self, axes: Axes, force: &Vec3) -> Vec3 {
        self.rotation * axes.part(&(self.rotation.inverse() * force))
    }

    /// The inverse of [`Self::to_device`]: the wrench on the proxy (world axes) that a device's wrench (its own axes)
    /// renders. Zero if a scale is zero.
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
        fn a_slipping_clutch_omits_its_fraction_of_the_motion(
            axes in vector(), place in vector(), turned in vector(), displacement in vector(), turn in vector(),
            scale in 0.1..10.0, fraction in 0.0..1.0,
        ) {
            let mut frame = DeviceFrame {
                rotation: UnitQuaternion::from_scaled_axis(axes),
                motion_scale: scale,
                ..DeviceFrame::at(Vec3::zeros())
            };
            let at = |position, rotation| DeviceState {
                pose: Pose { position, rotation: UnitQuaternion::from_scaled_axis(rotation) },
                ..DeviceState::resting()
            };
            let (first, left) = (at(Vec3::zeros(), Vec3::zeros()), at(place, turned));
            // The device was away before.
            frame.slip(1.0, &first, &left);
            let (before, _) = frame.to_scene(&left);
            prop_assert!(before.displacement_from(&Pose::identity()).norm() < 1e-13);
            let mut now = left;
            now.pose.position += displacement;
            // No hand turns much farther in a tick.
            let turn = turn * 0.01;
            now.pose.rotation = UnitQuaternion::from_scaled_axis(turn) * now.pose.rotation;
            frame.slip(fraction, &left, &now);
            let (after, _) = frame.to_scene(&now);
            let moved = after.displacement_from(&before);
            let rest = 1.0 - fraction;
            let translation = frame.rotation * displacement * (scale * rest);
            let rotation = frame.rotation * turn * rest;
            // Rounding of numbers of order ten.
            prop_assert!((Vec3::new(moved.x, moved.y, moved.z) - translation).norm() < 1e-13);
            // Blending errs by less than the cube of half the angle.
            prop_assert!((Vec3::new(moved.w, moved.a, moved.b) - rotation).norm() < 1e-6);
        }

        #[test]
        fn power_at_the_hand_is_that_in_the_scene_times_the_force_scale(
            turn in vector(), v in vector(), w in vector(), f in vector(), m in vector(),
            scale in 0.1..10.0, force_scale in 0.1..10.0,
        ) {
            let frame = DeviceFrame {
                rotation: UnitQuaternion::from_scaled_axis(turn),
                motion_scale: scale,
                force_scale,
                ..DeviceFrame::at(Vec3::zeros())
            };
            let state = DeviceState {
                twist: Twist { linear: v, angular: w },
                ..DeviceState::resting()
            };
            let wrench = Wrench { force: f, moment: m };
            let (_, scene) = frame.to_scene(&state);
            let device = frame.to_device(&wrench);
            // Rounding of numbers of order a hundred.
            let near = |found: f64, expected: f64| (found - expected).abs() < 1e-12;
            let in_scene = [f.dot(&scene.linear), m.dot(&scene.angular)];
            let at_hand = [device.force.dot(&v), device.moment.dot(&w)];
            for (at_hand, in_scene) in at_hand.into_iter().zip(in_scene) {
                prop_assert!(near(at_hand, force_scale * in_scene));
            }
            let back = frame.on_proxy(&device);
            prop_assert!((back.stacked() - wrench.stacked()).amax() < 1e-12);
        }
    }

    #[test]
    fn a_scale_of_zero_renders_no_force_and_nothing_on_the_proxy() {
        let wrench = Wrench {
            force: Vec3::x(),
            moment: Vec3::z(),
        };
        let frame = DeviceFrame {
            force_scale: 0.0,
            ..DeviceFrame::at(Vec3::zeros())
        };
        assert_eq!(frame.to_device(&wrench), Wrench::zero());
        assert_eq!(frame.on_proxy(&wrench), Wrench::zero());
    }

    #[test]
    fn a_slipping_clutch_does_not_mind_which_of_its_two_quaternions_a_device_reports() {
        // The two quaternions of opposite signs are one rotation.
        let turned = UnitQuaternion::from_scaled_axis(Vec3::new(0.02, -0.01, 0.03));
        let now = [turned, UnitQuaternion::new_unchecked(-turned.into_inner())];
        let [found, other] = now.map(|rotation| {
            let mut state = DeviceState::resting();
            state.pose.rotation = rotation;
            let mut frame = DeviceFrame::at(Vec3::zeros());
            frame.slip(0.25, &DeviceState::resting(), &state);
            frame.to_scene(&state).0
        });
        // Rounding of unit quaternions.
        assert!(found.displacement_from(&other).norm() < 1e-15);
        let followed = found.rotation.scaled_axis();
        assert!((followed - turned.scaled_axis() * 0.75).norm() < 1e-6);
    }
}
