//! The rotation of a handle, and its energy.
//!
//! There is one moment of inertia, the same about all axes (device and hand together), so that no gyroscopic moments
//! arise. With angular velocity `w` and orientation `q` (unit quaternion, scalar part `q_0`, vector part `q_v`),
//!
//! ```text
//! J w' = m - (b + b_w) w - 2 k q_v - t_c w / |w|,     q' = w q / 2
//! ```
//!
//! `q` is the orientation seen from the aim of the hand, to which the wrist's spring pulls back. While the aim stays, as it does within a
//! step, `q` obeys the same equation as the orientation; where the aim turns, the muscles give the change of the potential. That potential,
//! `4 k (1 - q_0)`, is `k a^2 / 2` for small angles `a`. Its moment is `2 k sin(a / 2)`: 1 % below `k a` at 28 degrees,
//! 5 % below at 63 degrees. The potential needs no angle, and the implicit midpoint rule on `q` conserves it. Let
//! `q_1 - q_0 = h u q_m / 2` with `q_m = (q_0 + q_1) / 2`. Then `q` keeps its length, and the potential changes by exactly
//! `2 k q_m,v . u h`, the work of the mean moment. This [`MechanicalEnergy`] therefore closes up to rounding at any
//! step, as that of the translation does.
//!
//! Stops and starts are events, as in the translation.

use super::friction::{PIECES, ROUNDING, SMALL, Slide};
use crate::arm::Wrist;
use crate::energy::MechanicalEnergy;
use crate::models::RotationModel;
use nalgebra::{Quaternion, Unit, UnitQuaternion};
use rt_core::Vec3;

/// Largest number of iterations for the mean orientation of a step. Each iteration reduces the error by a factor of
/// about `4 J / (h^2 k)`, some hundred thousand. The iterations end when only rounding changes.
const ROUNDS: u32 = 12;
/// Square of the relative change of the velocity that counts as rounding.
const SETTLED: f64 = 1e-30;

/// Handle and wrist as one rotating body.
#[derive(Clone, Debug)]
pub(crate) struct Turning {
    /// Moment of inertia of device and wrist together (kg m^2).
    inertia: f64,
    /// The device's fraction of that inertia.
    fraction: f64,
    damping: f64,
    friction: f64,
    wrist: Wrist,
    /// The aim of the hand, and the orientation seen from it.
    aim: UnitQuaternion<f64>,
    orientation: Quaternion<f64>,
    velocity: Vec3,
    energy: MechanicalEnergy,
}

/// The result of a step: its mean angular velocity (rad/s) and mean orientation.
struct Mean {
    velocity: Vec3,
    orientation: Quaternion<f64>,
}

impl Turning {
    /// A handle at rest, at the identity.
    pub(crate) fn new(model: &RotationModel, wrist: Wrist) -> Self {
        let inertia = model.inertia + wrist.inertia;
        Self {
            inertia,
            fraction: model.inertia / inertia,
            damping: model.damping,
            friction: model.friction,
            wrist,
            aim: UnitQuaternion::identity(),
            orientation: Quaternion::identity(),
            velocity: Vec3::zeros(),
            energy: MechanicalEnergy::default(),
        }
    }

    pub(crate) fn orientation(&self) -> UnitQuaternion<f64> {
        Unit::new_unchecked(self.orientation) * self.aim
    }

    /// Turns the aim of the hand.
    pub(crate) fn aim_at(&mut self, aim: UnitQuaternion<f64>) {
        let orientation = self.orientation() * aim.inverse();
        // The shorter way round.
        let sign = 1.0_f64.copysign(orientation.w);
        (self.aim, self.orientation) = (aim, orientation.into_inner() * sign);
        let spring = 4.0 * self.wrist.stiffness * versine(&self.orientation);
        self.energy.hand_work += spring - self.energy.spring;
        self.energy.spring = spring;
    }

    pub(crate) fn velocity(&self) -> Vec3 {
        self.velocity
    }

    pub(crate) fn energy(&self) -> &MechanicalEnergy {
        &self.energy
    }

    /// Advances by `h` (s) under the motors' moment (N m).
    pub(crate) fn step(&mut self, h: f64, motor: &Vec3) {
        let mut left = h;
        for _ in 1..PIECES {
            let at_rest = self.velocity == Vec3::zeros();
            if at_rest && self.pull(motor).norm() <= self.friction {
                // Neither the moment nor the wrist's aim changes within a step: the handle stays at rest.
                return;
            }
            let mean = self.mean(left, motor);
            let before = self.velocity;
            // The velocity at the end exceeds the mean by as much as the mean exceeds the velocity before.
            let goes_on = at_rest || before.dot(&(mean.velocity * 2.0 - before)) > 0.0;
            let rest = if self.friction <= 0.0 || goes_on {
                None
            } else {
                self.slide(motor).rests_after(left)
            };
            let Some(time) = rest else {
                self.commit(left, motor, &mean);
                return;
            };
            let mean = self.mean(time, motor);
            self.commit(time, motor, &mean);
            left -= time;
            let (speed, was) = (self.velocity.norm(), before.norm());
            let held = self.pull(motor).norm() <= self.friction;
            if speed <= ROUNDING * was || (held && speed <= SMALL * was) {
                self.energy.friction_loss += self.energy.kinetic;
                self.velocity = Vec3::zeros();
                self.energy.kinetic = 0.0;
                self.energy.device_kinetic = 0.0;
            }
        }
        let mean = self.mean(left, motor);
        self.commit(left, motor, &mean);
    }

