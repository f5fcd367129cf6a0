//! Rotations of a scene: an axis and an angle in degrees.
//!
//! An axis and an angle have one meaning, whereas three angles have one for each order of the axes. The angle is in
//! degrees because placements turn by quarters and by thirds of a turn, which radians cannot write exactly.

use crate::check;
use nalgebra::{Rotation3, UnitQuaternion};
use physics::{Mat3, Vec3};
use serde::Deserialize;

/// `rotation = { axis = [x, y, z], degrees = ANGLE }`: a turn about an axis through the origin, by the right-hand rule.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// The axis. The length of the vector has no effect, but must not be 0.
    #[serde(deserialize_with = "check::finite3")]
    pub axis: [f64; 3],
    /// The angle (degrees).
    #[serde(deserialize_with = "check::finite")]
    pub degrees: f64,
}

impl Rotation {
    /// The axis as a unit vector; zero if its length is 0, which the consistency of the scene excludes.
    fn unit(self) -> Vec3 {
        // Scaled by the largest entry first, so that no square overflows or vanishes.
        let axis = Vec3::from(self.axis);
        let most = axis.amax();
        if most == 0.0 {
            return axis;
        }
        (axis / most).normalize()
    }

    /// Cosine and sine of the angle. They are exact for quarters of a turn, so that a turned mesh has the coordinates that
    /// a user expects, and a box whose face lies on the mesh still holds that face.
    fn cosine_and_sine(self) -> (f64, f64) {
        let degrees = self.degrees % 360.0;
        let quarter = degrees / 90.0;
        if quarter.fract() == 0.0 {
            return match quarter.rem_euclid(4.0) as u8 {
                0 => (1.0, 0.0),
                1 => (0.0, 1.0),
                2 => (-1.0, 0.0),
                _ => (0.0, -1.0),
            };
        }
        let radians = degrees.to_radians();
        (libm::cos(radians), libm::sin(radians))
    }

    /// The matrix of the rotation, by Rodrigues' formula `c I + s [k] + (1 - c) k k^T`.
    ///
    /// ```
    /// use scene::spec::Rotation;
    /// use physics::Vec3;
    ///
    /// let turn = Rotation { axis: [0.0, 0.0, 2.0], degrees: 90.0 };
    /// assert_eq!(turn.matrix() * Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0));
    /// ```
    pub fn matrix(self) -> Mat3 {
        let (axis, (c, s)) = (self.unit(), self.cosine_and_sine());
        Mat3::identity() * c + axis.cross_matrix() * s + axis * axis.transpose() * (1.0 - c)
    }

    /// The rotation as a unit quaternion.
    pub fn quaternion(self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.matrix()))
    }
}
