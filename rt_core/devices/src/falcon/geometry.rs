//! The mechanism of the Falcon: from encoder counts to a position, and from a force to torques.
//!
//! The mechanism is the translational parallel manipulator of Stamper (*A Three Degree of Freedom Parallel Manipulator
//! with Only Translational Degrees of Freedom*, PhD thesis, University of Maryland, 1997; Tsai & Stamper, ASME DETC
//! 1996). Three legs carry a platform that never turns. Each leg consists of an **arm**, which a motor turns about a
//! fixed axis, and a **shin**, a parallelogram from the arm to the platform.
//!
//! The platform is at `p` in the axes x, y, z. A leg has axes of its own: `u` points outwards from the middle at the
//! angle `phi` of the leg, `v` lies along the axis of its motor, and `w = z`. With Stamper's lengths, the arm at the
//! angle `t` leads to the **knee**, here already shifted by the offsets of base and platform:
//!
//! ```text
//! knee = (r - c + a cos t, s - f, a sin t)      D = p - knee, in the axes u, v, w
//! D = ((d + e + b sin q) cos k, b cos q, (d + e + b sin q) sin k)
//! ```
//!
//! `k` and `q` are the two angles of the shin: in the plane of the arm, and out of it. The hinges `d` and `e` do not
//! tilt out of that plane, so the platform lies on a torus about the knee, not on a sphere: for `L = hypot(Du, Dw)`,
//!
//! ```text
//! (L - d - e)^2 + Dv^2 = b^2
//! ```
//!
//! **Inverse.** `Dv` does not depend on `t`, so `L` is known, and `(Du, Dw)` of length `L` is one equation
//! `A cos t + B sin t = C`. Of its two solutions the knee of the Falcon is the outer one.
//!
//! **Forward.** The intersection of the three tori has no simple closed form. The intersection of three spheres of
//! radius `b + d + e` about the knees has a closed form, and its point is at most 3.1 mm away inside the workspace
//! ([`WORKSPACE`]). Newton's method then takes four steps. Each step about squares the error over 0.1 m: 3 mm, 0.1 mm,
//! 0.1 um, and rounding. The work is bounded, and no earlier position is needed.
//!
//! **Jacobian.** The unit normal `n = (sin q cos k, cos q, sin q sin k)` of the torus is the direction of the force in
//! the shin, so `n . dp = n . dknee`, and the rate of the arm is `n . dp / g` with the lever
//! `g = a sin q (sin k cos t - cos k sin t)`. By virtual work, the torques of the arms that put the force `F` on the
//! hand are `J^T F` for `J = dp / dt`.
//!
//! Lengths and angles are those that libnifalcon publishes. No calibration is published, so the absolute errors of one
//! device (bearings, the angle at zero) are larger than the rounding here.
#![cfg_attr(
    not(test),
    deny(
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
    )
)]

use rt_core::Vec3;
use std::f64::consts::PI;

/// Length of the arm (m), Stamper's `a`.
const ARM: f64 = 0.060;
/// Length of the shin's parallelogram (m), Stamper's `b`.
const SHIN: f64 = 0.1025;
/// The two hinges of the shin together (m), Stamper's `d + e`.
const HINGES: f64 = 0.011_25 + 0.011_25;
/// Offset of the knee outwards (m): Stamper's `r - c`, the base less the platform.
const OUT: f64 = 0.040 - 0.014_43;
/// Offset of the knee along the axis of the motor (m): Stamper's `s - f`.
const ALONG: f64 = -0.023_09 + 0.025;
/// Angles of the legs about z (rad): 90, -30 and -150 degrees, plus the 15 degrees by which the base is turned.
const LEGS: [f64; 3] = [105.0 * PI / 180.0, -15.0 * PI / 180.0, -135.0 * PI / 180.0];
/// Angle of an arm at the count zero (rad).
const ZERO: f64 = 35.0 * PI / 180.0;
/// Turn of an arm for one count (rad): 320 slots of four counts, a shaft of 14.25 mm that drives a drum of 110 mm.
const COUNT: f64 = 2.0 * PI / (320.0 * 4.0) * (14.25 / 110.0);
/// Torque counts for one newton metre at an arm. The sign is the device's.
const TORQUE: f64 = -10_000.0;
/// Largest torque count that the documents allow.
pub const TORQUE_LIMIT: i16 = 4096;
/// Newton steps of the forward kinematics.
const STEPS: usize = 4;
/// Largest error of a solution (m), along each shin. It is far below a micrometre and far above rounding.
const SOLVED: f64 = 1e-9;
/// Smallest volume of the three unit normals for which forces and velocities are solved. It is 0.28 to 0.89 inside the
/// workspace.
const SINGULAR: f64 = 1e-3;
/// Smallest lever of an arm (m) for which its rate is solved.
const DEAD: f64 = 1e-5;

