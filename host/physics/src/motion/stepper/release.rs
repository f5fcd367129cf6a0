//! Pairs of vertices that let each other go: the cohesive forces behind a tip that has moved on.
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
//! direction. The force `T(s) / s` per length across the vector is that of a spring. The spring is part of the matrix of
//! the step: a light vertex that moves out of the plane would swing from step to step otherwise.
//!
//! **Weakening.** The first force may contain bending forces of short edges beside the tip, which balance each other and
//! vanish once the sheet moves a little. A [weakening](Pair::weakening) pair forgets such a force: where it unloads, its
//! strength follows the force.
//!
//! **Energy.** The force of a pair that opens further is the work of its law over the step divided by the change of the
//! opening. A pair that closes takes the force at the end of the step, which lets no oscillation last. After each step
//! `d_c` is chosen so that the area that is left below the law is the energy that the pair has not yet taken. The work of
//! a pair over its life is therefore its energy, whatever the steps, and even if a step was solved roughly. The last step
//! of a pair may err; [`Stepper::take_surplus`] returns this error, for the next pair to make good.
//!
//! **Solution.** The forces enter the equation of the step as loads. Its solution and the response of the openings to the
//! forces give a small nonlinear system for the forces, with one unknown a pair, which has a solution for any stiffness of
//! a pair. After a few rounds the forces and the openings agree. A law that falls faster than the body unloads has
//! several solutions. The first one is taken that a growing opening meets.
//! The compliance of the openings, with the factor in place of the matrix, foresees the forces from the residual of the
//! guess, and holds the springs in the preconditioner.

use super::compliance::Compliance;
use super::{Limits, Stepper, StepperReport};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::lanes::{Node, to_node, to_vec};

