//! One bar: its force and its tangent.
//!
//! A corotational bar (M. A. Crisfield, "Non-linear finite element analysis of solids and structures", volume 1, 1991,
//! section 3). The strain is the change of length over the length at rest, `(l - L0) / L0`, for any rotation. The axis
//! `n` points from the first end to the second, the stiffness is `k = EA / L0`, and the tension is `N = k (l - L0)`:
//!
//! ```text
//! energy  k (l - L0)^2 / 2
//! force   N n on the first end, -N n on the second
//! tangent k n n^T + N / l (I - n n^T)
//! ```
//!
//! The second part of the tangent is the stiffness of a taut string. It is negative for a bar under compression.
//!
//! A bar of tension only is slack below its length at rest: its energy, force and stiffness are zero. Energy and force
//! are continuous where the bar becomes taut, so the energy is once continuously differentiable (C1) in the positions
//! and the force is C0. The tangent jumps there from zero to `k n n^T`. At `l = L0` itself the tangent is that of the
//! taut bar, with which a thread that is straight at rest starts.

use crate::material::Tangent;
use crate::{Mat3, Vec3};

/// The parameters of a bar: its stiffness, its length at rest, and whether it resists compression.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bar {
    /// `EA / L0` (N/m).
    pub(super) stiffness: f64,
    /// Length at rest (m).
    pub(super) rest: f64,
    /// Whether the force is zero below the length at rest.
    pub(super) tension_only: bool,
}

/// The state of a bar: its axis, its length and its elongation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretched {
    /// Unit vector from the first end to the second; zero if the ends coincide and there is no direction.
    pub(super) axis: Vec3,
    /// Length (m).
    pub(super) length: f64,
    /// Length less the length at rest (m).
    elongation: f64,
    /// Whether the bar resists.
    taut: bool,
}

impl Bar {
    /// The bar from `a` to `b` (m).
    pub(super) fn between(&self, a: &Vec3, b: &Vec3) -> Stretched {
        let along = b - a;
        let length = along.norm();
        let elongation = length - self.rest;
        Stretched {
            axis: if length > 0.0 {
                along / length
            } else {
                Vec3::zeros()
            },
            length,
            elongation,
            taut: elongation >= 0.0 || !self.tension_only,
        }
    }

    /// Elastic energy (J).
    pub(super) fn energy(&self, at: &Stretched) -> f64 {
        if at.taut {
            0.5 * self.stiffness * at.elongation * at.elongation
        } else {
            0.0
        }
    }

    /// Tension (N); negative under compression.
    pub(super) fn tension(&self, at: &Stretched) -> f64 {
        if at.taut {
            self.stiffness * at.elongation
        } else {
            0.0
        }
    }

    /// Minus the derivative of the force on one end with respect to that end's position (N/m). The derivative with
    /// respect to the other end's position has the opposite sign.
    pub(super) fn tangent(&self, at: &Stretched, tangent: Tangent) -> Mat3 {
        if !at.taut || at.length == 0.0 {
            return Mat3::zeros();
        }
        let across = self.tension(at) / at.length;
        let across = match tangent {
            Tangent::Exact => across,
            Tangent::Clipped => across.max(0.0),
        };
        let along = at.axis * at.axis.transpose();
        Mat3::identity() * across + along * (self.stiffness - across)
    }
}