/// The middle of the workspace (m) in the axes of the mechanism, whose origin is the middle of the base: x to the
/// right, y up, z towards the user. The makers publish no middle. This middle is our choice: the ball of [`WORKSPACE`]
/// about it is within reach, with arms from -33 to 81 degrees.
pub const CENTRE: Vec3 = Vec3::new(0.0, 0.0, 0.125);
/// Radius of the ball about [`CENTRE`] in which the precision of this module is tested (m).
pub const WORKSPACE: f64 = 0.05;

/// The largest displacement along an axis when no arm turns by more than one count (m), within 40 mm of [`CENTRE`]. It
/// is 0.08 mm in the middle. The makers' 0.04 mm is the displacement for one count of one arm.
pub const STEP: f64 = 0.103e-3;

/// The angle of an arm (rad) at an encoder count. The angle grows if the grip moves towards the user.
pub fn angle_of(count: i16) -> f64 {
    ZERO + COUNT * f64::from(count)
}

/// The encoder count at the angle of an arm (rad), not rounded.
pub fn count_of(angle: f64) -> f64 {
    (angle - ZERO) / COUNT
}

/// A position in the axes of one leg.
fn in_leg(position: &Vec3, (sine, cosine): (f64, f64)) -> Vec3 {
    Vec3::new(
        position.x * cosine + position.y * sine,
        position.y * cosine - position.x * sine,
        position.z,
    )
}

/// A vector in the axes of one leg, back in those of the mechanism.
fn from_leg(vector: &Vec3, (sine, cosine): (f64, f64)) -> Vec3 {
    Vec3::new(
        vector.x * cosine - vector.y * sine,
        vector.x * sine + vector.y * cosine,
        vector.z,
    )
}

/// The knee of an arm at `angle` (rad), in the axes of its leg (m).
fn knee(angle: f64) -> Vec3 {
    let (sine, cosine) = libm::sincos(angle);
    Vec3::new(OUT + ARM * cosine, ALONG, ARM * sine)
}

/// The angles of the three arms (rad) at a position of the grip (m, axes of the mechanism); `None` out of reach.
pub fn inverse(position: &Vec3) -> Option<[f64; 3]> {
    let mut angles = [0.0; 3];
    for (angle, leg) in angles.iter_mut().zip(LEGS) {
        let local = in_leg(position, libm::sincos(leg));
        let (u, v, w) = (local.x - OUT, local.y - ALONG, local.z);
        let length = HINGES + (SHIN * SHIN - v * v).sqrt();
        let distance = libm::hypot(u, w);
        let cosine = (distance * distance + ARM * ARM - length * length) / (2.0 * ARM * distance);
        // Also false for NaN, which a position beyond the shin gives.
        if !(-1.0..=1.0).contains(&cosine) {
            return None;
        }
        *angle = libm::atan2(w, u) - libm::acos(cosine);
    }
    Some(angles)
}

/// One shin: the direction of its force (unit vector), and the length (m) that it lacks to reach the position.
fn shin(position: &Vec3, knee: &Vec3, turn: (f64, f64)) -> Option<(Vec3, f64)> {
    let local = in_leg(position, turn) - knee;
    let length = libm::hypot(local.x, local.z);
    let tilted = length - HINGES;
    let size = libm::hypot(tilted, local.y);
    // Also false for NaN.
    if !(length > 0.0 && tilted > 0.0) {
        return None;
    }
    let normal = Vec3::new(
        local.x / length * tilted / size,
        local.y / size,
        local.z / length * tilted / size,
    );
    Some((from_leg(&normal, turn), size - SHIN))
}

/// The vectors `m_j` with `n_i . m_j = 1` for `i = j` and 0 otherwise, for unit vectors `n_i`; `None` if these are
/// almost in one plane.
fn reciprocal([a, b, c]: &[Vec3; 3]) -> Option<[Vec3; 3]> {
    let volume = a.dot(&b.cross(c));
    (volume.abs() > SINGULAR).then(|| {
        [
            b.cross(c) / volume,
            c.cross(a) / volume,
            a.cross(b) / volume,
        ]
    })
}

/// The point at the distance `radius` from three points. Of the two such points, the one with the larger z.
fn three_spheres([a, b, c]: &[Vec3; 3], radius: f64) -> Option<Vec3> {
    // The middle of the circle through the points, then out along the normal of their plane.
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(&ac);
    let square = normal.norm_squared();
    let to_middle = (normal.cross(&ab) * ac.norm_squared() + ac.cross(&normal) * ab.norm_squared())
        / (2.0 * square);
    let height = (radius * radius - to_middle.norm_squared()).sqrt();
    let up = normal * (height / square.sqrt());
    let up = if up.z < 0.0 { -up } else { up };
    let point = a + to_middle + up;
    point.iter().all(|x| x.is_finite()).then_some(point)
}