/// The length of the offset, as a fraction of the opening at which the force is lost.
const OFFSET: f64 = 0.05;
/// Most rounds of forces and openings in a step, and iterations of a round.
const MOST_ROUNDS: usize = 16;
const ROUND: usize = 2;
/// The least cosine between the changes of the forces and the error of the foreseen openings with which the responses are
/// corrected.
const LEAST_SECANT: f64 = 1e-6;
/// The rounding error of the energy that a pair gives back, as a fraction of its energy.
const ROUNDING: f64 = 1e-3;
/// Sweeps over the pairs, and bisections for each.
const SWEEPS: usize = 30;
const BISECTIONS: usize = 60;
/// Most steps of Newton's method after the sweeps, and the change of a force that ends them, relative to the force.
const MOST_NEWTON: usize = 20;
const ENOUGH: f64 = 1e-12;

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
    floor: f64,
    /// The unit direction of the force on the first vertex at the start of the step.
    direction: Vec3,
    /// The stiffness across the direction (N/m), and the force across it on the first vertex at the end of the step (N).
    across: f64,
    sideways: Vec3,
    /// Whether the pair lets go at the end of the step, whatever its opening.
    is_dropped: bool,
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
    fn step_slope(&self, s: f64) -> f64 {
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
    fn stored(&self) -> f64 {
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
    fn sideways(&self, change: &Vec3) -> Vec3 {
        (change - self.direction * self.direction.dot(change)) * self.across
    }
}

/// The pairs of a body, with the responses of their openings.
#[derive(Debug, Default)]
pub(super) struct Pairs {
    list: Vec<Pair>,
    most: usize,
    /// The columns of the pairs; those that are not known are computed at the next step.
    compliance: Compliance,
    /// The response of each opening to each force (m/N), by rows of `most`.
    responses: Vec<f64>,
    /// Changes of openings (m).
    changed: Vec<Vec3>,
    /// Forces to be solved for (N), and openings as they would be without a change of the forces (m).
    forces: Vec<f64>,
    openings: Vec<f64>,
    /// Openings with the forces (m), their changes, and the equations of the changes, by rows of `most`.
    found: Vec<f64>,
    shifts: Vec<f64>,
    equations: Vec<f64>,
    /// Changes of the forces in the last round (N).
    changes: Vec<f64>,
    /// The energy that pairs took too little in their last steps (J).
    surplus: f64,
}

impl Pairs {
    /// Room for `most` pairs of a body with free places below `places`.
    pub(super) fn new(most: usize, places: usize) -> Self {
        Self {
            list: Vec::with_capacity(most),
            most,
            compliance: Compliance::new(most, places),
            responses: vec![0.0; most * most],
            changed: vec![Vec3::zeros(); most],
            forces: vec![0.0; most],
            openings: vec![0.0; most],
            found: vec![0.0; most],
            shifts: vec![0.0; most],
            equations: vec![0.0; most * most],
            changes: vec![0.0; most],
            surplus: 0.0,
        }
    }

    /// Notes that the matrix or its factor has changed.
    pub(super) fn forget_responses(&mut self) {
        self.compliance.forget();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Solves for the forces that agree with the openings: the laws of the pairs, and the responses (Gauss and Seidel's
    /// method, as for contacts, and then Newton's). Returns the largest change of a force (N).
    fn agree(&mut self) -> f64 {
        let count = self.list.len();
        for (force, pair) in self.forces.iter_mut().zip(&self.list) {
            *force = pair.force;
        }
        let mut is_exact = false;
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
                let force = pair.step_force(opening);
                changed = changed.max((force - self.forces[row]).abs());
                self.forces[row] = force;
                self.found[row] = opening;
            }
            is_exact = changed == 0.0;
            if is_exact {
                break;
            }
        }
        if !is_exact {
            self.sharpen();
        }
        let pairs = self.list.iter().zip(&self.forces);
        pairs.fold(0.0, |most, (pair, force)| {
            most.max((force - pair.force).abs())
        })
    }
}

impl Pairs {
    /// Newton's method from the openings of the sweeps. Two pairs beside each other respond nearly alike, and thousands of
    /// sweeps would be needed then. The forces stay those of the sweeps where the method does not converge.
    fn sharpen(&mut self) {
        let (count, most) = (self.list.len(), self.most);
        for _ in 0..MOST_NEWTON {
            for row in 0..count {
                let mut off = self.found[row] - self.openings[row];
                for (column, pair) in self.list.iter().enumerate() {
                    let (response, opening) =
                        (self.responses[row * most + column], self.found[column]);
                    off += response * (pair.step_force(opening) - pair.force);
                    let own = if row == column { 1.0 } else { 0.0 };
                    self.equations[row * most + column] = own + response * pair.step_slope(opening);
                }
                self.shifts[row] = -off;
            }
            eliminate(&mut self.equations, most, &mut self.shifts[..count]);
            let mut is_done = true;
            for (pair, (found, shift)) in self
                .list
                .iter()
                .zip(self.found.iter_mut().zip(&self.shifts))
            {
                let before = pair.step_force(*found);
                *found += shift;
                let after = pair.step_force(*found);
                // The comparison is false for a value that is not a number.
                is_done &= (after - before).abs() <= ENOUGH * pair.first.max(after.abs());
            }
            if is_done {
                for (force, (pair, found)) in self
                    .forces
                    .iter_mut()
                    .zip(self.list.iter().zip(&self.found))
                {
                    *force = pair.step_force(*found);
                }
                return;
            }
        }
    }
}

/// Solves a dense system in place, with rows of `stride` numbers, by Gaussian elimination with row exchanges (Golub and
/// Van Loan, "Matrix computations", section 3.4). A singular matrix gives values that are not finite.
fn eliminate(matrix: &mut [f64], stride: usize, values: &mut [f64]) {
    let count = values.len();
    for step in 0..count {
        let size = |row: usize, matrix: &[f64]| matrix[row * stride + step].abs();
        let best = (step..count).fold(step, |best, row| {
            if size(row, matrix) > size(best, matrix) {
                row
            } else {
                best
            }
        });
        if best != step {
            for column in 0..count {
                matrix.swap(step * stride + column, best * stride + column);
            }
            values.swap(step, best);
        }
        for row in step + 1..count {
            let factor = matrix[row * stride + step] / matrix[step * stride + step];
            for column in step..count {
                matrix[row * stride + column] -= factor * matrix[step * stride + column];
            }
            values[row] -= factor * values[step];
        }
    }
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count)
            .map(|at| matrix[row * stride + at] * values[at])
            .sum();
        values[row] = (values[row] - known) / matrix[row * stride + row];
    }
}

