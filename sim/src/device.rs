//! A simulated haptic device, with the hand that holds it.
//!
//! [`SimDevice`] is a [`Device`] like any other. Between two calls, the device moves under the last command, which it
//! holds as a real device does. A read returns the position that its encoders report. The device moves exactly up to
//! the time of the call in substeps of a fixed length. If the length does not divide the time, the last substep is
//! shorter. Times are integer nanoseconds and do not drift.
//!
//! The model has the moving mass, viscous damping, Coulomb friction, encoder counts, the largest force of the motors,
//! and the arm of [`crate::hand`]. If the device model has a rotation, the model has the same quantities for the
//! rotation of the handle, with the wrist. The model has no end stops, no motor dynamics, no backlash, no inertia that
//! depends on the pose or couples translation and rotation, and no gravity (devices compensate gravity).

use crate::arm::{Arm, Wrist};
use crate::dynamics::{Dynamics, Turning};
use crate::encoder::{Encoder, TurnEncoder};
use crate::energy::MechanicalEnergy;
use crate::hand::{Aim, Hand};
use crate::trace::Felt;
use crate::trajectory::Trajectory;
use devices::DeviceModel;
use nalgebra::UnitQuaternion;
use rt_core::{
    Capabilities, Device, DeviceError, DeviceState, Pose, Probe, Rendering, Twist, Vec3, Wrench,
};

/// Default length of a substep (ns): 20 substeps in a millisecond.
pub const SUBSTEP_NS: u64 = 50_000;
/// Longest time for which the device moves in one call (ns). This time bounds the work of a call. In a longer gap, the
/// device stands still for the rest of the gap, and the rest is counted.
pub(crate) const LONGEST_MOVE_NS: u64 = 100_000_000;

/// The reason why a simulated device could not be made.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SimError {
    /// A number of the model must be finite and above zero.
    #[error("the device model's {field} must be finite and above zero, not {found}")]
    NotPositive {
        /// Name of the number.
        field: &'static str,
        /// The value that was given.
        found: f64,
    },
    /// A number of the model must be finite and at least zero.
    #[error("the device model's {field} must be finite and at least zero, not {found}")]
    Negative {
        /// Name of the number.
        field: &'static str,
        /// The value that was given.
        found: f64,
    },
    /// The arm has a number that is negative or not finite.
    #[error(
        "the arm's mass, damping and stiffness must be finite and at least zero, not {found:?}"
    )]
    Arm {
        /// The arm.
        found: Arm,
    },
    /// The wrist has a number that is negative or not finite.
    #[error(
        "the wrist's inertia, damping and stiffness must be finite and at least zero, not {found:?}"
    )]
    Wrist {
        /// The wrist.
        found: Wrist,
    },
    /// The period of the tick is out of range.
    #[error("the tick's period must be from 1e-5 to 0.1 s, not {found} s")]
    Period {
        /// The value that was given (s).
        found: f64,
    },
    /// The substep is too short to bound the work of a call, or too long for a tick.
    #[error("a substep must be from 100 to 100000000 ns, not {found} ns")]
    Substep {
        /// The value that was given (ns).
        found: u64,
    },
    /// The start position is not finite, or not on the axes of the device.
    #[error("the device's start position must be finite, and on the axes along which it moves")]
    Start,
}

/// A simulated device, held by a hand or free. It has three degrees of freedom, or six if its model has a rotation, or
/// one or two if its model names axes. Such a device moves along its axes alone, to the last bit. Its mechanism carries
/// the force of the hand across the axes, without friction, and ignores the part of a command across the axes.
#[derive(Clone, Debug)]
pub struct SimDevice {
    model: DeviceModel,
    dynamics: Dynamics,
    start: Vec3,
    aim: Option<Aim>,
    substep_ns: u64,
    /// The force that the motors hold (N).
    force: Vec3,
    /// Times of the first call and of the latest call (ns); `None` before the first call.
    clock: Option<(u64, u64)>,
    /// Time for which the device has moved (ns).
    moved_ns: u64,
    frozen_ns: u64,
    refused_wrenches: u64,
    encoder: Encoder,
    /// The rotation; `None` for a device of three degrees of freedom.
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
    /// Energy of translation and rotation together.
    energy: MechanicalEnergy,
}

impl SimDevice {
    /// A device at rest at its origin, held by a hand or free. The estimate of the velocity needs the period `period_s`
    /// of the tick (s).
    ///
    /// # Errors
    /// [`SimError`] if a number of the model, a number of the arm or the wrist, or the period is out of range.
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

