//! An obstacle of a step: a shape that moves rigidly from the start of the step to its end.

use super::obstacle::most_motion;
use super::rounded::Rounded;
use super::shape::{Nearest, Shape};
use crate::Vec3;
use nalgebra::{Isometry3, Point3};

/// A shape with its poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// The shape, in axes of its own.
    pub shape: Shape,
    /// Where the axes of the shape are at the start of the step.
    pub start: Isometry3<f64>,
    /// Where they are at its end.
    pub end: Isometry3<f64>,
    /// Whether the shape keeps the points that it touches.
    pub holds: bool,
}

impl Placed {
    /// The nearest point of the surface to `p` (m) at a pose.
    fn nearest(&self, pose: &Isometry3<f64>, p: &Vec3) -> Nearest {
        let own = pose.inverse_transform_point(&Point3::from(*p));
        let found = self.shape.nearest(&own.coords);
        Nearest {
            distance: found.distance,
            normal: pose.rotation * found.normal,
        }
    }

    /// The hull of a rounded shape with its radius; `None` for the other shapes.
    pub fn rounded(&self) -> Option<&Rounded> {
        match &self.shape {
            Shape::Rounded(rounded) => Some(rounded),
            Shape::Plane | Shape::Cylinder { .. } | Shape::Box { .. } => None,
        }
    }

    /// The nearest point to `p` (m) at the start of the step.
    pub fn at_start(&self, p: &Vec3) -> Nearest {
        self.nearest(&self.start, p)
    }

    /// The nearest point to `p` (m) at the end of the step.
    pub fn at_end(&self, p: &Vec3) -> Nearest {
        self.nearest(&self.end, p)
    }

    /// The motion over the step (m) of the material point that ends at `p` (m).
    pub fn motion_to(&self, p: &Vec3) -> Vec3 {
        let p = Point3::from(*p);
        p - self.start * self.end.inverse_transform_point(&p)
    }

    /// The motion over the step (m) of the material point that starts at `p` (m).
    pub fn motion_from(&self, p: &Vec3) -> Vec3 {
        let p = Point3::from(*p);
        self.end * self.start.inverse_transform_point(&p) - p
    }

    /// Where a direction of the start that is fixed to the shape points at the end of the step.
    pub fn turned(&self, direction: &Vec3) -> Vec3 {
        self.end.rotation * self.start.rotation.inverse_transform_vector(direction)
    }

    /// No material point within `radius` (m) of `p` moves further than this over the step (m).
    pub fn most_motion(&self, p: &Vec3, radius: f64) -> f64 {
        most_motion([self.start, self.end], p, radius)
    }
}
