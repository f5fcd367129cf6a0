//! Poses, twists and wrenches in messages, as the standard ROS types, which tools can display.

use nalgebra::{Quaternion, UnitQuaternion};
use rt_core::{Pose, Twist, Vec3, Wrench};

use super::cdr::{CdrReader, CdrWriter};

/// The definitions of these types, to be appended to a message definition that uses them. This is a macro
/// because `concat!` takes literals only.
macro_rules! geometry_messages {
    () => {
        "\
================================================================================
MSG: geometry_msgs/Pose
Point position
Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: geometry_msgs/Twist
Vector3 linear
Vector3 angular
================================================================================
MSG: geometry_msgs/Wrench
Vector3 force
Vector3 torque
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"
    };
}
pub(super) use geometry_messages;

impl CdrWriter<'_> {
    pub(super) fn pose(&mut self, pose: &Pose) {
        self.vector(&pose.position);
        pose.rotation.coords.iter().for_each(|x| self.f64(*x));
    }

    pub(super) fn twist(&mut self, twist: &Twist) {
        self.vector(&twist.linear);
        self.vector(&twist.angular);
    }

    pub(super) fn wrench(&mut self, wrench: &Wrench) {
        self.vector(&wrench.force);
        self.vector(&wrench.moment);
    }

    pub(super) fn vector(&mut self, v: &Vec3) {
        v.iter().for_each(|x| self.f64(*x));
    }
}

impl CdrReader<'_> {
    pub(super) fn pose(&mut self) -> Option<Pose> {
        let position = self.vector()?;
        let (x, y, z, w) = (self.f64()?, self.f64()?, self.f64()?, self.f64()?);
        // The rotation stays as logged: a second normalization would change its last bits.
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        Some(Pose { position, rotation })
    }

    pub(super) fn twist(&mut self) -> Option<Twist> {
        Some(Twist {
            linear: self.vector()?,
            angular: self.vector()?,
        })
    }

    pub(super) fn wrench(&mut self) -> Option<Wrench> {
        Some(Wrench {
            force: self.vector()?,
            moment: self.vector()?,
        })
    }

    pub(super) fn vector(&mut self) -> Option<Vec3> {
        Some(Vec3::new(self.f64()?, self.f64()?, self.f64()?))
    }
}