/// The position of the grip (m, axes of the mechanism) at the angles of the three arms (rad); `None` if the legs
/// cannot meet. The position errs by less than 1 nm inside the workspace. Outside, the end stops of a real device may
/// forbid the position.
///
/// ```
/// use devices::falcon::geometry::{CENTRE, forward, inverse};
///
/// let angles = inverse(&CENTRE).expect("in reach");
/// assert!((forward(&angles).expect("in reach") - CENTRE).norm() < 1e-12);
/// ```
pub fn forward(angles: &[f64; 3]) -> Option<Vec3> {
    let mut knees = [Vec3::zeros(); 3];
    let mut centres = [Vec3::zeros(); 3];
    let turns = LEGS.map(libm::sincos);
    for (((knee_of, centre), turn), angle) in
        knees.iter_mut().zip(&mut centres).zip(turns).zip(angles)
    {
        *knee_of = knee(*angle);
        *centre = from_leg(knee_of, turn);
    }
    let mut position = three_spheres(&centres, SHIN + HINGES)?;
    let shins = |position: &Vec3| {
        let mut normals = [Vec3::zeros(); 3];
        let mut errors = [0.0; 3];
        for (((normal, error), turn), knee) in
            normals.iter_mut().zip(&mut errors).zip(turns).zip(&knees)
        {
            (*normal, *error) = shin(position, knee, turn)?;
        }
        Some((normals, errors))
    };
    for _ in 0..STEPS {
        let (normals, errors) = shins(&position)?;
        for (direction, error) in reciprocal(&normals)?.iter().zip(errors) {
            position -= direction * error;
        }
    }
    let (_, errors) = shins(&position)?;
    errors
        .iter()
        .all(|error| error.abs() < SOLVED)
        .then_some(position)
}

/// The Jacobian at one position: the motion of the grip with its arms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jacobian {
    /// The velocity of the grip for a rate of one of each arm (m/rad).
    per_angle: [Vec3; 3],
    /// The rate of each arm for a velocity of the grip, by its product with the velocity (rad/m).
    per_metre: [Vec3; 3],
}

impl Jacobian {
    /// The Jacobian at `position` (m, axes of the mechanism) with the arms at `angles` (rad). Position and angles
    /// belong together by [`forward`] or [`inverse`]. `None` if an arm and its shin are in line, or the shins in one
    /// plane.
    pub fn at(position: &Vec3, angles: &[f64; 3]) -> Option<Self> {
        let mut normals = [Vec3::zeros(); 3];
        let mut levers = [0.0; 3];
        for (((normal, lever), leg), angle) in
            normals.iter_mut().zip(&mut levers).zip(LEGS).zip(angles)
        {
            let turn = libm::sincos(leg);
            let (sine, cosine) = libm::sincos(*angle);
            (*normal, _) = shin(position, &knee(*angle), turn)?;
            let along = Vec3::new(-ARM * sine, 0.0, ARM * cosine);
            *lever = normal.dot(&from_leg(&along, turn));
            if lever.abs() < DEAD {
                return None;
            }
        }
        let mut per_angle = reciprocal(&normals)?;
        for (column, lever) in per_angle.iter_mut().zip(levers) {
            *column *= lever;
        }
        for (row, lever) in normals.iter_mut().zip(levers) {
            *row /= lever;
        }
        Some(Self {
            per_angle,
            per_metre: normals,
        })
    }

    /// The velocity of the grip (m/s) for the rates of the arms (rad/s).
    pub fn velocity(&self, rates: &[f64; 3]) -> Vec3 {
        let parts = self.per_angle.iter().zip(rates);
        parts.map(|(column, rate)| column * *rate).sum()
    }

    /// The torques of the arms (N m) that put `force` (N) on the hand.
    pub fn torques(&self, force: &Vec3) -> [f64; 3] {
        self.per_angle.map(|column| column.dot(force))
    }

    /// The force on the hand (N) for the torques of the arms (N m).
    pub fn force(&self, torques: &[f64; 3]) -> Vec3 {
        let parts = self.per_metre.iter().zip(torques);
        parts.map(|(row, torque)| row * *torque).sum()
    }
}

/// The counts that command the torques of the arms (N m). If one count is beyond [`TORQUE_LIMIT`], all are reduced by
/// the same factor, so that the force keeps its direction. If a torque is not finite, all counts are zero.
pub fn torque_counts(torques: &[f64; 3]) -> [i16; 3] {
    if !torques.iter().all(|torque| torque.is_finite()) {
        return [0; 3];
    }
    let most = torques.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    if most == 0.0 {
        return [0; 3];
    }
    let largest = (most * TORQUE.abs()).min(f64::from(TORQUE_LIMIT)) * TORQUE.signum();
    torques.map(|torque| libm::round(torque / most * largest) as i16)
}

/// The torque of an arm (N m) that a count commands.
pub fn torque_of(count: i16) -> f64 {
    f64::from(count) / TORQUE
}

#[cfg(test)]
mod tests;