    /// The same device, at rest at `position` (m, device axes). Call this before the first read.
    ///
    /// # Errors
    /// [`SimError::Start`] if the position is not finite, or not on the axes of the device.
    pub fn starting_at(mut self, position: Vec3) -> Result<Self, SimError> {
        if !position.iter().all(|x| x.is_finite()) || self.along(&position) != position {
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

    /// The same device with substeps of another length (ns).
    ///
    /// # Errors
    /// [`SimError::Substep`] if the length is outside 100 ns to 0.1 s.
    pub fn with_substep_ns(self, substep_ns: u64) -> Result<Self, SimError> {
        if !(100..=LONGEST_MOVE_NS).contains(&substep_ns) {
            return Err(SimError::Substep { found: substep_ns });
        }
        Ok(Self { substep_ns, ..self })
    }

    /// Lets the hand follow another trajectory from now on, whose time is that of [`moved_s`](Self::moved_s). The
    /// tremor continues. A free device stays free. A trajectory that does not continue the present one pulls the device
    /// by the arm.
    pub fn guide(&mut self, trajectory: Trajectory) {
        if let Some(aim) = &mut self.aim {
            aim.guide(trajectory);
        }
    }

    /// Lets the hand stay at its start until [`begin_hand`](Self::begin_hand) starts the hand's own time. While the
    /// hand waits, [`guide`](Self::guide) moves it and does not change its own trajectory.
    pub fn hold_hand(&mut self) {
        if let Some(aim) = &mut self.aim {
            aim.wait();
        }
    }

    /// Begins the own time of a hand that waits.
    pub fn begin_hand(&mut self) {
        let now = self.moved_s();
        if let Some(aim) = &mut self.aim {
            aim.begin(now);
        }
    }

    /// Time for which the device has moved (s): the time of its hand.
    pub fn moved_s(&self) -> f64 {
        self.moved_ns as f64 * 1e-9
    }

    /// The model of the device.
    pub fn model(&self) -> &DeviceModel {
        &self.model
    }

    /// True position of the end effector (m), before the encoder.
    pub fn position(&self) -> Vec3 {
        self.dynamics.position()
    }

    /// True velocity of the end effector (m/s).
    pub fn velocity(&self) -> Vec3 {
        self.dynamics.velocity()
    }

    /// The force that the motors hold (N): the last command, shortened to the largest force of the device.
    pub fn force(&self) -> Vec3 {
        self.force
    }

    /// True orientation of the end effector; the identity if the model has no rotation.
    pub fn orientation(&self) -> UnitQuaternion<f64> {
        let turning = self.rotation.as_ref().map(|rotation| &rotation.turning);
        turning.map_or_else(UnitQuaternion::identity, Turning::orientation)
    }

    /// True angular velocity of the end effector (rad/s); zero if the model has no rotation.
    pub fn angular_velocity(&self) -> Vec3 {
        let turning = self.rotation.as_ref().map(|rotation| &rotation.turning);
        turning.map_or_else(Vec3::zeros, Turning::velocity)
    }

    /// The moment that the motors hold (N m): the last command, shortened to the largest moment of the device; zero
    /// if the model has no rotation.
    pub fn moment(&self) -> Vec3 {
        let rotation = self.rotation.as_ref();
        rotation.map_or_else(Vec3::zeros, |rotation| rotation.moment)
    }

    /// The energy balance of the device (J), of translation and rotation together.
    pub fn energy(&self) -> &MechanicalEnergy {
        match &self.rotation {
            None => self.dynamics.energy(),
            Some(rotation) => &rotation.energy,
        }
    }

    /// Time for which the device stood still because two calls were too far apart (ns).
    pub fn frozen_ns(&self) -> u64 {
        self.frozen_ns
    }

    /// The part of a vector along the axes of the device.
    fn along(&self, vector: &Vec3) -> Vec3 {
        self.model.freedom().part(vector)
    }

    /// Moves the device to the time `now_ns`. A time before the latest call changes nothing.
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
            let freedom = self.model.freedom();
            let felt = Felt {
                place: self.dynamics.position() - self.start,
                velocity: self.dynamics.velocity(),
                force: self.force,
            };
            let wanted = self.aim.as_mut().map_or(self.start, |aim| {
                self.start + freedom.part(&aim.at(self.moved_ns, &felt))
            });
            self.dynamics.step(step as f64 * 1e-9, &self.force, &wanted);
            if let Some(rotation) = &mut self.rotation {
                let moment = rotation.moment;
                let turned = self.aim.as_ref();
                if let Some(turned) = turned.and_then(|aim| aim.turned(self.moved_ns)) {
                    rotation.turning.aim_at(turned);
                }
                rotation.turning.step(step as f64 * 1e-9, &moment);
            }
        }
        if let Some(rotation) = &mut self.rotation {
            rotation.energy = *self.dynamics.energy() + *rotation.turning.energy();
        }
    }
}

/// Checks that every number of a model is in its range.
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

/// The vector, shortened to the length `most` if it is longer; `None` if its length is not finite.
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

    /// Never fails. The clock of the device starts at the first call.
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
            buttons: self
                .aim
                .as_ref()
                .map_or(0, |aim| aim.buttons(self.moved_ns)),
            device_time_ns: self.clock.map_or(0, |(first, last)| last - first),
            rendering: Rendering::Commanded,
        })
    }

    /// Never fails. A force or a moment beyond the largest keeps its direction. A force or a moment that is not finite
    /// becomes zero. A device without a rotation ignores the moment, and a device with axes the force across them.
    fn write(&mut self, now_ns: u64, wrench: &Wrench) -> Result<(), DeviceError> {
        self.advance(now_ns);
        let force = shortened(self.along(&wrench.force), self.model.max_force);
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

    /// Number of wrenches that were not finite.
    fn refused_wrenches(&self) -> Option<u64> {
        Some(self.refused_wrenches)
    }
}

#[cfg(test)]
mod tests;
