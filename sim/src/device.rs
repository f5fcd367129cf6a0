//! A simulated haptic device, with the hand that holds it.
//!
//! [`SimDevice`] is a [`Device`] like any other: between two calls it moves on under the last wrench written
//! (held, as a real device holds it), and a read gives what its encoders would show. It moves exactly up to
//! the time of the call in substeps of a fixed length, the last one shorter where the two do not divide;
//! times are whole nanoseconds and never drift.
//!
//! What is modelled: moving mass, viscous damping, Coulomb friction, encoder counts, the motors' largest
//! force, the arm of [`crate::hand`]; where the model has a rotation, the same of the handle's rotation and
//! the wrist. What is not: end stops, motor dynamics, backlash, inertia that changes with the pose or
//! couples translation and rotation, gravity (devices compensate it).

use crate::arm::{Arm, Wrist};
use crate::dynamics::{Dynamics, Turning};
use crate::encoder::{Encoder, TurnEncoder};
use crate::energy::MechanicalEnergy;
use crate::hand::{Aim, Hand};
use devices::DeviceModel;
use nalgebra::UnitQuaternion;
use rt_core::{Capabilities, Device, DeviceError, DeviceState, Pose, Probe, Twist, Vec3, Wrench};

/// Length of a substep unless told otherwise (ns): 20 in a millisecond.
pub const SUBSTEP_NS: u64 = 50_000;
/// The longest time that one call moves on by (ns). Work in a call is bounded; of a longer gap the excess
/// is stood still through, and counted.
pub const LONGEST_MOVE_NS: u64 = 100_000_000;

/// Why there is no such simulated device.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SimError {
    /// A number of the model must be finite and above zero.
    #[error("the device model's {field} must be finite and above zero, not {found}")]
    NotPositive {
        /// Which.
        field: &'static str,
        /// What was given.
        found: f64,
    },
    /// A number of the model must be finite and at least zero.
    #[error("the device model's {field} must be finite and at least zero, not {found}")]
    Negative {
        /// Which.
        field: &'static str,
        /// What was given.
        found: f64,
    },
    /// The arm has a number that is negative or not finite.
    #[error("the arm's mass, damping and stiffness must be finite and at least zero: {found:?}")]
    Arm {
        /// The arm.
        found: Arm,
    },
    /// The wrist has a number that is negative or not finite.
    #[error(
        "the wrist's inertia, damping and stiffness must be finite and at least zero: {found:?}"
    )]
    Wrist {
        /// The wrist.
        found: Wrist,
    },
    /// The tick's period makes no sense.
    #[error("the tick's period must be from 1e-5 to 0.1 s, not {found} s")]
    Period {
        /// What was given (s).
        found: f64,
    },
    /// The substep is too short to bound the work in a call, or longer than a tick may be.
    #[error("a substep must be from 100 to 100000000 ns, not {found} ns")]
    Substep {
        /// What was given (ns).
        found: u64,
    },
    /// The start is not finite.
    #[error("the device's start position must be finite")]
    Start,
}

/// A simulated device, held by a hand or by nobody. It has three degrees of freedom, or six where its model
/// has a rotation.
#[derive(Clone, Debug)]
pub struct SimDevice {
    model: DeviceModel,
    dynamics: Dynamics,
    start: Vec3,
    aim: Option<Aim>,
    substep_ns: u64,
    /// The force that the motors hold (N).
    force: Vec3,
    /// Time of the first call and of the last (ns); none before the first.
    clock: Option<(u64, u64)>,
    /// How long it has moved (ns).
    moved_ns: u64,
    frozen_ns: u64,
    refused_wrenches: u64,
    encoder: Encoder,
    /// Of a device of six degrees of freedom.
    rotation: Option<Rotation>,
}

/// The rotation of a device of six degrees of freedom.
#[derive(Clone, Debug)]
struct Rotation {
    turning: Turning,
    encoder: TurnEncoder,
    max_moment: f64,
    /// The moment that the motors hold (N m).
    moment: Vec3,
    /// Of translation and rotation together.
    energy: MechanicalEnergy,
}

