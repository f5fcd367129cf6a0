//! The law of a pair of vertices that let each other go.
//!
//! A pair first keeps the force that its two sides exerted on each other, and loses it with the largest opening so far
//! (the linear law of G. T. Camacho and M. Ortiz, "Computational modelling of impact damage in brittle materials", 1996,
//! with unloading to the origin). With the largest opening `D` and the force `e` there:
//!
//! ```text
//! T(s) = e (d_c - s) / (d_c - D)      beyond D
//! T(s) = e s / D                      below D
//! ```
//!
//! **Direction.** The opening is the length of a vector: the one from the first vertex to the second, plus an offset along
//! the first force. The force acts along this vector, so that it follows a sheet that turns. At first `s = D` is the
//! length of the offset, a twentieth of `d_c`; without the offset a pair that has not opened would be rigid and have no
//! direction. The force `T(s) / s` per length across the vector is that of a spring.
//!
//! **Weakening.** The first force may contain bending forces of short edges beside the tip, which balance each other and
//! vanish once the sheet moves a little. A [weakening](Pair::weakening) pair forgets such a force: where it unloads, its
//! strength follows the force.
//!
//! **Slackening.** A tip that moves on inside the edge leaves less of the edge closed. The pair then [loses](Pair::slacken)
//! strength, whatever its opening, and the energy that its law would still have taken.
//!
//! **Energy.** The force of a pair that opens further is the work of its law over the step divided by the change of the
//! opening. A pair that closes takes the force at the end of the step, which lets no oscillation last. After each step
//! `d_c` is chosen so that the area that is left below the law is the energy that the pair has not yet taken. The work of
//! a pair over its life is therefore its energy, whatever the steps, and even if a step was solved roughly. The last step
//! of a pair may err; [`Stepper::take_surplus`](super::Stepper::take_surplus) returns this error, for the next pair to make
//! good.

use crate::Vec3;

/// The length of the offset, as a fraction of the opening at which the force is lost.
const OFFSET: f64 = 0.05;
/// Bisections for the opening that meets the law.
const BISECTIONS: usize = 60;

/// Two vertices that let each other go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The vertices.
    pub nodes: [u32; 2],
    /// The vector from the first vertex to the second, plus the offset (m).
    pub apart: Vec3,
    /// The first force (N).
    pub first: f64,
    /// The opening at which the force is lost (m).
    pub critical: f64,
    /// The largest opening so far (m).
    pub largest: f64,
    /// The force on the first vertex along [`direction`](Self::direction) (N): at the start of a step, and, while the step
    /// is solved, the mean over the step.
    pub force: f64,
    /// The work that the pair has taken from the body so far (J).
    pub work: f64,
    /// The energy that the pair takes over its life (J).
    pub energy: f64,
    /// The force at the largest opening (N).
    strength: f64,
    /// The force to which the strength may fall where the pair unloads (N).
    pub(super) floor: f64,
    /// The unit direction of the force on the first vertex at the start of the step.
    pub(super) direction: Vec3,
    /// The stiffness across the direction (N/m), and the force across it on the first vertex at the end of the step (N).
    pub(super) across: f64,
    pub(super) sideways: Vec3,
    /// Whether the pair lets go at the end of the step, whatever its opening.
    pub(super) is_dropped: bool,
}

impl Pair {
    /// A pair that keeps the force `force` (N) on its first vertex, and takes `energy` (J) until it has let go. `None` if
    /// there is no force, or no energy: such a pair lets go at once.
    pub fn new(nodes: [u32; 2], force: &Vec3, energy: f64) -> Option<Self> {
        let first = force.norm();
        // The area beyond the offset is the energy.
        let critical = 2.0 * energy / (first * (1.0 - OFFSET));
        let largest = OFFSET * critical;
        let is_finite = critical.is_finite() && first.is_finite();
        (is_finite && largest > 0.0 && first > 0.0).then(|| Self {
            nodes,
            apart: force * (largest / first),
            first,
            critical,
            largest,
            force: first,
            work: 0.0,
            energy,
            strength: first,
            floor: f64::INFINITY,
            direction: force / first,
            across: first / largest,
            sideways: Vec3::zeros(),
            is_dropped: false,
        })
    }

    /// The pair that weakens where it unloads: the strength follows the force down to `floor` (N), along the unloading
    /// line. The energy stays, so the opening at which the force is lost grows.
    #[must_use]
    pub fn weakening(self, floor: f64) -> Self {
        Self { floor, ..self }
    }

    /// Lets the strength fall by `loss` (N), at most to zero, where the pair has let go. The opening at which the force is
    /// lost stays. Returns by how much the energy of the pair falls (J).
    pub fn slacken(&mut self, loss: f64) -> f64 {
        let before = self.area();
        // A value that is not a number counts as zero.
        self.strength -= loss.max(0.0).min(self.strength);
        self.is_dropped |= self.strength <= 0.0;
        self.across = self.slope();
        self.force = self.across * self.opening();
        let lost = before - self.area();
        self.energy -= lost;
        lost
    }

