//! The memory of each hand on a body: its pose, the wrenches that it held, and its last steps.

use super::edge::Edge;
use super::{MAX_DELAY, Port};
use crate::geometry::{Pose, Vec3, Vec6, Wrench};

/// The motion of one handle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// Displacement over the last tick.
    pub(crate) step: Vec6,
    /// Heading: the last translation along each axis that was not zero, in this tick or before.
    pub(crate) heading: Vec3,
    /// Filtered velocity.
    pub(crate) velocity: Vec6,
}

impl Motion {
    pub(crate) fn none() -> Self {
        Self {
            step: Vec6::zeros(),
            heading: Vec3::zeros(),
            velocity: Vec6::zeros(),
        }
    }
}

/// The last translation that was not zero, or the last rotation.
#[derive(Clone, Copy, Debug)]
pub(super) struct LastStep {
    pub(super) by: Vec3,
    /// Ticks since that step.
    pub(super) since: u32,
}

impl LastStep {
    pub(super) fn none() -> Self {
        Self {
            by: Vec3::zeros(),
            since: 0,
        }
    }

    /// A `fraction` of the least energy (J) that a mechanism with this damping and friction can have dissipated in the
    /// motion of this tick. A count that flickers dissipates nothing. A count that comes once in many ticks, or after a
    /// device was silent, was made slowly: in the time `t`, a damper dissipates at least `b D^2 / t`.
    pub(super) fn dissipated(
        &mut self,
        by: &Vec3,
        period: f64,
        [damping, friction]: [f64; 2],
        fraction: f64,
    ) -> f64 {
        if *by == Vec3::zeros() {
            return 0.0;
        }
        let time = period * f64::from(self.since);
        let onwards = by.dot(&self.by) > 0.0;
        *self = Self { by: *by, since: 0 };
        let length = by.norm();
        if onwards {
            fraction * length * (damping * (length / time) + friction)
        } else {
            0.0
        }
    }
}

/// The memory of one hand and its device.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HandMemory {
    pub(super) port: Port,
    /// Whether the device holds the body.
    pub(super) holds: bool,
    /// The displacement since the last tick.
    pub(crate) step: Vec6,
    /// Number of the piece whose account takes the work of the hand; zero for a whole body.
    pub(super) piece: usize,
    /// Work that the hand was spared by weight that its device did not render (J), signed.
    pub(super) spared: f64,
    pub(super) pose: Option<Pose>,
    /// Wrenches that the device rendered, renders and will render, newest first.
    pub(super) held: [Wrench; MAX_DELAY + 1],
    /// The weight in each of these wrenches.
    pub(super) weights: [Vec3; MAX_DELAY + 1],
    /// The weight on the handle, whether the device renders it or not.
    pub(super) weight: Vec3,
    /// Position at which the handle first had weight.
    pub(super) lifted_from: Option<Vec3>,
    /// The last translation and the last rotation that were not zero.
    pub(super) last_steps: [LastStep; 2],
    /// The last translation along each axis. A count along another axis does not tell that the hand has turned.
    pub(crate) heading: Vec3,
    /// The step of this tick, if it was one count after a rest; zero otherwise.
    pub(super) rest_count: Vec3,
    /// Number of ticks in which the translation of this tick was made: more than one for a count after a rest.
    pub(crate) pace: f64,
    /// Zero along each axis whose last step was a single count back, because such a count tells no velocity; one along
    /// the others.
    pub(crate) onward: Vec3,
    /// The last count along each axis.
    pub(super) edges: [Edge; 3],
    /// Spring force of the last command.
    pub(super) spring: Vec3,
    /// Largest motion in a tick, in any direction: the longest of the last steps, with a memory that decays.
    pub(super) reach: [f64; 2],
}

impl HandMemory {
    pub(super) fn new(port: Port) -> Self {
        Self {
            port,
            holds: false,
            step: Vec6::zeros(),
            piece: 0,
            spared: 0.0,
            pose: None,
            held: [Wrench::zero(); MAX_DELAY + 1],
            weights: [Vec3::zeros(); MAX_DELAY + 1],
            weight: Vec3::zeros(),
            lifted_from: None,
            last_steps: [LastStep::none(); 2],
            heading: Vec3::zeros(),
            rest_count: Vec3::zeros(),
            pace: 1.0,
            onward: Vec3::repeat(1.0),
            edges: [Edge::default(); 3],
            spring: Vec3::zeros(),
            reach: [0.0; 2],
        }
    }

    /// Takes the newest wrench, in which `rendered` is the weight, and forgets the oldest. `weight` is the weight on the
    /// handle. Returns the change of the potential by the change of this weight (J).
    pub(super) fn push(&mut self, wrench: &Wrench, rendered: &Vec3, weight: &Vec3) -> f64 {
        let mut newer = *wrench;
        for held in &mut self.held {
            core::mem::swap(held, &mut newer);
        }
        let mut newer = *rendered;
        for held in &mut self.weights {
            core::mem::swap(held, &mut newer);
        }
        let change = weight - core::mem::replace(&mut self.weight, *weight);
        let Some(pose) = self.pose.filter(|_| change != Vec3::zeros()) else {
            return 0.0;
        };
        let from = *self.lifted_from.get_or_insert(pose.position);
        -change.dot(&(pose.position - from))
    }

    /// Work (J) that the present wrench will do before it can vanish, while the hand moves on at `velocity`. The force
    /// falls at the slew limit of the device at most.
    pub(super) fn lingering(&self, velocity: &Vec6) -> f64 {
        let [held, ..] = &self.held;
        let power = held
            .force
            .dot(&Vec3::new(velocity.x, velocity.y, velocity.z));
        (0.5 * power * held.force.norm() / self.port.max_slew).max(0.0)
    }
}
