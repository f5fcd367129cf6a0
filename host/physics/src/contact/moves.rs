//! How the vertices of a cluster move in a step, and how near two clusters must be for their pairs to matter.
//!
//! A pair gets a row if it is near at the predicted end (`feet`), so its distance at the start is bounded by
//! the motion of one cluster *against* the other. The certificate needs more and less: pairs as near as both vertices move
//! together, because truncation stops one of the two, but no thickness.

use super::feet::{BESIDE, FURTHER};
use crate::Vec3;

/// The motion of a cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moves {
    /// The mean displacement (m).
    pub mean: Vec3,
    /// The largest departure of a displacement from the mean (m).
    pub around: f64,
    /// The largest displacement (m).
    pub most: f64,
}

impl Moves {
    /// The motion of some `vertices`, whose displacements are in `u` (m).
    pub fn of(vertices: &[u32], u: &[Vec3]) -> Self {
        let each = || vertices.iter().map(|vertex| u[*vertex as usize]);
        let mean = each().sum::<Vec3>() / vertices.len().max(1) as f64;
        let most = |from: Vec3| {
            let squares = each().map(|u| (u - from).norm_squared());
            squares.fold(0.0, f64::max).sqrt()
        };
        Self {
            mean,
            around: most(mean),
            most: most(Vec3::zeros()),
        }
    }

    /// The distance at the start of the step (m) up to which pairs with another cluster matter. `radii` is the sum of the radii
    /// of the parts (m).
    pub(super) fn need(&self, other: &Self, radii: f64) -> f64 {
        let relative = (self.mean - other.mean).norm() + self.around + other.around;
        let to_touch = (1.0 + BESIDE) * radii + (1.0 + FURTHER) * relative;
        to_touch.max(self.most + other.most)
    }

    /// The share of one cluster in the distance: no need is larger than the sum of both shares. `radius` is that of its part (m).
    pub(super) fn alone(&self, radius: f64) -> f64 {
        (1.0 + BESIDE) * radius + (1.0 + FURTHER) * self.most.max(self.mean.norm() + self.around)
    }
}
