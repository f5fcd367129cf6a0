//! The feet of a pair in a step: those where the step is predicted to end, if the side is certain there.
//!
//! A row needs a direction. The direction at the predicted end follows a surface that turns; the direction at the start is
//! late by one step, by which a belt over a cylinder pulls with an error of `v h / R` per radian. A pair has a distance
//! without a sign. If the prediction has already passed through, the direction at its end is the wrong one.
//!
//! The direction at the end is right if the `certificate` shows that the pair does not cross. Otherwise, the row has the direction
//! at the start. So have edges whose direction turns far: two edges that pass around each other do not cross, and end with the
//! opposite direction.

use super::certificate::is_certain;
use super::kept::is_same;
use super::pair::{Foot, Pair};
use super::surface::Surfaces;
use crate::Vec3;

/// The row looks further than the motion by this fraction, and by a fraction of the thickness.
pub(super) const FURTHER: f64 = 1.3;
pub(super) const BESIDE: f64 = 0.1;

/// Whether a contact of a thickness (m), `distance` apart at the predicted end (m), may touch in the step: its feet are
/// predicted to move by `relative` (m).
pub(super) fn is_within(distance: f64, thickness: f64, relative: f64) -> bool {
    distance <= (1.0 + BESIDE) * thickness + FURTHER * relative
}

/// A connection with its length and direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Connection {
    pub foot: Foot,
    pub length: f64,
    pub normal: Vec3,
    /// The predicted displacement of the first foot against the second one (m).
    pub relative: Vec3,
}

impl Connection {
    fn new(foot: Foot, u: &[Vec3]) -> Self {
        let length = foot.apart.norm();
        Self {
            length,
            normal: foot.apart / length,
            relative: foot.difference(|vertex| u[vertex as usize]),
            foot,
        }
    }

    /// The connection from the second one of two edges to the first one.
    fn turned(&self) -> Self {
        let ([a, b, c, d], [s, t, u, v]) = (self.foot.vertices, self.foot.weights);
        Self {
            foot: Foot {
                vertices: [c, d, a, b],
                weights: [-u, -v, -s, -t],
                apart: -self.foot.apart,
            },
            length: self.length,
            normal: -self.normal,
            relative: -self.relative,
        }
    }
}

/// The connections of a pair at the start and at the predicted end of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Feet {
    pub start: Connection,
    pub end: Connection,
    /// Whether the pair is on the same side at the predicted end.
    pub is_certain: bool,
}

impl Feet {
    /// The feet of a pair from the positions `x` (m) to the positions `ends` = `x + u` (m). `None` if the pair stays further
    /// apart than a contact of a thickness (m) looks, or has no direction.
    pub(super) fn of(
        pair: Pair,
        surfaces: &Surfaces,
        [x, u, ends]: [&[Vec3]; 3],
        thickness: f64,
    ) -> Option<Self> {
        let end = Connection::new(pair.foot(surfaces, ends), u);
        let split = pair.split();
        let (first, second) = end.foot.vertices.split_at(split);
        let between = |a: u32| {
            let apart = second.iter().map(move |b| u[a as usize] - u[*b as usize]);
            apart.map(|by| by.norm_squared()).fold(0.0, f64::max)
        };
        let most = first.iter().map(|a| between(*a)).fold(0.0, f64::max).sqrt();
        // A nearer foot of a neighbour must be seen, too, at the start as at the end.
        if !is_within(end.length - most, thickness, most) {
            return None;
        }
        let start = Connection::new(pair.foot(surfaces, x), u);
        if !(start.normal.x.is_finite() && start.length > 0.0) {
            return None;
        }
        let at = |vertex: u32| ends[vertex as usize];
        let is_certain = end.length > 0.0
            && (split == 1 || is_same(&start.normal, &end.normal))
            && is_certain(pair, surfaces, &start.foot, |v| x[v as usize], at, |_| 0.0);
        Some(Self {
            start,
            end,
            is_certain,
        })
    }

    /// The same connection for the start and the end: that of two edges, or that of the second one to the first one.
    pub(super) fn settled(&self, is_turned: bool) -> Self {
        let at = self.at(self.is_certain);
        let at = if is_turned { at.turned() } else { *at };
        Self {
            start: at,
            end: at,
            ..*self
        }
    }

    /// The connection at the predicted end, or that at the start.
    pub(super) fn at(&self, is_end: bool) -> &Connection {
        if is_end { &self.end } else { &self.start }
    }

    /// The distance (m) predicted by a connection of the pair.
    pub(super) fn predicted(&self, is_end: bool) -> f64 {
        let at = self.at(is_end);
        if is_end {
            at.length
        } else {
            at.length + at.normal.dot(&at.relative)
        }
    }

    /// Whether the pair may touch in the step.
    pub(super) fn may_touch(&self, is_end: bool, thickness: f64) -> bool {
        let relative = self.at(is_end).relative.norm();
        let nearest = self.predicted(is_end).min(self.end.length);
        is_within(nearest, thickness, relative)
    }
}