impl SimDevice {
    /// A device at rest at its origin, in a hand or free, for a tick of `period_s` (which the velocity
    /// estimate needs).
    ///
    /// # Errors
    /// [`SimError`] where a number of the model, the arm or the period makes no sense.
    pub fn new(model: DeviceModel, hand: Option<Hand>, period_s: f64) -> Result<Self, SimError> {
        check(&model)?;
        if !(1e-5..=0.1).contains(&period_s) {
            return Err(SimError::Period { found: period_s });
        }
        let arm = hand.as_ref().map_or(Arm::NONE, |hand| hand.arm);
        if !arm.is_sound() {
            return Err(SimError::Arm { found: arm });
        }
        let wrist = hand.as_ref().map_or(Wrist::NONE, |hand| hand.wrist);
        if !wrist.is_sound() {
            return Err(SimError::Wrist { found: wrist });
        }
        let start = Vec3::zeros();
        Ok(Self {
            model,
            dynamics: Dynamics::new(model.mass, model.damping, model.friction, arm, start),
            start,
            aim: hand.map(Aim::new),
            substep_ns: SUBSTEP_NS,
            force: Vec3::zeros(),
            clock: None,
            moved_ns: 0,
            frozen_ns: 0,
            refused_wrenches: 0,
            encoder: Encoder::new(model.position_step, period_s, LONGEST_MOVE_NS),
            rotation: model.rotation.map(|rotation| Rotation {
                turning: Turning::new(&rotation, wrist),
                encoder: TurnEncoder::new(rotation.step, period_s, LONGEST_MOVE_NS),
                max_moment: rotation.max_moment,
                moment: Vec3::zeros(),
                energy: MechanicalEnergy::default(),
            }),
        })
    }

    /// The same, starting at rest at `position` (m, device axes). To be called before the first read.
    ///
    /// # Errors
    /// [`SimError::Start`] where the position is not finite.
    pub fn starting_at(mut self, position: Vec3) -> Result<Self, SimError> {
        if !position.iter().all(|x| x.is_finite()) {
            return Err(SimError::Start);
        }
        let arm = self.aim.as_ref().map_or(Arm::NONE, Aim::arm);
        let DeviceModel {
            mass,
            damping,
            friction,
            ..
        } = self.model;
        self.dynamics = Dynamics::new(mass, damping, friction, arm, position);
        self.start = position;
        Ok(self)
    }

    /// The same, with substeps of another length (ns).
    ///
    /// # Errors
    /// [`SimError::Substep`] where it is outside 100 ns to 0.1 s.
    pub fn with_substep_ns(self, substep_ns: u64) -> Result<Self, SimError> {
        if !(100..=LONGEST_MOVE_NS).contains(&substep_ns) {
            return Err(SimError::Substep { found: substep_ns });
        }
        Ok(Self { substep_ns, ..self })
    }

    /// The model that it was made from.
    pub fn model(&self) -> &DeviceModel {
        &self.model
    }

    /// Where the end effector truly is (m), as no encoder sees it.
    pub fn position(&self) -> Vec3 {
        self.dynamics.position()
    }

    /// How fast it truly moves (m/s).
    pub fn velocity(&self) -> Vec3 {
        self.dynamics.velocity()
    }

    /// The force that the motors hold (N): the last one written, shortened to the device's largest.
    pub fn force(&self) -> Vec3 {
        self.force
    }

    /// How the end effector is truly turned; the identity where its rotation is not modelled.
    pub fn orientation(&self) -> UnitQuaternion<f64> {
        let turning = self.rotation.as_ref().map(|rotation| &rotation.turning);
        turning.map_or_else(UnitQuaternion::identity, Turning::orientation)
    }

    /// How fast it truly turns (rad/s).
    pub fn angular_velocity(&self) -> Vec3 {
        let turning = self.rotation.as_ref().map(|rotation| &rotation.turning);
        turning.map_or_else(Vec3::zeros, Turning::velocity)
    }

    /// The moment that the motors hold (N m): the last one written, shortened to the device's largest; zero
    /// where its rotation is not modelled.
    pub fn moment(&self) -> Vec3 {
        let rotation = self.rotation.as_ref();
        rotation.map_or_else(Vec3::zeros, |rotation| rotation.moment)
    }

    /// Where the energy came from and went, in translation and rotation together.
    pub fn energy(&self) -> &MechanicalEnergy {
        match &self.rotation {
            None => self.dynamics.energy(),
            Some(rotation) => &rotation.energy,
        }
    }

    /// How long it stood still because calls came too far apart (ns).
    pub fn frozen_ns(&self) -> u64 {
        self.frozen_ns
    }

    /// How many wrenches it replaced by zero because they were not finite.
    pub fn refused_wrenches(&self) -> u64 {
        self.refused_wrenches
    }

