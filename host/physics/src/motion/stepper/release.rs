//! Pairs of vertices that let each other go: the cohesive forces behind a tip that has moved on.
//!
//! A pair first keeps the force that its two sides exerted on each other, and loses it with the largest opening so far
//! (the linear law of G. T. Camacho and M. Ortiz, "Computational modelling of impact damage in brittle materials", 1996,
//! with unloading to the origin):
//!
//! ```text
//! T(s) = f (1 - s / d_c)                            where the opening s is the largest so far, s_m
//! T(s) = f (1 - s_m / d_c) (s + o) / (s_m + o)      below s_m
//! ```
//!
//! The opening counts along the direction of the first force, and along the line between the two vertices once they are
//! apart: a sheet that is torn out of its plane turns meanwhile. The offset `o` is a ten-thousandth of `d_c`: a pair that
//! has not opened would otherwise be rigid.
//!
//! **Energy.** The force of a pair in a step is the work of its law over the step divided by the change of the opening (a
//! discrete gradient: O. Gonzalez, "Time integration and discrete Hamiltonian systems", 1996). The work of a pair over
//! its life is then the area below its law, `f d_c / 2`, whatever the steps.
//!
//! **Solution.** The forces enter the equation of the step as loads. Its solution and the response of the openings to the
//! forces give a small nonlinear system for the forces, with one unknown a pair, which has a solution for any stiffness of
//! a pair. After a few rounds the forces and the openings agree. A law that falls faster than the body unloads has
//! several solutions. The first one is taken that a growing opening meets.

use super::{Limits, Stepper, StepperReport};
use crate::Vec3;
use crate::body::Body;
use crate::lanes::{Node, Real, to_node, to_vec};

/// The offset of the unloading line, as a fraction of `d_c`.
const OFFSET: f64 = 1e-4;
/// Most rounds of forces and openings in a step, and iterations of a round.
const MOST_ROUNDS: usize = 16;
const ROUND: usize = 2;
/// The opening from which on the force acts along the opening, as a fraction of the opening at which it is lost.
const TURNS: f64 = 0.01;
/// A turn by less than the root of this number (rad) is left for a later step, so that responses need not be computed.
const SAME: f64 = 1e-4;
/// The largest force with which the sides of a pair press on each other, as a multiple of its first force.
const MOST_PRESSED: f64 = 10.0;
/// Sweeps over the pairs, and bisections for each.
const SWEEPS: usize = 30;
const BISECTIONS: usize = 60;

/// Two vertices that let each other go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// The vertices.
    pub nodes: [u32; 2],
    /// The unit direction of the force on the first vertex, towards the second.
    pub direction: Vec3,
    /// The first force (N).
    pub first: f64,
    /// The opening at which the force is lost (m).
    pub critical: f64,
    /// The opening along `direction` (m).
    pub opening: f64,
    /// The largest opening so far (m).
    pub largest: f64,
    /// The force at the end of the last step (N).
    pub force: f64,
    /// The work that the pair has taken from the body so far (J).
    pub work: f64,
    /// The distance of the vertices at the end of the step (m), once the direction follows them; 0 before.
    turned: f64,
    /// The area below the law (J): `first critical / 2`.
    energy: f64,
}

impl Pair {
    /// A pair that keeps the force `force` (N) on its first vertex, and takes `energy` (J) until it has let go. `None` if
    /// there is no force, or no energy: such a pair lets go at once.
    pub fn new(nodes: [u32; 2], force: &Vec3, energy: f64) -> Option<Self> {
        let first = force.norm();
        let critical = 2.0 * energy / first;
        let is_finite = critical.is_finite() && first.is_finite();
        (is_finite && critical > 0.0 && first > 0.0).then(|| Self {
            nodes,
            direction: force / first,
            first,
            critical,
            opening: 0.0,
            largest: 0.0,
            force: first,
            work: 0.0,
            turned: 0.0,
            energy,
        })
    }

    /// Whether the pair has let go.
    pub fn is_over(&self) -> bool {
        self.largest >= self.critical
    }

    /// The work of a growing opening from 0 to `s` (J).
    fn area(&self, s: f64) -> f64 {
        let s = s.min(self.critical);
        self.first * (s - 0.5 * s * s / self.critical)
    }

    /// The slope of the unloading line (N/m).
    fn slope(&self) -> f64 {
        let left = (1.0 - self.largest / self.critical).max(0.0);
        self.first * left / (self.largest + OFFSET * self.critical)
    }

