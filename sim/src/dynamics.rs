//! The motion of a device and the hand that holds it, and where its energy goes.
//!
//! One point mass (device and arm together, the grip being rigid) with viscous damping and Coulomb friction
//! against the ground, driven by the motors and, through the arm's spring and damper, by where the hand
//! wants to be. Each step is the implicit midpoint rule, solved in closed form: with mean velocity `u` over a
//! step `h`,
//!
//! ```text
//! (2 M / h + b + b_a + h k_a / 2) u + f = 2 M v / h + F + k_a (a - x + da / 2) + b_a da / h = r
//! u = 0, f = r          where |r| <= f_c      (the handle does not move)
//! f = f_c r / |r|       elsewhere             (u has the direction of r)
//! ```
//!
//! It is of second order, stable for any step, and every exchange of energy is a mean force times the
//! displacement of the very same step. So the [`EnergyAccount`] is an identity of the discrete motion: it
//! closes to rounding at any step length, and no loss in it can be negative. What still errs with the step
//! length is the motion, not its account.
//!
//! Friction holds truly: a handle that does not move in a step, and that the other forces cannot move
//! either, is at rest; what kinetic energy it had is friction's.

use crate::arm::Arm;
use crate::energy::EnergyAccount;
use rt_core::Vec3;

/// Device and arm as one moving mass.
#[derive(Clone, Debug)]
pub(crate) struct Dynamics {
    /// Of device and arm together (kg).
    mass: f64,
    /// The device's part of it.
    share: f64,
    damping: f64,
    friction: f64,
    arm: Arm,
    position: Vec3,
    velocity: Vec3,
    /// Where the hand wants the handle to be.
    aim: Vec3,
    energy: EnergyAccount,
}

impl Dynamics {
    /// At rest at `position`, the arm's spring relaxed. `mass` is the device's own.
    pub(crate) fn new(mass: f64, damping: f64, friction: f64, arm: Arm, position: Vec3) -> Self {
        Self {
            mass: mass + arm.mass,
            share: mass / (mass + arm.mass),
            damping,
            friction,
            arm,
            position,
            velocity: Vec3::zeros(),
            aim: position,
            energy: EnergyAccount::default(),
        }
    }

    pub(crate) fn position(&self) -> Vec3 {
        self.position
    }

    pub(crate) fn velocity(&self) -> Vec3 {
        self.velocity
    }

    pub(crate) fn energy(&self) -> &EnergyAccount {
        &self.energy
    }

    /// Moves on by `h` (s) under the motors' force (N), the hand's aim going straight to `aim`.
    pub(crate) fn step(&mut self, h: f64, motor: &Vec3, aim: &Vec3) {
        let Arm {
            damping: arm_damping,
            stiffness,
            ..
        } = self.arm;
        let aim_step = aim - self.aim;
        let outer = motor
            + (self.aim - self.position + aim_step * 0.5) * stiffness
            + aim_step * (arm_damping / h);
        let drag = self.damping + arm_damping + 0.5 * h * stiffness;
        let inertia = 2.0 * self.mass / h;
        let drive = outer + self.velocity * inertia;
        let size = drive.norm();
        let moved;
        if self.friction > 0.0 && size <= self.friction {
            moved = Vec3::zeros();
            if outer.norm() <= self.friction {
                self.energy.friction_loss += self.kinetic();
                self.velocity = Vec3::zeros();
            } else {
                // Turning back within the step: it will not stay.
                self.velocity = -self.velocity;
            }
        } else {
            let friction = if size > 0.0 {
                drive * (self.friction / size)
            } else {
                drive
            };
            // Solved for the change of velocity, not for the mean velocity: the large and nearly equal
            // momenta then never meet, and rounding does not act like a damper.
            let change = (outer - self.velocity * drag - friction) / (inertia + drag);
            moved = (self.velocity + change) * h;
            self.velocity += change * 2.0;
        }
        let stretch = self.aim - self.position;
        let slip = aim_step - moved;
        self.position += moved;
        self.aim = *aim;
        let pull = (stretch + slip * 0.5) * stiffness + slip * (arm_damping / h);

        let energy = &mut self.energy;
        energy.motor_work += motor.dot(&moved);
        energy.hand_work += pull.dot(&aim_step);
        energy.friction_loss += self.friction * moved.norm();
        energy.damping_loss += self.damping * moved.norm_squared() / h;
        energy.arm_loss += arm_damping * slip.norm_squared() / h;
        energy.spring = 0.5 * stiffness * (self.aim - self.position).norm_squared();
        self.energy.kinetic = self.kinetic();
        self.energy.device_kinetic = self.share * self.energy.kinetic;
    }

    fn kinetic(&self) -> f64 {
        0.5 * self.mass * self.velocity.norm_squared()
    }

    /// Gives it a velocity (m/s) to start with.
    #[cfg(test)]
    pub(crate) fn push(&mut self, velocity: Vec3) {
        self.velocity = velocity;
        self.energy.kinetic = self.kinetic();
        self.energy.device_kinetic = self.share * self.energy.kinetic;
        self.energy.initial = self.energy.stored();
        self.energy.device_initial = self.energy.device_kinetic;
    }
}

#[cfg(test)]
mod tests;