    /// Moves on to `now_ns`. A time that lies before the last one changes nothing.
    fn advance(&mut self, now_ns: u64) {
        let (first, last) = self.clock.unwrap_or((now_ns, now_ns));
        let gap = now_ns.saturating_sub(last);
        self.clock = Some((first, last + gap));
        let mut left = gap.min(LONGEST_MOVE_NS);
        self.frozen_ns += gap - left;
        while left > 0 {
            let step = left.min(self.substep_ns);
            left -= step;
            self.moved_ns += step;
            let wanted = self
                .aim
                .as_mut()
                .map_or(self.start, |aim| self.start + aim.at(self.moved_ns));
            self.dynamics.step(step as f64 * 1e-9, &self.force, &wanted);
            if let Some(rotation) = &mut self.rotation {
                let moment = rotation.moment;
                rotation.turning.step(step as f64 * 1e-9, &moment);
            }
        }
        if let Some(rotation) = &mut self.rotation {
            rotation.energy = *self.dynamics.energy() + *rotation.turning.energy();
        }
    }
}

/// Whether every number of a model makes sense.
fn check(model: &DeviceModel) -> Result<(), SimError> {
    let mut positive = vec![
        ("mass", model.mass),
        ("position step", model.position_step),
        ("largest force", model.max_force),
        ("workspace radius", model.workspace_radius),
    ];
    let mut not_negative = vec![("damping", model.damping), ("friction", model.friction)];
    if let Some(rotation) = &model.rotation {
        positive.extend([
            ("moment of inertia", rotation.inertia),
            ("angular step", rotation.step),
            ("largest moment", rotation.max_moment),
        ]);
        not_negative.extend([
            ("rotation's damping", rotation.damping),
            ("rotation's friction", rotation.friction),
        ]);
    }
    for (field, found) in positive {
        if !(found.is_finite() && found > 0.0) {
            return Err(SimError::NotPositive { field, found });
        }
    }
    for (field, found) in not_negative {
        if !(found.is_finite() && found >= 0.0) {
            return Err(SimError::Negative { field, found });
        }
    }
    Ok(())
}

/// A vector shortened to `most`; nothing where it is not finite.
fn shortened(vector: Vec3, most: f64) -> Option<Vec3> {
    let length = vector.norm();
    if !length.is_finite() {
        None
    } else if length > most {
        Some(vector * (most / length))
    } else {
        Some(vector)
    }
}

impl Device for SimDevice {
    fn capabilities(&self) -> Capabilities {
        self.model.capabilities()
    }

    /// Never fails. The device's clock starts at the first call.
    fn read(&mut self, now_ns: u64) -> Result<DeviceState, DeviceError> {
        self.advance(now_ns);
        self.encoder
            .sample(self.moved_ns, &self.dynamics.position());
        let mut pose = Pose::at(self.encoder.position());
        let mut twist = Twist {
            linear: self.encoder.velocity(),
            angular: Vec3::zeros(),
        };
        if let Some(Rotation {
            turning, encoder, ..
        }) = &mut self.rotation
        {
            encoder.sample(self.moved_ns, &turning.orientation());
            pose.rotation = encoder.orientation();
            twist.angular = encoder.velocity();
        }
        Ok(DeviceState {
            pose,
            twist,
            buttons: 0,
            device_time_ns: self.clock.map_or(0, |(first, last)| last - first),
        })
    }

    /// Never fails. A force or a moment beyond the largest keeps its direction; one that is not finite
    /// becomes zero. Without a rotation the moment is no part of it.
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        self.advance(now_ns);
        let force = shortened(wrench.force, self.model.max_force);
        let mut refused = force.is_none();
        self.force = force.unwrap_or_else(Vec3::zeros);
        if let Some(rotation) = &mut self.rotation {
            let moment = shortened(wrench.moment, rotation.max_moment);
            refused |= moment.is_none();
            rotation.moment = moment.unwrap_or_else(Vec3::zeros);
        }
        self.refused_wrenches += u64::from(refused);
        Ok(())
    }

    fn probe(&self) -> Option<Probe> {
        let energy = self.energy();
        Some(Probe {
            pose: Pose {
                position: self.position(),
                rotation: self.orientation(),
            },
            twist: Twist {
                linear: self.velocity(),
                angular: self.angular_velocity(),
            },
            held: Wrench {
                force: self.force,
                moment: self.moment(),
            },
            motor_work: energy.motor_work,
            on_hand: energy.on_hand(),
        })
    }
}

#[cfg(test)]
mod tests;
