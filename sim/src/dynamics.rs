//! The motion of a device and the hand that holds it, and its energy.
//!
//! Device and arm form one point mass, because the grip is rigid. Viscous damping and Coulomb friction act against the
//! ground. The motors drive the mass, and so does the aim of the hand through the arm's spring and damper. Each step is
//! the implicit midpoint rule, solved in closed form. With the mean velocity `u` over a step `h`,
//!
//! ```text
//! (2 M / h + b + b_a + h k_a / 2) u + f = 2 M v / h + F + k_a (a - x + da / 2) + b_a da / h = r
//! u = 0, f = r          if |r| <= f_c      (the handle does not move)
//! f = f_c r / |r|       elsewhere             (u has the direction of r)
//! ```
//!
//! The rule is of second order and stable for any step. Every exchange of energy is a mean force times the displacement
//! of the same step. The [`MechanicalEnergy`] is therefore an identity of the discrete motion: it closes up to rounding at
//! any step length, and no loss can be negative. Only the motion errs with the step length, not its account.
//!
//! Stick and slip are events, and a step is split at an event ([`friction`]). A handle that would reverse within a step
//! first comes to rest, at the time that the step's own equation gives. A handle at rest does not move until the pull
//! on it reaches the largest force that friction can hold. The motion is therefore of second order with friction, too.
//! If the direction turns within a step without rest, the step is divided into pieces. If friction ends the motion, the
//! remaining kinetic energy is lost to friction.

mod friction;
mod turning;

use crate::arm::Arm;
use crate::energy::MechanicalEnergy;
use friction::{PIECES, ROUNDING, SMALL, Slide, holds_for};
use rt_core::Vec3;
pub(crate) use turning::Turning;

/// Device and arm as one moving mass.
#[derive(Clone, Debug)]
pub(crate) struct Dynamics {
    /// Mass of device and arm together (kg).
    mass: f64,
    /// The device's fraction of that mass.
    fraction: f64,
    damping: f64,
    friction: f64,
    arm: Arm,
    position: Vec3,
    velocity: Vec3,
    /// The aim of the hand.
    aim: Vec3,
    energy: MechanicalEnergy,
}

impl Dynamics {
    /// A handle at rest at `position`, with the arm's spring relaxed. `mass` is the device's own.
    pub(crate) fn new(mass: f64, damping: f64, friction: f64, arm: Arm, position: Vec3) -> Self {
        Self {
            mass: mass + arm.mass,
            fraction: mass / (mass + arm.mass),
            damping,
            friction,
            arm,
            position,
            velocity: Vec3::zeros(),
            aim: position,
            energy: MechanicalEnergy::default(),
        }
    }

    pub(crate) fn position(&self) -> Vec3 {
        self.position
    }

    pub(crate) fn velocity(&self) -> Vec3 {
        self.velocity
    }

    pub(crate) fn energy(&self) -> &MechanicalEnergy {
        &self.energy
    }

    /// Advances by `h` (s) under the motors' force (N), while the aim of the hand goes straight to `aim`.
    pub(crate) fn step(&mut self, h: f64, motor: &Vec3, aim: &Vec3) {
        let aim_step = aim - self.aim;
        let (change, drive) = self.change(h, motor, &aim_step);
        let smooth = if self.friction <= 0.0 {
            true
        } else if self.velocity == Vec3::zeros() {
            // The spring's pull differs by no more than this from its mean over the step.
            let change = 0.5 * self.arm.stiffness * aim_step.abs().sum();
            (drive - self.friction).abs() > change
        } else {
            self.goes_on(&change)
        };
        if smooth {
            self.commit(h, motor, aim, &aim_step, &change);
        } else {
            self.step_in_pieces(h, motor, aim);
        }
    }

    /// The same step, split at the times at which the handle stops and starts.
    #[cold]
    #[inline(never)]
    fn step_in_pieces(&mut self, h: f64, motor: &Vec3, aim: &Vec3) {
        let aim_rate = (aim - self.aim) / h;
        let mut left = h;
        for _ in 1..PIECES {
            if self.velocity == Vec3::zeros() {
                let pull = self.pull(motor, &aim_rate);
                if pull.norm() <= self.friction {
                    let rate = aim_rate * self.arm.stiffness;
                    let Some(time) = holds_for(&pull, &rate, self.friction, left) else {
                        break;
                    };
                    if time > 0.0 {
                        let aim_step = aim_rate * time;
                        let to = self.aim + aim_step;
                        self.commit(time, motor, &to, &aim_step, &Vec3::zeros());
                        left -= time;
                    }
                }
            }
            let aim_step = aim - self.aim;
            let (change, _) = self.change(left, motor, &aim_step);
            let before = self.velocity;
            let rest = if before == Vec3::zeros() || self.goes_on(&change) {
                None
            } else {
                self.slide(motor, &aim_rate).rests_after(left)
            };
            let Some(time) = rest else {
                self.commit(left, motor, aim, &aim_step, &change);
                return;
            };
            let aim_step = aim_rate * time;
            let (change, _) = self.change(time, motor, &aim_step);
            let to = self.aim + aim_step;
            self.commit(time, motor, &to, &aim_step, &change);
            left -= time;
            let (speed, was) = (self.velocity.norm(), before.norm());
            let held = self.pull(motor, &aim_rate).norm() <= self.friction;
            if speed <= ROUNDING * was || (held && speed <= SMALL * was) {
                self.rest();
            }
        }
        // Friction holds to the end, or all pieces are used up.
        let aim_step = aim - self.aim;
        let (change, _) = self.change(left, motor, &aim_step);
        self.commit(left, motor, aim, &aim_step, &change);
    }