    /// The moment that friction must hold for the handle to stay at rest (N m).
    fn pull(&self, motor: &Vec3) -> Vec3 {
        motor - self.orientation.imag() * (2.0 * self.wrist.stiffness)
    }

    /// The rotation along its present direction. In that direction, the spring's moment changes by `k q_0` per radian.
    fn slide(&self, motor: &Vec3) -> Slide {
        let speed = self.velocity.norm();
        Slide {
            mass: self.inertia,
            speed,
            damping: self.damping + self.wrist.damping,
            friction: self.friction,
            drive: self.pull(motor).dot(&self.velocity) / speed,
            stiffness: self.wrist.stiffness * self.orientation.w,
            aim_speed: 0.0,
        }
    }

    /// The mean of a step of `h`, by fixed-point iteration. Each iteration takes the spring's moment at the previous
    /// mean orientation, except for the part that is linear in the velocity, which is solved for.
    fn mean(&self, h: f64, motor: &Vec3) -> Mean {
        let stiffness = self.wrist.stiffness;
        let from = self.orientation;
        let softening = 0.5 * h * stiffness * from.w;
        let drag = self.damping + self.wrist.damping + softening;
        let inertia = 2.0 * self.inertia / h;
        let momentum = self.velocity * inertia;
        let mut velocity = self.velocity;
        let mut orientation = midway(&from, &velocity, h);
        for _ in 0..ROUNDS {
            let outer = motor - orientation.imag() * (2.0 * stiffness) + velocity * softening;
            let drive = outer + momentum;
            let size = drive.norm();
            let next = if self.friction > 0.0 && size <= self.friction {
                Vec3::zeros()
            } else {
                let friction = if size > 0.0 {
                    drive * (self.friction / size)
                } else {
                    drive
                };
                // Solved for the change of velocity, as in the translation.
                self.velocity + (outer - self.velocity * drag - friction) / (inertia + drag)
            };
            let settled = (next - velocity).norm_squared() <= SETTLED * next.norm_squared();
            velocity = next;
            orientation = midway(&from, &velocity, h);
            if settled || stiffness == 0.0 {
                break;
            }
        }
        Mean {
            velocity,
            orientation,
        }
    }

    /// Takes a step of `h` with that mean.
    fn commit(&mut self, h: f64, motor: &Vec3, mean: &Mean) {
        let turned = mean.velocity * h;
        self.orientation = (mean.orientation * 2.0 - self.orientation).normalize();
        self.velocity = mean.velocity * 2.0 - self.velocity;

        let energy = &mut self.energy;
        energy.motor_work += motor.dot(&turned);
        energy.friction_loss += self.friction * turned.norm();
        energy.damping_loss += self.damping * turned.norm_squared() / h;
        energy.arm_loss += self.wrist.damping * turned.norm_squared() / h;
        energy.spring = 4.0 * self.wrist.stiffness * versine(&self.orientation);
        energy.kinetic = 0.5 * self.inertia * self.velocity.norm_squared();
        energy.device_kinetic = self.fraction * energy.kinetic;
    }

    /// Gives the handle an initial angular velocity (rad/s).
    #[cfg(test)]
    pub(crate) fn push(&mut self, velocity: Vec3) {
        self.velocity = velocity;
        self.energy.kinetic = 0.5 * self.inertia * velocity.norm_squared();
        self.energy.device_kinetic = self.fraction * self.energy.kinetic;
        self.energy.initial = self.energy.stored();
        self.energy.device_initial = self.energy.device_kinetic;
    }
}

/// The mean of the orientations before and after a step of `h` with mean angular velocity `velocity`: the solution of
/// `q_m = q + h u q_m / 4`.
fn midway(from: &Quaternion<f64>, velocity: &Vec3, h: f64) -> Quaternion<f64> {
    let quarter = velocity * (0.25 * h);
    let turn = Quaternion::from_parts(1.0, quarter);
    turn * from / (1.0 + quarter.norm_squared())
}

/// `1 - q_0`, without cancellation.
fn versine(q: &Quaternion<f64>) -> f64 {
    if q.w > 0.0 {
        q.imag().norm_squared() / (1.0 + q.w)
    } else {
        1.0 - q.w
    }
}

#[cfg(test)]
mod tests;