    /// The force at the largest opening (N).
    pub fn strength(&self) -> f64 {
        self.strength
    }

    /// The area that is left below the law (J).
    fn area(&self) -> f64 {
        self.below() + 0.5 * self.strength * (self.critical - self.largest)
    }

    /// Whether the pair has let go.
    pub fn is_over(&self) -> bool {
        self.is_dropped || self.opening() >= self.critical
    }

    /// The unit direction of the force on the first vertex.
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// The opening (m): the length of the vector between the vertices, with the offset.
    pub fn opening(&self) -> f64 {
        self.apart.norm()
    }

    /// The energy that the pair has not yet taken (J). A pair that has let go has none but the error of its last step.
    pub fn left(&self) -> f64 {
        self.energy - self.work
    }

    /// The work of an opening that grows from the largest so far to `s` (J).
    fn beyond(&self, s: f64) -> f64 {
        let width = self.critical - self.largest;
        if width <= 0.0 {
            return 0.0;
        }
        let grown = s.min(self.critical) - self.largest;
        self.strength * grown * (1.0 - 0.5 * grown / width)
    }

    /// The slope of the unloading line (N/m).
    fn slope(&self) -> f64 {
        self.strength / self.largest
    }

    /// The force of a step (N) in which the opening along the direction changes to `s` (m).
    pub fn step_force(&self, s: f64) -> f64 {
        let opening = self.opening();
        if s <= opening {
            return self.slope() * s;
        }
        if s <= self.largest {
            return 0.5 * self.slope() * (opening + s);
        }
        (self.below() + self.beyond(s)) / (s - opening)
    }

    /// The slope of [`step_force`](Self::step_force) (N/m).
    pub(super) fn step_slope(&self, s: f64) -> f64 {
        let opening = self.opening();
        if s <= opening {
            return self.slope();
        }
        if s <= self.largest {
            return 0.5 * self.slope();
        }
        let width = self.critical - self.largest;
        let left = (self.critical - s).max(0.0);
        let force = if width > 0.0 {
            self.strength * left / width
        } else {
            0.0
        };
        (force - self.step_force(s)) / (s - opening)
    }

    /// The energy that the pair can give back (J).
    pub(super) fn stored(&self) -> f64 {
        let opening = self.opening();
        0.5 * self.slope() * opening * opening
    }

    /// The work of an opening that grows to the largest so far (J).
    fn below(&self) -> f64 {
        let opening = self.opening();
        0.5 * self.slope() * (self.largest - opening) * (self.largest + opening)
    }

    /// Ends a step with the force `force` (N) along the direction, in which the second vertex has moved by `change` (m)
    /// from the first.
    pub fn advance(&mut self, force: f64, change: &Vec3) {
        self.work += (self.direction * force + self.sideways).dot(change);
        self.apart += change;
        let opening = self.opening();
        if opening > self.largest {
            let width = self.critical - self.largest;
            let left = (self.critical - opening).max(0.0);
            self.strength = if width > 0.0 {
                self.strength * left / width
            } else {
                0.0
            };
            self.largest = opening;
        } else {
            let (slope, force) = (self.slope(), self.slope() * opening);
            let strength = force.max(self.floor);
            if strength < self.strength {
                (self.strength, self.largest) = (strength, strength / slope);
            }
        }
        self.sideways = Vec3::zeros();
        // The energy that is left fits below the law. If it does not reach beyond the largest opening, the force is smaller.
        let (left, below) = (self.left().max(0.0), self.below());
        self.critical = self.largest;
        if left > below && self.strength > 0.0 {
            self.critical += 2.0 * (left - below) / self.strength;
        } else if below > 0.0 {
            self.strength *= left / below;
        }
        self.across = self.slope();
        self.force = self.across * opening;
        if opening > 0.0 {
            self.direction = self.apart / opening;
        }
    }

    /// The opening along the direction that agrees with the law, where it is `free - response force` (m).
    pub(super) fn meet(&self, free: f64, response: f64) -> f64 {
        // Below the largest opening the law is linear.
        let (opening, slope) = (self.opening(), self.slope());
        let shrunk = free / (1.0 + response * slope);
        if shrunk <= opening {
            return shrunk;
        }
        let half = 0.5 * response * slope;
        let below = (free - half * opening) / (1.0 + half);
        if below <= self.largest || free <= self.largest {
            return below.min(self.largest);
        }
        // The first sign change. A law that falls linearly crosses at most once before it is zero.
        let off = |s: f64| s - free + response * self.step_force(s);
        let (mut low, mut high) = (self.largest, free);
        if self.critical < high && off(self.critical) >= 0.0 {
            high = self.critical;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if off(middle) < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// The force across the direction on the first vertex (N) after a change of the vector between the vertices (m).
    pub(super) fn sideways(&self, change: &Vec3) -> Vec3 {
        (change - self.direction * self.direction.dot(change)) * self.across
    }
}
