//! Handles: rigid groups of vertices that a hand holds and moves.

use crate::Vec3;
use nalgebra::UnitQuaternion;

/// Which motions of a handle its condensation answers to. Its pose is prescribed in full either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// None: the handle is a clamp that nobody feels.
    Fixed,
    /// The three translations.
    Translation,
    /// Three translations and three rotations.
    Rigid,
}

impl Freedom {
    /// Number of motions: 0, 3 or 6.
    pub fn count(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Translation => 3,
            Self::Rigid => 6,
        }
    }
}

/// A handle to be made: the vertices that it holds, and where its origin is at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct HandleSpec {
    /// Vertices of the mesh, each held by one handle only; at least one.
    pub vertices: Vec<u32>,
    /// The point at which the pose is given and about which moments are taken (m), at rest.
    pub origin: Vec3,
    /// Which motions the condensation answers to.
    pub freedom: Freedom,
}

/// Where a handle is: its origin, and its rotation from the rest shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandlePose {
    /// Position of the origin (m).
    pub position: Vec3,
    /// Rotation from the rest shape, in world axes.
    pub rotation: UnitQuaternion<f64>,
}

impl HandlePose {
    /// A pose that is only moved, not rotated.
    pub fn at(position: Vec3) -> Self {
        Self {
            position,
            rotation: UnitQuaternion::identity(),
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.position
            .iter()
            .chain(self.rotation.coords.iter())
            .all(|value| value.is_finite())
    }
}

/// A force (N) and a moment (N m) about some point, in world axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force (N).
    pub force: Vec3,
    /// Moment (N m).
    pub moment: Vec3,
}

impl Wrench {
    /// Adds a force at `arm` from the point about which the moment is taken.
    pub(crate) fn add(&mut self, force: &Vec3, arm: &Vec3) {
        self.force += force;
        self.moment += arm.cross(force);
    }
}

/// What a step did at a handle. Moments are about the origin at the end of the step, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleReport {
    /// Pose at the end of the step.
    pub pose: HandlePose,
    /// Velocity of the origin over the step (m/s).
    pub linear_velocity: Vec3,
    /// Angular velocity over the step (rad/s), in world axes.
    pub angular_velocity: Vec3,
    /// What the hand feels: the wrench of the body on the hand, without the inertia of the vertices held.
    /// Equal to `inertia - reaction`.
    pub wrench_on_hand: Wrench,
    /// The wrench that moved the vertices as prescribed, of the hand on the body.
    pub reaction: Wrench,
    /// Mass times acceleration of the vertices held.
    pub inertia: Wrench,
}

/// A handle of a body. Its vertices are nodes `first` to `first + offsets.len()`.
#[derive(Clone, Debug)]
pub(crate) struct Handle {
    pub(crate) first: usize,
    pub(crate) vertices: Vec<u32>,
    /// Vertices from the origin, as they were taken hold of (m).
    pub(crate) offsets: Vec<Vec3>,
    pub(crate) freedom: Freedom,
    pub(crate) report: HandleReport,
}

impl Handle {
    pub(crate) fn new(first: usize, offsets: Vec<Vec3>, spec: &HandleSpec) -> Self {
        let report = HandleReport {
            pose: HandlePose::at(spec.origin),
            linear_velocity: Vec3::zeros(),
            angular_velocity: Vec3::zeros(),
            wrench_on_hand: Wrench::default(),
            reaction: Wrench::default(),
            inertia: Wrench::default(),
        };
        Self {
            first,
            vertices: spec.vertices.clone(),
            offsets,
            freedom: spec.freedom,
            report,
        }
    }

    pub(crate) fn nodes(&self) -> core::ops::Range<usize> {
        self.first..self.first + self.offsets.len()
    }
}