impl<T: Precision> Stepper<T> {
    /// Room for `most` pairs of vertices that let each other go at the same time. Pairs that there are vanish.
    pub fn reserve_pairs(&mut self, most: usize) {
        self.pairs = Pairs::new(most, self.held);
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

    /// The energy (J) that the pairs that have let go since the last [`take_surplus`](Self::take_surplus) took too little
    /// (positive) or too much (negative) in their last steps.
    pub fn surplus(&self) -> f64 {
        self.pairs.surplus
    }

    /// Returns the [surplus](Self::surplus), and begins anew.
    pub fn take_surplus(&mut self) -> f64 {
        core::mem::take(&mut self.pairs.surplus)
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

    /// By how much (m/N) the distance of two vertices along a unit direction grows where a force that holds them together
    /// falls. The value is that of the factor, for one step.
    pub fn response_between(&mut self, nodes: [u32; 2], direction: &Vec3) -> f64 {
        self.push_apart(nodes, direction);
        let [a, b] = nodes.map(|node| self.responded(node));
        direction.dot(&(b - a))
    }

    /// Solves, in `z`, for the displacements under a unit force that parts two vertices.
    fn push_apart(&mut self, nodes: [u32; 2], direction: &Vec3) {
        self.z.fill([0.0; 4]);
        for (node, sign) in nodes.into_iter().zip([-1.0, 1.0]) {
            let place = self.place[node as usize] as usize;
            if place < self.free {
                self.z[place] = to_node(&(direction * sign));
            }
        }
        self.solve_factor();
    }

    /// The displacement of a vertex in `z`.
    fn responded(&self, node: u32) -> Vec3 {
        let place = self.place[node as usize] as usize;
        self.z.get(place).map_or_else(Vec3::zeros, to_vec)
    }

    /// Adds the force `force` (N) on the first vertex of a pair, and the opposite one on the second, to the residual.
    fn load_pair(&mut self, pair: &Pair, force: &Vec3) {
        for (node, sign) in pair.nodes.into_iter().zip([1.0, -1.0]) {
            let r = &mut self.residual[self.place[node as usize] as usize];
            let load: Node<T> = to_node(&(force * sign));
            for i in 0..4 {
                r[i] += load[i];
            }
        }
    }

    /// Adds the forces of all pairs to the residual.
    pub(super) fn add_pairs(&mut self) {
        for at in 0..self.pairs.list.len() {
            let pair = self.pairs.list[at];
            self.load_pair(&pair, &(pair.direction * pair.force + pair.sideways));
        }
    }

    /// Takes the forces of the springs of all pairs over the displacements `u` from the residual.
    pub(super) fn load_springs(&mut self) {
        for at in 0..self.pairs.list.len() {
            let pair = self.pairs.list[at];
            let change = self.parts(&pair, |place| to_vec(&self.u[place]));
            self.load_pair(&pair, &pair.sideways(&change));
        }
    }

    /// Adds the product of the springs of all pairs with `p` to `q`.
    pub(super) fn add_springs(&mut self) {
        for pair in &self.pairs.list {
            let places = pair.nodes.map(|node| self.place[node as usize] as usize);
            let [a, b] = places.map(|place| to_vec(&self.p[place]));
            let force = pair.sideways(&(b - a));
            for (place, sign) in places.into_iter().zip([-1.0, 1.0]) {
                let load: Node<T> = to_node(&(force * sign));
                for i in 0..4 {
                    self.q[place][i] += load[i];
                }
            }
        }
    }

    /// Gives the pairs the forces of their laws at the openings of the guess.
    pub(super) fn follow_pairs(&mut self) {
        for at in 0..self.pairs.list.len() {
            let pair = &self.pairs.list[at];
            let opening = pair.opening() + self.opens(pair, |place| to_vec(&self.u[place]));
            let force = pair.step_force(opening);
            if force.is_finite() {
                self.pairs.list[at].force = force;
            }
        }
    }

    /// Gives the pairs the forces that agree with the openings of the solution, as far as the factor foresees the
    /// solution from the residual of the guess. Few iterations correct these forces.
    pub(super) fn foresee_pairs(&mut self) {
        if self.pairs.is_empty() {
            return;
        }
        let mut changed = core::mem::take(&mut self.pairs.changed);
        let residual = &self.residual[..self.free];
        self.pairs.compliance.foresee(residual, &mut changed);
        for (at, change) in changed.iter().enumerate().take(self.pairs.list.len()) {
            let pair = &self.pairs.list[at];
            let guess = self.opens(pair, |place| to_vec(&self.u[place]));
            self.pairs.openings[at] = pair.opening() + guess + pair.direction.dot(change);
        }
        self.pairs.changed = changed;
        self.pairs.agree();
        if self.pairs.forces.iter().all(|force| force.is_finite()) {
            self.take_forces();
        }
    }

    /// Gives the pairs the forces that were solved for, and changes the residual by them.
    fn take_forces(&mut self) {
        for at in 0..self.pairs.list.len() {
            let (pair, force) = (self.pairs.list[at], self.pairs.forces[at]);
            self.load_pair(&pair, &(pair.direction * (force - pair.force)));
            self.pairs.changes[at] = force - pair.force;
            self.pairs.list[at].force = force;
        }
    }

    /// Takes the displacements by the springs of the pairs from `z`, into which the factor has solved.
    pub(super) fn hold_pairs(&mut self) {
        let Pairs {
            compliance, list, ..
        } = &mut self.pairs;
        if !compliance.holds() {
            return;
        }
        let (place, free) = (&self.place, self.free);
        compliance.add_to(&mut self.z[..free], |z, pair| {
            let moved = |node: u32| {
                z.get(place[node as usize] as usize)
                    .map_or_else(Vec3::zeros, to_vec)
            };
            let [a, b] = list[pair].nodes.map(moved);
            b - a
        });
    }

    /// The change of the vector between the vertices of a pair by the displacements `u` (m).
    fn parts(&self, pair: &Pair, u: impl Fn(usize) -> Vec3) -> Vec3 {
        let [a, b] = pair.nodes.map(|node| u(self.place[node as usize] as usize));
        b - a
    }

    /// The change of the opening of a pair along its direction by the displacements `u` (m).
    fn opens(&self, pair: &Pair, u: impl Fn(usize) -> Vec3) -> f64 {
        pair.direction.dot(&self.parts(pair, u))
    }

    /// Computes the responses of the openings along the present directions, with the factor in place of the matrix, and
    /// takes the springs into the preconditioner.
    pub(super) fn respond(&mut self) {
        let (count, most) = (self.pairs.list.len(), self.pairs.most);
        if count == 0 {
            return;
        }
        if !self.pairs.compliance.is_known() {
            self.make_columns();
        }
        let Pairs {
            compliance,
            list,
            responses,
            changed,
            ..
        } = &mut self.pairs;
        compliance.hold(list.iter().map(|pair| (pair.direction, pair.across)));
        for (column, pair) in list.iter().enumerate() {
            compliance.respond(column, &pair.direction, changed);
            for (row, (pair, change)) in list.iter().zip(&*changed).enumerate() {
                responses[row * most + column] = pair.direction.dot(change);
            }
        }
    }

    /// Computes the columns of all pairs.
    fn make_columns(&mut self) {
        let count = self.pairs.list.len();
        for column in 0..count {
            let nodes = self.pairs.list[column].nodes;
            for axis in 0..3 {
                self.push_apart(nodes, &Vec3::ith(axis, 1.0));
                self.pairs
                    .compliance
                    .take_column(column, axis, &self.z[..self.free]);
                for row in 0..count {
                    let [a, b] = self.pairs.list[row].nodes.map(|node| self.responded(node));
                    let opening = b - a;
                    self.pairs
                        .compliance
                        .take_opening(row, column, axis, &opening);
                }
            }
        }
        self.pairs.compliance.complete(count);
    }

    /// Solves the equation of the step together with the forces of the pairs. A round of few iterations is followed by the
    /// forces that agree with its openings: an exact solution for forces that still change would be of no use.
    pub(super) fn let_go(
        &mut self,
        factors: (f64, f64),
        limits: Limits,
        out_of_time: &mut impl FnMut() -> bool,
    ) -> StepperReport {
        let few = |done: usize| (limits.max_iterations - done).min(ROUND);
        let first = Limits {
            max_iterations: few(0),
            ..limits
        };
        let mut report = self.iterate(factors, first, out_of_time);
        for round in 0..=MOST_ROUNDS {
            for at in 0..self.pairs.list.len() {
                let pair = &self.pairs.list[at];
                let opening = pair.opening() + self.opens(pair, |place| to_vec(&self.u[place]));
                self.pairs.openings[at] = opening;
            }
            let change = self.pairs.agree();
            let agrees = change <= limits.goal;
            let left = limits.max_iterations - report.iterations;
            if agrees && (report.converged || left == 0) {
                break;
            }
            if round == MOST_ROUNDS {
                if !agrees {
                    self.drop_strays();
                    let limits = Limits {
                        start: limits.goal,
                        max_iterations: left,
                        ..limits
                    };
                    let again = self.iterate(factors, limits, out_of_time);
                    report.iterations += again.iterations;
                    report.residual = again.residual;
                    report.converged = again.converged;
                }
                break;
            }
            if !agrees {
                self.take_forces();
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
        self.lean_pairs();
        report
    }

    /// Gives the pairs the forces of their springs over the displacements `u`.
    pub(super) fn lean_pairs(&mut self) {
        for at in 0..self.pairs.list.len() {
            let pair = &self.pairs.list[at];
            let change = self.parts(pair, |place| to_vec(&self.u[place]));
            self.pairs.list[at].sideways = pair.sideways(&change);
        }
    }

    /// Lets the pairs go at once that would give back more energy than they store. Their forces do not agree with their
    /// openings after all rounds: a light piece that has come off responds more than the old factor says, and a pair would
    /// throw it.
    fn drop_strays(&mut self) {
        for at in 0..self.pairs.list.len() {
            let pair = self.pairs.list[at];
            let given = -pair.force * self.opens(&pair, |place| to_vec(&self.u[place]));
            // The comparison is false for a value that is not a number.
            if given <= pair.stored() + ROUNDING * pair.energy {
                continue;
            }
            self.load_pair(&pair, &(pair.direction * -pair.force));
            let pair = &mut self.pairs.list[at];
            (pair.force, pair.is_dropped) = (0.0, true);
        }
    }

    /// Corrects the responses by the last round, between two exact solutions. The factor is older than the matrix, and
    /// pairs beside each other nearly cancel: rounds with the responses of the factor alone may not end. The change of
    /// the openings is linear in that of the forces, so the symmetric secant of rank one ends them in as many rounds as
    /// there are pairs (Nocedal and Wright, "Numerical optimization", section 6.2).
    fn learn_responses(&mut self) {
        let (count, most) = (self.pairs.list.len(), self.pairs.most);
        let (mut along, mut size, mut missed) = (0.0, 0.0, 0.0);
        for at in 0..count {
            let pair = &self.pairs.list[at];
            let opening = pair.opening() + self.opens(pair, |place| to_vec(&self.u[place]));
            let responses = &self.pairs.responses[at * most..at * most + count];
            let changes = &self.pairs.changes[..count];
            let foreseen: f64 = responses
                .iter()
                .zip(changes)
                .map(|(r, change)| r * change)
                .sum();
            // Forces close the openings.
            let off = self.pairs.openings[at] - opening - foreseen;
            along += off * self.pairs.changes[at];
            size += self.pairs.changes[at].powi(2);
            missed += off * off;
            self.pairs.changed[at].x = off;
        }
        // The comparison is false for changes of zero, too.
        let is_clear = along.abs() > LEAST_SECANT * libm::sqrt(size * missed);
        // A force never opens its own pair.
        let stays = (0..count).all(|at| {
            let part = self.pairs.changed[at].x.powi(2);
            self.pairs.responses[at * most + at] + part / along > 0.0
        });
        if !(is_clear && stays) {
            return;
        }
        for row in 0..count {
            for column in 0..count {
                let part = self.pairs.changed[row].x * self.pairs.changed[column].x;
                self.pairs.responses[row * most + column] += part / along;
            }
        }
    }

    /// The energy (J) that pairs give back in the step.
    pub(super) fn given_back(&self, body: &Body) -> f64 {
        let pairs = self.pairs.list.iter();
        let work = pairs.map(|pair| {
            let force = pair.direction * pair.force + pair.sideways;
            (-force.dot(&moved_by(body, pair))).clamp(0.0, pair.stored())
        });
        work.sum()
    }

    /// Ends the step for the pairs, and forgets those that have let go. Returns the work that they took (J).
    pub(super) fn open_pairs(&mut self, body: &Body) -> f64 {
        let mut work = 0.0;
        for pair in &mut self.pairs.list {
            work -= pair.work;
            pair.advance(pair.force, &moved_by(body, pair));
            work += pair.work;
        }
        let count = self.pairs.list.len();
        let surplus = &mut self.pairs.surplus;
        self.pairs.list.retain(|pair| {
            let is_over = pair.is_over();
            // The energy of a pair that was dropped is lost: the next pair cannot take it.
            if is_over && !pair.is_dropped {
                *surplus += pair.left();
            }
            !is_over
        });
        if self.pairs.list.len() < count {
            self.pairs.forget_responses();
        }
        work
    }
}

/// The change of the vector between the vertices of a pair over the step (m).
fn moved_by(body: &Body, pair: &Pair) -> Vec3 {
    let moved = |node: u32| body.state.displacement[node as usize];
    let [a, b] = pair.nodes.map(moved);
    b - a
}
