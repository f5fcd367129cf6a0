//! Letting go: the force between the two sides of an edge after a tip has moved on.
//!
//! At first the new pair of vertices keeps the force `f` that its sides exerted on each other, so nothing jumps. The
//! force falls with the largest opening `D` so far, `f (1 - D / d_c)`, where `f d_c / 2 = G_c t a` for the length `a` of
//! torn edge that the pair stands for. Below `D` the pair unloads along the line to the origin. This is the law of
//! Camacho and Ortiz, "Computational modelling of impact damage in brittle materials", 1996, for a pair of vertices: the
//! opening is the distance of the two vertices, and the force acts along it. It does not depend on a turn of the sheet.
//!
//! **Energy.** With the largest opening `D` the pair has given up `f D / 2` in total, and stores
//! `f (1 - D / d_c) d^2 / (2 D)` at the opening `d`. Both sum to the work of the force. Once it has let go, a pair has
//! taken exactly `G_c t a`, whatever the history.
//!
//! **Over a step** from the opening vector `o_0` to `o_1`, [`Release::mean_force`] is the work divided by the change of
//! the distance, along `(o_0 + o_1) / (|o_0| + |o_1|)`. It is a discrete gradient (Gonzalez, "Time integration and
//! discrete Hamiltonian systems", 1996): its product with `o_1 - o_0` is the work of the law, exactly.

use super::law::{TearError, TearLaw, TearMaterial, check_positive};
use crate::Vec3;

/// The state of a pair of vertices that lets go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Release {
    /// The force at first (N).
    force: f64,
    /// The opening at which the pair has let go, `d_c` (m).
    limit: f64,
    /// The largest opening so far, `D` (m).
    largest: f64,
    /// The unit vector along which the force acts before the pair has opened.
    start: Vec3,
}

/// What a step of a pair did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Released {
    /// The work that the opening did against the force of the pair (J).
    pub work: f64,
    /// The part of the work that is lost (J): what tore.
    pub given_up: f64,
    /// The change of the energy that the pair stores (J).
    pub stored: f64,
}

impl Release {
    /// A pair at the moment at which its tip moves on. `force` (N) is the force that the second vertex exerts on the
    /// first, `length` (m) the length of the torn edge that the pair stands for. Under [`TearLaw::Thesis`] the pair has
    /// let go at once and takes no energy.
    ///
    /// # Errors
    ///
    /// [`TearError::Field`] for a force without direction and a length that is not positive.
    pub fn new(force: &Vec3, length: f64, material: &TearMaterial) -> Result<Self, TearError> {
        let size = force.norm();
        check_positive("force", size)?;
        check_positive("length", length)?;
        let energy = material.toughness * material.thickness * length;
        Ok(Self {
            force: size,
            limit: match material.law {
                TearLaw::Toughness => 2.0 * energy / size,
                TearLaw::Thesis => 0.0,
            },
            largest: 0.0,
            start: force / size,
        })
    }

    /// Whether the pair has let go. The tip before it may go on then.
    pub fn has_let_go(&self) -> bool {
        self.largest >= self.limit
    }

    /// The opening at which the pair has let go, `d_c` (m).
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// The largest opening so far (m).
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// The force of a pair whose largest opening is `d` (m), at this opening (N).
    fn envelope(&self, d: f64) -> f64 {
        if d < self.limit {
            self.force * (1.0 - d / self.limit)
        } else {
            0.0
        }
    }

    /// Stiffness of unloading and loading again below the largest opening (N/m). Zero before the pair has opened.
    pub fn unloading(&self) -> f64 {
        if self.largest > 0.0 {
            self.envelope(self.largest) / self.largest
        } else {
            0.0
        }
    }

    /// Slope of the force as the largest opening grows, `-f / d_c` (N/m). Zero once the pair has let go.
    pub fn softening(&self) -> f64 {
        if self.has_let_go() {
            0.0
        } else {
            -self.force / self.limit
        }
    }

    /// The size of the force at the opening `d` (m), in newtons.
    pub fn tension(&self, d: f64) -> f64 {
        if d >= self.largest {
            self.envelope(d)
        } else {
            self.unloading() * d
        }
    }

    /// The force on the first vertex (N) while the second is at `opening` (m) from it. The second vertex feels the
    /// opposite force.
    pub fn force(&self, opening: &Vec3) -> Vec3 {
        let d = opening.norm();
        if d > 0.0 {
            opening * (self.tension(d) / d)
        } else {
            self.start * self.tension(0.0)
        }
    }

    /// The energy that the pair stores at the opening `d` (m), at most its largest opening (J).
    pub fn stored(&self, d: f64) -> f64 {
        0.5 * self.unloading() * d * d
    }

    /// The energy that the pair has given up so far (J): `f D / 2`.
    pub fn given_up(&self) -> f64 {
        0.5 * self.force * self.largest.min(self.limit)
    }

    /// The work of opening from `d0` to `d1` (m) on the shorter way (J).
    fn work(&self, d0: f64, d1: f64) -> f64 {
        let below = |a: f64, b: f64| 0.5 * self.unloading() * (b - a) * (b + a);
        let beyond = |a: f64, b: f64| {
            let (a, b) = (a.min(self.limit), b.min(self.limit));
            0.5 * (b - a) * (self.envelope(a) + self.envelope(b))
        };
        if d1 <= self.largest {
            below(d0.min(self.largest), d1)
        } else {
            below(d0.min(self.largest), self.largest) + beyond(self.largest.max(d0), d1)
        }
    }

    /// The mean force on the first vertex (N) over a step in which the opening goes from `from` to `to` (m). Its product
    /// with `to - from` is the work of the law.
    pub fn mean_force(&self, from: &Vec3, to: &Vec3) -> Vec3 {
        let (d0, d1) = (from.norm(), to.norm());
        let sum = d0 + d1;
        if sum <= 0.0 {
            return self.force(to);
        }
        let change = d1 - d0;
        // Over a change this small the work loses its digits; the force in the middle is as exact.
        let tension = if change.abs() > 1e-8 * sum {
            self.work(d0, d1) / change
        } else {
            self.tension(0.5 * sum)
        };
        (from + to) * (tension / sum)
    }

    /// Ends a step in which the opening went from `from` to `to` (m): the largest opening grows.
    pub fn finish(&mut self, from: &Vec3, to: &Vec3) -> Released {
        let (d0, d1) = (from.norm(), to.norm());
        let before = (self.stored(d0), self.given_up());
        self.largest = self.largest.max(d1);
        let (stored, given_up) = (self.stored(d1) - before.0, self.given_up() - before.1);
        Released {
            work: stored + given_up,
            given_up,
            stored,
        }
    }
}