    /// Whether a step with that change of the mean velocity ends without a reversal.
    fn goes_on(&self, change: &Vec3) -> bool {
        // The velocity at the end of the step differs by twice as much.
        self.velocity.dot(&(self.velocity + change * 2.0)) > 0.0
    }

    /// The force that friction must hold for the handle to stay at rest (N), while the aim moves with `aim_rate`.
    fn pull(&self, motor: &Vec3, aim_rate: &Vec3) -> Vec3 {
        motor + (self.aim - self.position) * self.arm.stiffness + aim_rate * self.arm.damping
    }

    /// The motion along its present direction.
    fn slide(&self, motor: &Vec3, aim_rate: &Vec3) -> Slide {
        let speed = self.velocity.norm();
        let along = self.velocity / speed;
        Slide {
            mass: self.mass,
            speed,
            damping: self.damping + self.arm.damping,
            friction: self.friction,
            drive: self.pull(motor, aim_rate).dot(&along),
            stiffness: self.arm.stiffness,
            aim_speed: aim_rate.dot(&along),
        }
    }

    /// Brings the handle to rest. Its remaining kinetic energy is lost to friction.
    fn rest(&mut self) {
        self.energy.friction_loss += self.energy.kinetic;
        self.velocity = Vec3::zeros();
        self.energy.kinetic = 0.0;
        self.energy.device_kinetic = 0.0;
    }

    /// The difference between the mean velocity over a step of `h` and the velocity before it (m/s), and the size of
    /// the force that drives the step, the `r` of the equations above (N).
    #[inline(always)]
    fn change(&self, h: f64, motor: &Vec3, aim_step: &Vec3) -> (Vec3, f64) {
        let Arm {
            damping: arm_damping,
            stiffness,
            ..
        } = self.arm;
        let outer = motor
            + (self.aim - self.position + aim_step * 0.5) * stiffness
            + aim_step * (arm_damping / h);
        let drag = self.damping + arm_damping + 0.5 * h * stiffness;
        let inertia = 2.0 * self.mass / h;
        let drive = outer + self.velocity * inertia;
        let size = drive.norm();
        if self.friction > 0.0 && size <= self.friction {
            return (-self.velocity, size);
        }
        let friction = if size > 0.0 {
            drive * (self.friction / size)
        } else {
            drive
        };
        // The step is solved for the change of velocity, not for the mean velocity. The large and nearly equal momenta
        // then never cancel, and rounding does not act like a damper.
        let change = (outer - self.velocity * drag - friction) / (inertia + drag);
        (change, size)
    }

    /// Takes a step of `h` whose mean velocity differs by `change` from the velocity before the step.
    #[inline(always)]
    fn commit(&mut self, h: f64, motor: &Vec3, aim: &Vec3, aim_step: &Vec3, change: &Vec3) {
        let Arm {
            damping: arm_damping,
            stiffness,
            ..
        } = self.arm;
        let moved = (self.velocity + change) * h;
        self.velocity += change * 2.0;
        let stretch = self.aim - self.position;
        let slip = aim_step - moved;
        self.position += moved;
        self.aim = *aim;
        let pull = (stretch + slip * 0.5) * stiffness + slip * (arm_damping / h);

        let energy = &mut self.energy;
        energy.motor_work += motor.dot(&moved);
        energy.hand_work += pull.dot(aim_step);
        energy.friction_loss += self.friction * moved.norm();
        energy.damping_loss += self.damping * moved.norm_squared() / h;
        energy.arm_loss += arm_damping * slip.norm_squared() / h;
        energy.spring = 0.5 * stiffness * (self.aim - self.position).norm_squared();
        self.energy.kinetic = self.kinetic();
        self.energy.device_kinetic = self.fraction * self.energy.kinetic;
    }

    fn kinetic(&self) -> f64 {
        0.5 * self.mass * self.velocity.norm_squared()
    }

    /// Gives the handle an initial velocity (m/s).
    #[cfg(test)]
    pub(crate) fn push(&mut self, velocity: Vec3) {
        self.velocity = velocity;
        self.energy.kinetic = self.kinetic();
        self.energy.device_kinetic = self.fraction * self.energy.kinetic;
        self.energy.initial = self.energy.stored();
        self.energy.device_initial = self.energy.device_kinetic;
    }
}

#[cfg(test)]
mod tests;
