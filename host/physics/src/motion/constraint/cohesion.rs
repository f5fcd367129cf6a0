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
//! **Slackening.** A tip that moves on inside the edge leaves less of the edge closed. The pair then [loses](Cohesion::slacken)
//! strength, whatever its opening, and the energy that its law would still have taken.
//!
//! **Energy.** The force of a pair that opens further is the work of its law over the step divided by the change of the
//! opening. A pair that closes takes the force at the end of the step, which lets no oscillation last. After each step
//! `d_c` is chosen so that the area that is left below the law is the energy that the pair has not yet taken. The work of
//! a pair over its life is therefore its energy, whatever the steps, and even if a step was solved roughly. The last step
//! of a pair may err; [`Stepper::take_surplus`](crate::motion::Stepper::take_surplus) returns this error, for the next pair to make
//! good.
//!
//! **Paced pairs.** If a sheet is torn out of its plane, a bend moves with the tip from vertex to vertex. It takes up energy
//! and gives it back within an edge, so that a pair whose force falls evenly lets the force of the hands rise and fall. The
//! tip therefore [paces](Cohesion::pace) such a pair: while the flow of energy is short of the toughness, the pair opens without
//! a loss of force, as a spring would. The stiffness of the pair says where in the edge the tip is. With the fall `k1` of the
//! law above, which takes the energy from the first force `f`,
//!
//! ```text
//! k1 = f^2 / (2 energy)        T(s) / s = k1 (1 - p) / p        p = s / d_c on the line that falls
//! ```
//!
//! the tip has passed the part `p` of the edge. The work of such a pair is that of its path; it need not be its energy.

use super::law::Law;
use crate::Vec3;

/// The length of the offset, as a fraction of the opening at which the force is lost.
const OFFSET: f64 = 0.05;
/// The largest opening at which a paced pair has lost its force on the line that falls, in lengths of its edge.
const WIDEST: f64 = 4.0 / 3.0;
/// The rounding error of the energy that a pair gives back, as a fraction of its energy.
const ROUNDING: f64 = 1e-3;
/// Bisections for the opening that meets the law.
const BISECTIONS: usize = 60;

/// Two vertices that let each other go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cohesion {
    /// The vertices.
    pub nodes: [u32; 2],
    /// The vector from the first vertex to the second, plus the offset (m).
    pub apart: Vec3,
    /// The first force (N).
    pub first: f64,
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
    /// By how much the force grows with the opening beyond the largest (N/m); negative if the force falls.
    growth: f64,
    /// The fall `k1` of a paced pair (N/m).
    paced: Option<f64>,
    /// The unit direction of the force on the first vertex at the start of the step.
    direction: Vec3,
    /// The stiffness across the direction (N/m), and the force across it on the first vertex at the end of the step (N).
    across: f64,
    sideways: Vec3,
    /// Whether the pair lets go at the end of the step, whatever its opening.
    is_dropped: bool,
}

