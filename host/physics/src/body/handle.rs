//! Handles: rigid groups of vertices that a hand holds and moves.

use super::border::{Border, Clamp};
use crate::Vec3;
use nalgebra::UnitQuaternion;

/// The motions of a handle for which its condensation has shapes. The pose of the handle is prescribed in full in all
/// cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// None: the handle is a clamp without a wrench in the local model.
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

/// The specification of a handle: its vertices, and its origin at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct HandleSpec {
    /// Vertices of the mesh, at least one. A vertex may belong to one handle only.
    pub vertices: Vec<u32>,
    /// The point of the pose and of moments (m), at rest.
    pub origin: Vec3,
    /// The motions for which the condensation has shapes.
    pub freedom: Freedom,
    /// Whether a sheet that bends turns freely about the edges of its border that the handle holds.
    pub border: Border,
}

/// The pose of a handle: the position of its origin, and its rotation from the rest shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandlePose {
    /// Position of the origin (m).
    pub position: Vec3,
    /// Rotation from the rest shape, in world axes.
    pub rotation: UnitQuaternion<f64>,
}

impl HandlePose {
    /// A pose without rotation.
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
    /// Adds a force at `arm` (m) from the point of the moment.
    pub(crate) fn add(&mut self, force: &Vec3, arm: &Vec3) {
        self.force += force;
        self.moment += arm.cross(force);
    }
}

/// The result of a step on a handle. Moments are about the origin at the end of the step, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleReport {
    /// Pose at the end of the step.
    pub pose: HandlePose,
    /// Velocity of the origin over the step (m/s).
    pub linear_velocity: Vec3,
    /// Angular velocity over the step (rad/s), in world axes.
    pub angular_velocity: Vec3,
    /// The wrench of the body on the hand, without the inertia of the held vertices. Equal to `inertia - reaction`.
    pub wrench_on_hand: Wrench,
    /// The wrench of the hand on the body that moves the held vertices as prescribed.
    pub reaction: Wrench,
    /// Mass times acceleration of the held vertices.
    pub inertia: Wrench,
}

/// A handle of a body.
#[derive(Clone, Debug)]
pub(crate) struct Handle {
    /// The nodes that it holds: its vertices, then the ghosts of its clamps.
    pub(crate) vertices: Vec<u32>,
    pub(crate) clamps: Vec<Clamp>,
    /// Nodes relative to the origin when the handle was made (m).
    pub(crate) offsets: Vec<Vec3>,
    /// Force of the hand on each node, less the node's inertia, in the last step (N).
    pub(crate) grip: Vec<Vec3>,
    pub(crate) freedom: Freedom,
    pub(crate) report: HandleReport,
}

impl Handle {
    /// A handle that holds its vertices and `clamps` where they are: at `x` (m), by node. The handle has still to be
    /// [laid](super::border::lay).
    pub(crate) fn new(x: &[Vec3], spec: &HandleSpec, clamps: Vec<Clamp>) -> Self {
        let vertices = spec.vertices.iter();
        let ghosts = clamps.iter();
        let at = vertices.clone().map(|&vertex| x[vertex as usize]);
        let at = at.chain(ghosts.clone().map(|clamp| clamp.extend(x)));
        let offsets: Vec<Vec3> = at.map(|at| at - spec.origin).collect();
        let report = HandleReport {
            pose: HandlePose::at(spec.origin),
            linear_velocity: Vec3::zeros(),
            angular_velocity: Vec3::zeros(),
            wrench_on_hand: Wrench::default(),
            reaction: Wrench::default(),
            inertia: Wrench::default(),
        };
        Self {
            vertices: vertices
                .copied()
                .chain(ghosts.map(|clamp| clamp.ghost))
                .collect(),
            grip: vec![Vec3::zeros(); offsets.len()],
            offsets,
            clamps,
            freedom: spec.freedom,
            report,
        }
    }

    /// The vertices that it holds, without ghosts.
    pub(crate) fn own(&self) -> &[u32] {
        &self.vertices[..self.vertices.len() - self.clamps.len()]
    }

    /// Its nodes, each with its offset from the origin when the handle was made (m).
    pub(crate) fn nodes(&self) -> impl Iterator<Item = (usize, &Vec3)> {
        let nodes = self.vertices.iter().map(|&vertex| vertex as usize);
        nodes.zip(&self.offsets)
    }
}