    /// The mean force (N) over a change of the opening to `s` (m).
    pub fn mean_force(&self, s: f64) -> f64 {
        let (slope, offset) = (self.slope(), OFFSET * self.critical);
        if s <= self.largest {
            return slope * (0.5 * (self.opening + s) + offset);
        }
        let ends = [self.largest, self.opening].map(|s| (s + offset) * (s + offset));
        let below = 0.5 * slope * (ends[0] - ends[1]);
        (below + self.area(s) - self.area(self.largest)) / (s - self.opening)
    }

    /// Ends a step with the mean force `force` (N) over which the opening has changed by `change` (m).
    pub fn advance(&mut self, force: f64, change: f64) {
        self.work += force * change;
        self.opening += change;
        self.largest = self.largest.max(self.opening);
        // The force at the start of the next step.
        self.force = self.slope() * (self.opening + OFFSET * self.critical);
        if self.turned > self.largest {
            self.widen();
        }
    }

    /// Takes the distance of the vertices for the opening. Across the force they have parted without work, so the law is
    /// drawn anew from the present force, with the energy that the pair has still to take.
    fn widen(&mut self) {
        let left = self.energy - self.area(self.largest);
        let (opening, force) = (self.turned, self.force);
        let critical = opening + 2.0 * left / force;
        let first = force * critical / (critical - opening);
        if left > 0.0 && force > 0.0 && first.is_finite() {
            self.energy = left + 0.5 * (first + force) * opening;
            (self.first, self.critical) = (first, critical);
            (self.opening, self.largest) = (opening, opening);
        }
    }

    /// Turns the direction of the force to that of the opening `apart` (m) at the end of a step, before the step
    /// [ends](Self::advance). Returns whether it has turned.
    fn turn(&mut self, apart: &Vec3) -> bool {
        let size = apart.norm();
        if size < TURNS * self.critical {
            return false;
        }
        self.turned = size;
        let direction = apart / size;
        let is_other = (direction - self.direction).norm_squared() > SAME;
        if is_other {
            self.direction = direction;
        }
        is_other
    }

    /// The opening that agrees with the law, where the opening is `free - response force`.
    fn meet(&self, free: f64, response: f64) -> f64 {
        // Below the largest opening the law is linear.
        let (slope, offset) = (self.slope(), OFFSET * self.critical);
        let below = free - response * slope * (0.5 * self.opening + offset);
        let below = below / (1.0 + 0.5 * response * slope);
        if below <= self.largest || free <= self.largest {
            return below.min(self.largest);
        }
        // The first sign change. A law that falls linearly crosses at most once before it is zero.
        let off = |s: f64| s - free + response * self.mean_force(s);
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
}

/// The pairs of a body, with the responses of their openings.
#[derive(Debug, Default)]
pub(super) struct Pairs {
    list: Vec<Pair>,
    most: usize,
    /// The response of each opening to each force (m/N), by rows of `most`; those that are not known are computed first.
    responses: Vec<f64>,
    are_known: bool,
    /// Forces to be solved for (N), and openings as they would be without a change of the forces (m).
    forces: Vec<f64>,
    openings: Vec<f64>,
    /// Changes of the forces in the last round (N).
    changes: Vec<f64>,
}

impl Pairs {
    /// Room for `most` pairs.
    pub(super) fn new(most: usize) -> Self {
        Self {
            list: Vec::with_capacity(most),
            most,
            responses: vec![0.0; most * most],
            are_known: false,
            forces: vec![0.0; most],
            openings: vec![0.0; most],
            changes: vec![0.0; most],
        }
    }

