//! The parameters of a device and its kinematics: counts, angles, positions, forces, torques and currents.
//!
//! Joint a turns the arm about the vertical axis z. Joint b leans the first link (`lengths[1]`) from the vertical, and
//! joint c leans the second link (`lengths[2]`) from the downward vertical. Both links lie in the plane that joint a
//! turns. A parallelogram drives the second link, so angle c is not measured from the first link. With the radius
//! `r = Lb sin b + Lc sin c`, the handle is at
//!
//! ```text
//! x = r cos a - ox,  y = r sin a - oy,  z = La + Lb cos b - Lc cos c - oz
//! ```
//!
//! where `(ox, oy, oz)` is the origin of the device axes. Virtual work relates force and torques: a force `F` at the
//! handle needs the joint torques `J^T F`, where `J` is the derivative of the position by the angles.

use rt_core::Vec3;

/// Largest current that a report can hold (A).
const MOST_CURRENT: f64 = 32.767;
/// Smallest volume that the columns of the Jacobian span, as a fraction of the product of their lengths. A smaller volume
/// counts as a singular pose.
const SINGULAR: f64 = 1e-6;

/// The parameters of a device. Arrays are in the order of the joints a, b, c.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Height of joints b and c, length of the first link, length of the second link (m).
    pub lengths: [f64; 3],
    /// Diameter of the capstan on the shaft of each motor (m).
    pub capstans: [f64; 3],
    /// Diameter of the body that the cable of each capstan turns (m).
    pub bodies: [f64; 3],
    /// Encoder counts in one turn of each motor.
    pub counts_per_turn: [f64; 3],
    /// Direction of each joint in terms of its motor and encoder: 1 or -1.
    pub signs: [f64; 3],
    /// Origin of the device axes, from the foot of the vertical axis (m).
    pub origin: Vec3,
    /// Torque of a motor per current (N m/A).
    pub torque_constant: f64,
    /// Largest current of a motor (A).
    pub current_limit: f64,
}

impl Default for Geometry {
    /// The default WoodenHaptics.
    fn default() -> Self {
        Self {
            lengths: [0.080, 0.205, 0.245],
            capstans: [0.010; 3],
            bodies: [0.160, 0.120, 0.120],
            counts_per_turn: [2000.0; 3],
            signs: [1.0, -1.0, 1.0],
            origin: Vec3::new(0.220, 0.0, 0.080),
            torque_constant: 0.0259,
            current_limit: 3.0,
        }
    }
}

/// A parameter that no device has.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the geometry's {field} must be {allowed}, not {found}")]
pub struct GeometryError {
    /// Name of the parameter.
    pub field: &'static str,
    /// The value that was given.
    pub found: f64,
    /// The allowed values.
    pub allowed: &'static str,
}

/// The kinematics of a device whose parameters are in their ranges.
///
/// ```
/// use devices::woodenhaptics::{Geometry, Kinematics};
/// use rt_core::Vec3;
///
/// let kinematics = Kinematics::new(&Geometry::default()).unwrap();
/// let angles = kinematics.inverse(&Vec3::zeros()).unwrap();
/// assert!(kinematics.forward(angles).norm() < 1e-12);
/// // 1 N upwards at the origin needs no torque about the vertical axis.
/// let currents = kinematics.currents(angles, &Vec3::new(0.0, 0.0, 1.0));
/// assert_eq!(currents[0], 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinematics {
    lengths: [f64; 3],
    origin: Vec3,
    /// Angle of each joint per count (rad), with its sign.
    angle_per_count: [f64; 3],
    /// Current per torque of each joint (mA/(N m)), with its sign.
    current_per_torque: [f64; 3],
    /// Largest current (mA), a whole number.
    most_current: f64,
}

impl Kinematics {
    /// The kinematics of a device with these parameters.
    ///
    /// # Errors
    /// [`GeometryError`] if a parameter is out of its range.
    pub fn new(geometry: &Geometry) -> Result<Self, GeometryError> {
        let Geometry {
            lengths,
            capstans,
            bodies,
            counts_per_turn,
            signs,
            origin,
            torque_constant,
            current_limit,
        } = *geometry;
        let positive = [
            ("lengths", lengths),
            ("capstans", capstans),
            ("bodies", bodies),
            ("counts per turn", counts_per_turn),
            ("torque constant", [torque_constant; 3]),
        ];
        for (field, numbers) in positive {
            // The bounds keep every quotient and product finite.
            let range = 1e-6..=1e6;
            require(field, numbers, "from 1e-6 to 1e6", |x| range.contains(&x))?;
        }
        require("signs", signs, "1 or -1", |x| x.abs() == 1.0)?;
        require("origin", origin.into(), "from -1e6 to 1e6", |x| {
            x.abs() <= 1e6
        })?;
        require(
            "current limit",
            [current_limit; 3],
            "from 0.001 to 32.767 A",
            |x| (0.001..=MOST_CURRENT).contains(&x),
        )?;
        // Turns of a joint per turn of its motor.
        let gears = each(each(capstans, bodies, |c, b| c / b), signs, |g, s| g * s);
        Ok(Self {
            lengths,
            origin,
            angle_per_count: each(gears, counts_per_turn, |gear, counts| {
                gear * core::f64::consts::TAU / counts
            }),
            current_per_torque: gears.map(|gear| gear / torque_constant * 1000.0),
            most_current: libm::floor(current_limit * 1000.0),
        })
    }

    /// The angles of the joints (rad) at these counts.
    pub fn angles(&self, counts: [i64; 3]) -> [f64; 3] {
        each(self.angle_per_count, counts, |angle, count| {
            angle * count as f64
        })
    }