impl Cohesion {
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
            largest,
            force: first,
            work: 0.0,
            energy,
            strength: first,
            growth: -first / (critical - largest),
            paced: None,
            direction: force / first,
            across: first / largest,
            sideways: Vec3::zeros(),
            is_dropped: false,
        })
    }

    /// The pair that a tip [paces](Self::pace) along an edge of this `length` (m).
    ///
    /// The first force of a short edge may be several times that of the hands: it is then the force of bent triangles beside
    /// the tip, which vanishes as the sheet moves a little. The fall is therefore at most that of a pair whose force is lost at
    /// an opening of 4/3 lengths.
    #[must_use]
    pub fn paced(self, length: f64) -> Self {
        let lasting = 2.0 * self.energy / (WIDEST * length);
        let fall = self.first.min(lasting).powi(2) / (2.0 * self.energy);
        Self {
            growth: -fall,
            paced: Some(fall),
            ..self
        }
    }

    /// Whether a tip paces the pair.
    pub fn is_paced(&self) -> bool {
        self.paced.is_some()
    }

    /// Lets a paced pair lose its force `pace` times as fast as by its law, in the next step. At a negative pace the force
    /// grows with the opening, at most as that of a spring. Other pairs have a pace of their own.
    pub fn pace(&mut self, pace: f64) {
        if let Some(fall) = self.paced {
            self.growth = (-fall * pace).min(self.slope());
        }
    }

    /// The part of the edge that the tip has passed.
    fn passed(&self, fall: f64) -> f64 {
        fall / (fall + self.slope())
    }

    /// Lets the tip move on by the part `part` of the edge. The strength falls, at most to zero: then the pair has let go.
    /// The opening at which the force is lost stays. Returns by how much the energy of the pair falls (J); that of a paced
    /// pair stays.
    pub fn slacken(&mut self, part: f64) -> f64 {
        // A value that is not a number counts as zero.
        let part = part.max(0.0);
        let (area, strength) = (self.area(), self.strength);
        if let Some(fall) = self.paced {
            let passed = (self.passed(fall) + part).min(1.0);
            self.strength = self.largest * fall * (1.0 - passed) / passed;
        } else {
            self.strength -= (part * self.first).min(strength);
        }
        self.is_dropped |= self.strength <= 0.0;
        if self.strength > 0.0 {
            self.growth *= self.strength / strength;
        }
        self.across = self.slope();
        self.force = self.across * self.opening();
        if self.is_paced() {
            return 0.0;
        }
        let lost = area - self.area();
        self.energy -= lost;
        lost
    }

    /// The force at the largest opening (N).
    pub fn strength(&self) -> f64 {
        self.strength
    }

    /// The opening at which the force is lost (m); infinite if the force does not fall.
    pub fn critical(&self) -> f64 {
        if self.growth < 0.0 {
            self.largest - self.strength / self.growth
        } else {
            f64::INFINITY
        }
    }

    /// The area that is left below the law (J).
    fn area(&self) -> f64 {
        self.below() + 0.5 * self.strength * (self.critical() - self.largest)
    }

    /// The force at an opening `s` beyond the largest (N).
    fn force_beyond(&self, s: f64) -> f64 {
        if s < self.critical() {
            self.strength + self.growth * (s - self.largest)
        } else {
            0.0
        }
    }

    /// Whether the pair was let go before its law did.
    pub(crate) fn is_dropped(&self) -> bool {
        self.is_dropped
    }

    /// Whether the pair has let go.
    pub fn is_over(&self) -> bool {
        self.is_dropped || self.opening() >= self.critical()
    }

    /// The unit direction of the force on the first vertex.
    pub fn direction(&self) -> Vec3 {
        self.direction
    }

    /// The opening (m): the length of the vector between the vertices, with the offset.
    pub fn opening(&self) -> f64 {
        self.apart.norm()
    }

    /// The energy that the pair has not yet taken (J). A pair that has let go has none but the error of its last step, and
    /// that by which the work of a paced pair differs from its energy.
    pub fn left(&self) -> f64 {
        self.energy - self.work
    }

    /// The energy of the part of the edge that the tip has still to pass (J).
    pub fn ahead(&self) -> f64 {
        self.paced
            .map_or(self.left(), |fall| self.energy * (1.0 - self.passed(fall)))
    }

    /// The work of an opening that grows from the largest so far to `s` (J).
    fn beyond(&self, s: f64) -> f64 {
        let grown = s.min(self.critical()) - self.largest;
        if grown <= 0.0 {
            return 0.0;
        }
        grown * (self.strength + 0.5 * self.growth * grown)
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
            self.strength = self.force_beyond(opening);
            self.largest = opening;
        }
        self.sideways = Vec3::zeros();
        if let Some(fall) = self.paced {
            self.growth = -fall;
            self.is_dropped |= self.strength <= 0.0;
        } else {
            self.fit();
        }
        self.across = self.slope();
        self.force = self.across * opening;
        if opening > 0.0 {
            self.direction = self.apart / opening;
        }
    }

    /// Fits the law to the energy that is left. If this energy does not reach beyond the largest opening, the force is smaller.
    fn fit(&mut self) {
        let (left, below) = (self.left().max(0.0), self.below());
        self.growth = f64::NEG_INFINITY;
        if left > below && self.strength > 0.0 {
            self.growth = -self.strength * self.strength / (2.0 * (left - below));
        } else if below > 0.0 {
            self.strength *= left / below;
        }
    }
}

impl Law for Cohesion {
    fn nodes(&self) -> [u32; 2] {
        self.nodes
    }

    fn gradient(&self) -> Vec3 {
        self.direction
    }

    fn opening(&self) -> f64 {
        self.opening()
    }

    fn value(&self, opening: f64) -> f64 {
        self.step_force(opening)
    }

    fn tangent(&self, s: f64) -> f64 {
        let opening = self.opening();
        if s <= opening {
            return self.slope();
        }
        if s <= self.largest {
            return 0.5 * self.slope();
        }
        (self.force_beyond(s) - self.step_force(s)) / (s - opening)
    }

    fn stiffness(&self) -> f64 {
        self.slope()
    }

    fn across(&self) -> f64 {
        self.across
    }

    fn energy(&self) -> f64 {
        let opening = self.opening();
        0.5 * self.slope() * opening * opening
    }

    fn scale(&self) -> f64 {
        self.first
    }

    fn meet(&self, free: f64, response: f64) -> f64 {
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
        let critical = self.critical();
        if critical < high && off(critical) >= 0.0 {
            high = critical;
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

    fn force(&self) -> f64 {
        self.force
    }

    fn set_force(&mut self, force: f64) {
        self.force = force;
    }

    fn pull(&self) -> Vec3 {
        self.direction * self.force + self.sideways
    }

    fn shear(&mut self, change: &Vec3) {
        self.sideways = self.sideways(change);
    }

    fn may_give(&self, given: f64) -> bool {
        // The comparison is false for a value that is not a number.
        given <= self.energy() + ROUNDING * self.energy
    }

    fn drop_force(&mut self) {
        (self.force, self.is_dropped) = (0.0, true);
    }

    fn work(&self) -> f64 {
        self.work
    }

    fn accept(&mut self, change: &Vec3) {
        self.advance(self.force, change);
    }

    fn is_over(&self) -> bool {
        self.is_over()
    }
}