    /// Notes that the matrix or its factor has changed.
    pub(super) fn forget_responses(&mut self) {
        self.are_known = false;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Solves for the forces that agree with the openings: the laws of the pairs, and the responses (Gauss and Seidel's
    /// method, as for contacts). Returns the largest change of a force (N).
    fn agree(&mut self) -> f64 {
        let count = self.list.len();
        for (force, pair) in self.forces.iter_mut().zip(&self.list) {
            *force = pair.force;
        }
        for _ in 0..SWEEPS {
            let mut changed = 0.0_f64;
            for row in 0..count {
                let responses = &self.responses[row * self.most..row * self.most + count];
                let mut free = self.openings[row];
                for (other, response) in responses.iter().enumerate() {
                    if other != row {
                        free -= response * (self.forces[other] - self.list[other].force);
                    }
                }
                let pair = &self.list[row];
                free += responses[row] * pair.force;
                let opening = pair.meet(free, responses[row]);
                let force = pair.mean_force(opening).max(-MOST_PRESSED * pair.first);
                changed = changed.max((force - self.forces[row]).abs());
                self.forces[row] = force;
            }
            if changed == 0.0 {
                break;
            }
        }
        let pairs = self.list.iter().zip(&self.forces);
        pairs.fold(0.0, |most, (pair, force)| {
            most.max((force - pair.force).abs())
        })
    }
}

impl<T: Real> Stepper<T> {
    /// Room for `most` pairs of vertices that let each other go at the same time. Pairs that there are vanish.
    pub fn reserve_pairs(&mut self, most: usize) {
        self.pairs = Pairs::new(most);
    }

    /// The pairs that have not let go.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs.list
    }

    /// Forgets all pairs: they let go at once.
    pub fn clear_pairs(&mut self) {
        self.pairs.list.clear();
        self.pairs.forget_responses();
    }

    /// Adds a pair. Returns whether there was [room](Self::reserve_pairs).
    pub fn add_pair(&mut self, pair: Pair) -> bool {
        let has_room = self.pairs.list.len() < self.pairs.most;
        if has_room {
            self.pairs.list.push(pair);
            self.pairs.forget_responses();
            self.sleep.wake();
        }
        has_room
    }

    /// The force (N) that the second of two vertices at one place has to exert on the first so that they keep moving
    /// together, after the edit that parted them has been [settled](Self::settle): elastic forces and loads, and the
    /// common acceleration.
    pub fn force_between(&self, body: &Body, nodes: [u32; 2]) -> Vec3 {
        let acting = nodes.map(|node| {
            let node = node as usize;
            let elastic = to_vec(&self.force[self.place[node] as usize]);
            elastic + body.model.external[node] * body.model.load_factor
        });
        let mass = nodes.map(|node| body.model.mass[node as usize]);
        (acting[0] + acting[1]) * (mass[0] / (mass[0] + mass[1])) - acting[0]
    }

    /// Adds `force` (N) of a pair to the residual.
    fn load_pair(&mut self, pair: &Pair, force: f64) {
        for (node, sign) in pair.nodes.into_iter().zip([1.0, -1.0]) {
            let r = &mut self.residual[self.place[node as usize] as usize];
            let load: Node<T> = to_node(&(pair.direction * (sign * force)));
            for i in 0..4 {
                r[i] += load[i];
            }
        }
    }

    /// Adds the forces of all pairs to the residual.
    pub(super) fn add_pairs(&mut self) {
        for at in 0..self.pairs.list.len() {
            let pair = self.pairs.list[at];
            self.load_pair(&pair, pair.force);
        }
    }

    /// Gives the pairs the forces of their laws at the openings of the guess. The solution then finds the forces near
    /// those that agree with it, and few iterations correct them.
    pub(super) fn foresee_pairs(&mut self) {
        for at in 0..self.pairs.list.len() {
            let pair = &self.pairs.list[at];
            let opening = pair.opening + self.opens(pair, |place| to_vec(&self.u[place]));
            let force = pair.mean_force(opening).max(-MOST_PRESSED * pair.first);
            if force.is_finite() {
                self.pairs.list[at].force = force;
            }
        }
    }

    /// The change of the opening of a pair by the displacements `u` (m).
    fn opens(&self, pair: &Pair, u: impl Fn(usize) -> Vec3) -> f64 {
        let [a, b] = pair.nodes.map(|node| u(self.place[node as usize] as usize));
        pair.direction.dot(&(b - a))
    }

    /// Computes the responses of the openings, with the factor in place of the matrix.
    fn respond(&mut self) {
        if self.pairs.are_known {
            return;
        }
        let (count, most) = (self.pairs.list.len(), self.pairs.most);
        for column in 0..count {
            self.z.fill([0.0; 4]);
            let pair = self.pairs.list[column];
            for (node, sign) in pair.nodes.into_iter().zip([-1.0, 1.0]) {
                let place = self.place[node as usize] as usize;
                if place < self.free {
                    self.z[place] = to_node(&(pair.direction * sign));
                }
            }
            self.solve_factor();
            for row in 0..count {
                let response = self.opens(&self.pairs.list[row], |place| {
                    self.z.get(place).map_or_else(Vec3::zeros, to_vec)
                });
                self.pairs.responses[row * most + column] = response;
            }
        }
        self.pairs.are_known = true;
    }

    /// Solves the equation of the step together with the forces of the pairs. A round of few iterations is followed by the
    /// forces that agree with its openings: an exact solution for forces that still change would be of no use.
    pub(super) fn let_go(
        &mut self,
        factors: (f64, f64),
        limits: Limits,
        out_of_time: &mut impl FnMut() -> bool,
    ) -> StepperReport {
        self.respond();
        let few = |done: usize| (limits.max_iterations - done).min(ROUND);
        let first = Limits {
            max_iterations: few(0),
            ..limits
        };
        let mut report = self.iterate(factors, first, out_of_time);
        for round in 0..MOST_ROUNDS {
            for at in 0..self.pairs.list.len() {
                let pair = &self.pairs.list[at];
                let opening = pair.opening + self.opens(pair, |place| to_vec(&self.u[place]));
                self.pairs.openings[at] = opening;
            }
            let change = self.pairs.agree();
            let agrees = change <= limits.goal || change.is_nan();
            let left = limits.max_iterations - report.iterations;
            if agrees && (report.converged || left == 0) {
                break;
            }
            if !agrees {
                for at in 0..self.pairs.list.len() {
                    let (pair, force) = (self.pairs.list[at], self.pairs.forces[at]);
                    self.load_pair(&pair, force - pair.force);
                    self.pairs.changes[at] = force - pair.force;
                    self.pairs.list[at].force = force;
                }
            }
            let is_last = agrees || round + 1 == MOST_ROUNDS;
            let limits = Limits {
                start: limits.goal,
                max_iterations: if is_last {
                    left
                } else {
                    few(report.iterations)
                },
                ..limits
            };
            let was_solved = report.converged;
            let again = self.iterate(factors, limits, out_of_time);
            report.iterations += again.iterations;
            report.residual = again.residual;
            report.converged = again.converged;
            // Otherwise the openings have changed by the residual, too.
            if !agrees && was_solved && report.converged {
                self.learn_responses();
            }
        }
        report
    }

    /// Corrects the responses by the last round. The factor is older than the matrix: an opening may respond more than
    /// the factor says, and rounds with too small a response would overshoot more each time.
    fn learn_responses(&mut self) {
        let most = self.pairs.most;
        for at in 0..self.pairs.list.len() {
            let pair = &self.pairs.list[at];
            let opening = pair.opening + self.opens(pair, |place| to_vec(&self.u[place]));
            let found = (self.pairs.openings[at] - opening) / self.pairs.changes[at];
            let response = &mut self.pairs.responses[at * most + at];
            // The comparison drops a change of zero.
            if found > *response && found.is_finite() {
                *response = found;
            }
        }
    }

    /// The energy (J) that pairs give back in the step.
    pub(super) fn given_back(&self, body: &Body) -> f64 {
        let pairs = self.pairs.list.iter();
        let work = pairs.map(|pair| (-pair.force * moved_by(body, pair)).max(0.0));
        work.sum()
    }

    /// Ends the step for the pairs, and forgets those that have let go. Returns the work that they took (J).
    pub(super) fn open_pairs(&mut self, body: &Body) -> f64 {
        let mut work = 0.0;
        let mut has_turned = false;
        for at in 0..self.pairs.list.len() {
            let change = moved_by(body, &self.pairs.list[at]);
            let pair = &mut self.pairs.list[at];
            work += pair.force * change;
            let [a, b] = pair.nodes.map(|node| self.at[node as usize]);
            has_turned |= pair.turn(&(b - a));
            pair.advance(pair.force, change);
        }
        if has_turned {
            self.pairs.forget_responses();
        }
        let count = self.pairs.list.len();
        self.pairs.list.retain(|pair| !pair.is_over());
        if self.pairs.list.len() < count {
            self.pairs.forget_responses();
        }
        work
    }
}

/// The change of the opening of a pair over the step (m).
fn moved_by(body: &Body, pair: &Pair) -> f64 {
    let moved = |node: u32| body.state.displacement[node as usize];
    let [a, b] = pair.nodes.map(moved);
    pair.direction.dot(&(b - a))
}
