//! Poses, twists and wrenches: the three quantities that every part of the tick exchanges.
//!
//! Conventions: all quantities are in world axes; six-vectors and 6 x 6 matrices stack translation above rotation; a
//! moment is about the origin of the moving handle.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector4};

/// A vector in three dimensions. The name of the variable tells the unit (m, m/s or N).
pub type Vec3 = nalgebra::Vector3<f64>;
/// Translation and rotation, or force and moment, stacked.
pub type Vec6 = nalgebra::Vector6<f64>;
/// A compliance between two points.
pub type Mat3 = nalgebra::Matrix3<f64>;
/// A stiffness or damping block between two handles.
pub type Mat6 = nalgebra::Matrix6<f64>;

/// Position (m) and orientation of a rigid thing.
///
/// ```
/// use rt_core::{Pose, Vec3};
///
/// let reference = Pose::at(Vec3::new(0.1, 0.0, 0.0));
/// let moved = Pose::at(Vec3::new(0.1, 0.002, 0.0));
/// // Translation (m) first, then the rotation vector (rad).
/// let displacement = moved.displacement_from(&reference);
/// assert_eq!(displacement.as_slice(), [0.0, 0.002, 0.0, 0.0, 0.0, 0.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position of the origin (m).
    pub position: Vec3,
    /// Orientation, from body axes to world axes.
    pub rotation: UnitQuaternion<f64>,
}

impl Pose {
    /// At the world's origin, unrotated.
    pub const fn identity() -> Self {
        Self {
            position: Vec3::new(0.0, 0.0, 0.0),
            rotation: Unit::new_unchecked(Quaternion::from_vector(Vector4::new(
                0.0, 0.0, 0.0, 1.0,
            ))),
        }
    }

    /// At `position` (m), unrotated.
    pub fn at(position: Vec3) -> Self {
        Self {
            position,
            rotation: UnitQuaternion::identity(),
        }
    }

    /// The displacement that leads from `reference` to this pose: translation (m), then the rotation vector
    /// `log(R R0^T)` (rad), both in world axes.
    pub fn displacement_from(&self, reference: &Self) -> Vec6 {
        let translation = self.position - reference.position;
        // Devices that sense no rotation report the same quaternion in every tick: skip the logarithm.
        let rotation = if self.rotation == reference.rotation {
            Vec3::zeros()
        } else {
            (self.rotation * reference.rotation.inverse()).scaled_axis()
        };
        stack(&translation, &rotation)
    }

    /// Whether every number of the pose is finite.
    pub fn is_finite(&self) -> bool {
        self.position
            .iter()
            .chain(self.rotation.coords.iter())
            .all(|x| x.is_finite())
    }
}

/// Linear (m/s) and angular (rad/s) velocity, world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twist {
    /// Velocity of the origin (m/s).
    pub linear: Vec3,
    /// Angular velocity (rad/s).
    pub angular: Vec3,
}

impl Twist {
    /// At rest.
    pub fn zero() -> Self {
        Self {
            linear: Vec3::zeros(),
            angular: Vec3::zeros(),
        }
    }

    /// Linear velocity, then angular.
    pub fn stacked(&self) -> Vec6 {
        stack(&self.linear, &self.angular)
    }

    /// Whether every number of the twist is finite.
    pub fn is_finite(&self) -> bool {
        self.linear
            .iter()
            .chain(self.angular.iter())
            .all(|x| x.is_finite())
    }
}

/// Force (N) and moment (N m), world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrench {
    /// Force (N).
    pub force: Vec3,
    /// Moment about the handle's origin (N m).
    pub moment: Vec3,
}

impl Wrench {
    /// No force, no moment.
    pub const fn zero() -> Self {
        Self {
            force: Vec3::new(0.0, 0.0, 0.0),
            moment: Vec3::new(0.0, 0.0, 0.0),
        }
    }

    /// The wrench of a stacked six-vector, force first.
    pub fn from_stacked(v: &Vec6) -> Self {
        Self {
            force: Vec3::new(v.x, v.y, v.z),
            moment: Vec3::new(v.w, v.a, v.b),
        }
    }

    /// The stacked six-vector: force, then moment.
    pub fn stacked(&self) -> Vec6 {
        stack(&self.force, &self.moment)
    }

    /// Force and moment times `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            force: self.force * factor,
            moment: self.moment * factor,
        }
    }

    /// The sum of two wrenches about the same point.
    pub fn plus(&self, other: &Self) -> Self {
        Self {
            force: self.force + other.force,
            moment: self.moment + other.moment,
        }
    }

    /// Whether every number of the wrench is finite.
    pub fn is_finite(&self) -> bool {
        self.force
            .iter()
            .chain(self.moment.iter())
            .all(|x| x.is_finite())
    }
}

pub(crate) fn stack(first: &Vec3, second: &Vec3) -> Vec6 {
    Vec6::new(first.x, first.y, first.z, second.x, second.y, second.z)
}

/// The rotation by a small rotation vector (rad). The error is less than a tenth of the cube of its length.
pub(crate) fn small_turn(turn: &Vec3) -> UnitQuaternion<f64> {
    let half = turn * 0.5;
    UnitQuaternion::new_normalize(Quaternion::from_parts(1.0, half))
}

/// `3 s^2 - 2 s^3`: a step from zero to one whose derivative is zero at both ends.
pub(crate) fn smooth_step(s: f64) -> f64 {
    s * s * (3.0 - 2.0 * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrenches_add_and_scale_in_force_and_moment() {
        let one = Wrench {
            force: Vec3::new(1.0, 2.0, 3.0),
            moment: Vec3::new(4.0, 5.0, 6.0),
        };
        let other = one.scaled(-0.5);
        assert_eq!(other.force, Vec3::new(-0.5, -1.0, -1.5));
        assert_eq!(other.moment, Vec3::new(-2.0, -2.5, -3.0));
        assert_eq!(one.plus(&other), one.scaled(0.5));
    }

    #[test]
    fn displacement_recovers_a_rotation_vector_in_world_axes() {
        let reference = Pose {
            position: Vec3::new(0.1, -0.2, 0.3),
            rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.4, 0.1, -0.7)),
        };
        let turn = Vec3::new(-0.2, 0.5, 0.3);
        let moved = Pose {
            position: reference.position + Vec3::new(1e-3, 2e-3, -3e-3),
            rotation: UnitQuaternion::from_scaled_axis(turn) * reference.rotation,
        };
        let d = moved.displacement_from(&reference);
        let expected = Vec6::new(1e-3, 2e-3, -3e-3, turn.x, turn.y, turn.z);
        // Rounding only: a few operations on numbers of order one.
        assert!((d - expected).amax() < 1e-14, "{d}");
    }
}