    /// The counts at these angles (rad), not rounded.
    pub fn counts(&self, angles: [f64; 3]) -> [f64; 3] {
        each(angles, self.angle_per_count, |angle, per| angle / per)
    }

    /// Angle of each joint per count (rad), without its sign.
    pub fn angle_per_count(&self) -> [f64; 3] {
        self.angle_per_count.map(f64::abs)
    }

    /// Largest current of a motor (mA), a whole number.
    pub fn most_current(&self) -> f64 {
        self.most_current
    }

    /// The position of the handle (m, device axes) at these angles (rad).
    pub fn forward(&self, [a, b, c]: [f64; 3]) -> Vec3 {
        let [height, first, second] = self.lengths;
        let ((sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)) =
            (libm::sincos(a), libm::sincos(b), libm::sincos(c));
        let radius = first * sin_b + second * sin_c;
        let z = height + first * cos_b - second * cos_c;
        Vec3::new(cos_a * radius, sin_a * radius, z) - self.origin
    }

    /// The columns of the Jacobian (m/rad): the derivatives of the position by the angles a, b and c.
    pub fn jacobian(&self, [a, b, c]: [f64; 3]) -> [Vec3; 3] {
        let [_, first, second] = self.lengths;
        let ((sin_a, cos_a), (sin_b, cos_b), (sin_c, cos_c)) =
            (libm::sincos(a), libm::sincos(b), libm::sincos(c));
        let radius = first * sin_b + second * sin_c;
        [
            Vec3::new(-sin_a * radius, cos_a * radius, 0.0),
            Vec3::new(cos_a * cos_b, sin_a * cos_b, -sin_b) * first,
            Vec3::new(cos_a * cos_c, sin_a * cos_c, sin_c) * second,
        ]
    }

    /// The angles (rad) at which the handle is at `position` (m, device axes), with the elbow up; `None` if the links
    /// do not reach, or the position is not finite.
    ///
    /// The sum of angles b and c is the angle between the two links, which the law of cosines gives.
    pub fn inverse(&self, position: &Vec3) -> Option<[f64; 3]> {
        let [height, first, second] = self.lengths;
        let from_foot = position + self.origin;
        let radius = libm::hypot(from_foot.x, from_foot.y);
        let above = from_foot.z - height;
        let squared = radius * radius + above * above;
        let cosine = (first * first + second * second - squared) / (2.0 * first * second);
        // A NaN fails this test, too.
        if !(-1.0..=1.0).contains(&cosine) {
            return None;
        }
        let between = libm::acos(cosine);
        let lean = libm::atan2(radius, above);
        let b = lean - libm::atan2(second * libm::sin(between), first - second * cosine);
        let a = libm::atan2(from_foot.y, from_foot.x);
        Some([a, b, between - b])
    }

    /// The torques of the joints (N m) that make `force` (N, on the hand) at the handle: `J^T F`.
    pub fn torques(&self, angles: [f64; 3], force: &Vec3) -> [f64; 3] {
        self.jacobian(angles).map(|column| column.dot(force))
    }

    /// The currents of the motors (mA) that make `force` (N, on the hand), not limited and not rounded.
    pub fn currents(&self, angles: [f64; 3], force: &Vec3) -> [f64; 3] {
        let torques = self.torques(angles, force);
        each(torques, self.current_per_torque, |torque, per| torque * per)
    }

    /// The currents in whole mA, shortened together to the largest current, so that the force keeps its direction. If
    /// a current is not finite, all are zero.
    pub fn limited(&self, currents: [f64; 3]) -> [i16; 3] {
        if !currents.iter().all(|current| current.is_finite()) {
            return [0; 3];
        }
        let largest = currents.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let scale = if largest > self.most_current {
            self.most_current / largest
        } else {
            1.0
        };
        currents.map(|current| libm::round(current * scale) as i16)
    }

    /// The force on the hand (N) that the currents (mA) make: `J^-T` times the torques. `None` in a singular pose, in
    /// which no force balances some torques.
    pub fn force(&self, angles: [f64; 3], currents: [f64; 3]) -> Option<Vec3> {
        let [a, b, c] = self.jacobian(angles);
        let [torque_a, torque_b, torque_c] =
            each(currents, self.current_per_torque, |current, per| {
                current / per
            });
        // The rows of the inverse, by cross products (Cramer's rule).
        let volume = a.dot(&b.cross(&c));
        if volume.abs() <= SINGULAR * a.norm() * b.norm() * c.norm() {
            return None;
        }
        let sum = b.cross(&c) * torque_a + c.cross(&a) * torque_b + a.cross(&b) * torque_c;
        let force = sum / volume;
        force.iter().all(|x| x.is_finite()).then_some(force)
    }
}

/// Returns an error if a number of the field is not allowed.
fn require(
    field: &'static str,
    numbers: [f64; 3],
    allowed: &'static str,
    is_allowed: impl Fn(f64) -> bool,
) -> Result<(), GeometryError> {
    match numbers.into_iter().find(|x| !is_allowed(*x)) {
        None => Ok(()),
        Some(found) => Err(GeometryError {
            field,
            found,
            allowed,
        }),
    }
}

/// Combines two arrays of joints, joint by joint.
pub(super) fn each<A, B, C>(
    [a0, a1, a2]: [A; 3],
    [b0, b1, b2]: [B; 3],
    f: impl Fn(A, B) -> C,
) -> [C; 3] {
    [f(a0, b0), f(a1, b1), f(a2, b2)]
}

#[cfg(test)]
mod tests;
