//! Pairs of vertices that let each other go: the cohesive forces behind a tip that has moved on, in the equation of a
//! step. The law of a pair is in `pair`.
//!
//! The forces along the pairs enter the equation of the step as loads. Each iteration is followed by the forces that
//! [agree](Agreement) with its openings. The compliance of the openings, with the factor in place of the matrix, foresees
//! the forces from the residual of the guess.
//!
//! Across its direction a pair is a spring. The spring is part of the matrix of the step: a light vertex that moves out of
//! the plane would swing from step to step otherwise. The compliance holds the springs in the preconditioner.

use super::agree::Agreement;
use super::compliance::Compliance;
use super::learned::Learned;
use super::pair::Pair;
use super::{Limits, Stepper, StepperReport};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::lanes::{Node, to_node, to_vec};

/// Most iterations that are followed by other forces.
const MOST_ROUNDS: usize = 16;
/// Forces converge slowly where they change by more than this fraction of the change before, or of the residual before,
/// and by more than so many times the goal.
const SLOW_ROUND: f64 = 0.5;
const CLOSE: f64 = 10.0;
/// The rounding error of the energy that a pair gives back, as a fraction of its energy.
const ROUNDING: f64 = 1e-3;

/// The pairs of a body, with the responses of their openings.
#[derive(Debug, Default)]
pub(super) struct Pairs {
    list: Vec<Pair>,
    most: usize,
    /// The columns of the pairs; those that are not known are computed at the next step.
    compliance: Compliance,
    /// The forces that agree with the openings.
    agreement: Agreement,
    /// Changes of openings (m).
    changed: Vec<Vec3>,
    /// The energy that pairs took too little in their last steps (J).
    surplus: f64,
    /// The energy that no pair will take any more (J), since it was asked for.
    lost: f64,
}

impl Pairs {
    /// Room for `most` pairs of a body with free places below `places`.
    pub(super) fn new(most: usize, places: usize) -> Self {
        Self {
            list: Vec::with_capacity(most),
            most,
            compliance: Compliance::new(most, places),
            agreement: Agreement::new(most),
            changed: vec![Vec3::zeros(); most],
            surplus: 0.0,
            lost: 0.0,
        }
    }

    /// Notes that the matrix or its factor has changed.
    pub(super) fn forget_responses(&mut self) {
        self.compliance.forget();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }
}

impl<T: Precision> Stepper<T> {
    /// Room for `most` pairs of vertices that let each other go at the same time, and for what solves tell the
    /// preconditioner about them. Pairs that there are vanish.
    pub fn reserve_pairs(&mut self, most: usize) {
        self.pairs = Pairs::new(most, self.held);
        let places = if most > 0 { self.held } else { 0 };
        self.learned = [places; 2].map(Learned::new);
    }

    /// The pairs that have not let go.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs.list
    }

    /// The pair of these vertices, if it has not let go.
    pub fn pair(&self, nodes: [u32; 2]) -> Option<&Pair> {
        self.pairs.list.iter().find(|pair| pair.nodes == nodes)
    }

    /// Forgets all pairs: they let go at once.
    pub fn clear_pairs(&mut self) {
        self.pairs.list.clear();
        self.forget_solves();
    }

    /// The energy (J) that the pairs that have let go since the last [`take_surplus`](Self::take_surplus) took too little
    /// (positive) or too much (negative) in their last steps.
    pub fn surplus(&self) -> f64 {
        self.pairs.surplus
    }

    /// The energy that pairs have still to take (J), with the error of those that have let go.
    pub fn pending(&self) -> f64 {
        self.pairs.list.iter().map(Pair::left).sum::<f64>() + self.pairs.surplus
    }

    /// Returns the [surplus](Self::surplus), at most `most` (J) of either sign. Of the rest, at most `kept` stays for the next
    /// pair.
    pub fn take_surplus(&mut self, most: f64, kept: f64) -> f64 {
        let taken = self.pairs.surplus.clamp(-most, most);
        self.pairs.surplus = (self.pairs.surplus - taken).clamp(-kept, kept);
        taken
    }

    /// The energy (J) that pairs had still to take and no pair will take, since the last call: that of pairs that were let go
    /// because they would have thrown a light piece.
    pub fn take_lost(&mut self) -> f64 {
        core::mem::take(&mut self.pairs.lost)
    }

    /// Lets the pair of these vertices [lose](Pair::slacken) the strength `loss` (N), and forgets a pair that has let go.
    /// Returns by how much the energy of the pair falls (J).
    pub fn slacken(&mut self, nodes: [u32; 2], loss: f64) -> f64 {
        let Some(at) = self.pairs.list.iter().position(|pair| pair.nodes == nodes) else {
            return 0.0;
        };
        let lost = self.pairs.list[at].slacken(loss);
        if self.pairs.list[at].is_over() {
            self.pairs.list.remove(at);
            self.pairs.forget_responses();
        }
        self.sleep.wake();
        lost
    }

    /// Adds a pair. Returns whether there was [room](Self::reserve_pairs).
    pub fn add_pair(&mut self, pair: Pair) -> bool {
        let has_room = self.pairs.list.len() < self.pairs.most;
        if has_room {
            self.pairs.list.push(pair);
            self.forget_solves();
            self.sleep.wake();
        }
        has_room
    }

    /// The force (N) that the second of two vertices at one place has to exert on the first so that they keep moving
    /// together, after the edit that parted them has been [settled](Self::settle): elastic forces and loads, and the
    /// common acceleration.
    pub fn force_between(&self, body: &Body, nodes: [u32; 2]) -> Vec3 {
        let acting = nodes.map(|node| self.acting(body, node));
        let mass = nodes.map(|node| body.model.mass[node as usize]);
        (acting[0] + acting[1]) * (mass[0] / (mass[0] + mass[1])) - acting[0]
    }

    /// Elastic force and loads on a vertex (N) at the end of the last step: what inertia, damping and the pairs balance.
    fn acting(&self, body: &Body, node: u32) -> Vec3 {
        let elastic = to_vec(&self.force[self.place[node as usize] as usize]);
        elastic + body.model.external[node as usize] * body.model.load_factor
    }

    /// As [`acting`](Self::acting), along the axes of the vertex that no support guides (N).
    pub(crate) fn unbalanced(&self, body: &Body, node: u32) -> Vec3 {
        let acting = self.acting(body, node);
        let mask = self.mask.get(self.place[node as usize] as usize);
        mask.map_or(acting, |mask| acting.component_mul(&to_vec(mask)))
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
            let opening = pair.opening() + guess + pair.direction.dot(change);
            self.pairs.agreement.openings[at] = opening;
        }
        self.pairs.changed = changed;
        let change = self.pairs.agreement.solve(&self.pairs.list, false);
        if change.is_finite() {
            self.take_forces();
        }
    }

    /// Gives the pairs the forces that were solved for, and changes the residual by them.
    fn take_forces(&mut self) {
        for at in 0..self.pairs.list.len() {
            let (pair, force) = (self.pairs.list[at], self.pairs.agreement.forces[at]);
            self.load_pair(&pair, &(pair.direction * (force - pair.force)));
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
        if self.pairs.is_empty() {
            return;
        }
        if !self.pairs.compliance.is_known() {
            self.make_columns();
        }
        let Pairs {
            compliance,
            list,
            agreement,
            changed,
            ..
        } = &mut self.pairs;
        compliance.hold(list.iter().map(|pair| (pair.direction, pair.across)));
        for (column, pair) in list.iter().enumerate() {
            compliance.respond(column, &pair.direction, changed);
            for (row, (pair, change)) in list.iter().zip(&*changed).enumerate() {
                agreement.set_response(row, column, pair.direction.dot(change));
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

    /// Solves the equation of the step together with the forces of the pairs. Each iteration is followed by the forces that
    /// agree with its openings: an exact solution for forces that still change would be of no use. What an iteration
    /// learned is not lost, see `learned`.
    pub(super) fn let_go(
        &mut self,
        factors: (f64, f64),
        limits: Limits,
        out_of_time: &mut dyn FnMut() -> bool,
    ) -> StepperReport {
        let mut report = StepperReport::default();
        // The change of the forces from which on they converge slowly (N).
        let mut slow = f64::INFINITY;
        let (mut is_measured, mut is_last, mut is_late) = (false, false, false);
        for round in 0.. {
            let start = if round == 0 {
                limits.start
            } else {
                limits.goal
            };
            let most = if is_measured || is_last {
                limits.max_iterations
            } else {
                1
            };
            let until = (start, most);
            self.go_on(factors, limits, until, &mut report, &mut || {
                is_late = out_of_time();
                is_late
            });
            self.find_openings();
            let change = self.pairs.agreement.solve(&self.pairs.list, true);
            let agrees = change <= limits.goal;
            let is_out = is_late || report.iterations >= limits.max_iterations;
            if is_last || (agrees && (report.converged || is_out)) {
                break;
            }
            if is_out || round >= MOST_ROUNDS {
                if !agrees {
                    self.drop_strays();
                }
                is_last = true;
            } else if !(is_measured || change < slow.max(CLOSE * limits.goal)) {
                // The comparison is false for a change that is not a number.
                self.measure_responses(factors, limits, &mut report, out_of_time);
                is_measured = true;
            } else if !agrees {
                slow = SLOW_ROUND * change.max(report.residual);
                self.take_forces();
            }
        }
        self.lean_pairs();
        report
    }

    /// Goes on with the iterations of a step: at most `most` more, and none where the residual is at most `start` (N).
    fn go_on(
        &mut self,
        factors: (f64, f64),
        limits: Limits,
        (start, most): (f64, usize),
        report: &mut StepperReport,
        out_of_time: &mut dyn FnMut() -> bool,
    ) {
        let limits = Limits {
            start,
            max_iterations: most.min(limits.max_iterations - report.iterations),
            uses_learned: limits.uses_learned || report.iterations > 0,
            ..limits
        };
        let before = *report;
        *report = self.iterate(factors, limits, out_of_time);
        if before.iterations > 0 {
            report.iterations += before.iterations;
            report.rate = before.rate;
        }
    }

    /// Finds the openings at the present displacements.
    fn find_openings(&mut self) {
        for at in 0..self.pairs.list.len() {
            let pair = &self.pairs.list[at];
            let opening = pair.opening() + self.opens(pair, |place| to_vec(&self.u[place]));
            self.pairs.agreement.openings[at] = opening;
        }
    }

    /// Measures the responses: changes the force of each pair in turn by its first force, and solves the equation. A light
    /// piece that has come off may respond otherwise than the factor of the sheet before says, and forces that follow the
    /// responses of the factor may diverge then.
    fn measure_responses(
        &mut self,
        factors: (f64, f64),
        limits: Limits,
        report: &mut StepperReport,
        out_of_time: &mut dyn FnMut() -> bool,
    ) {
        let until = (limits.goal, limits.max_iterations);
        self.go_on(factors, limits, until, report, out_of_time);
        self.find_openings();
        for column in 0..self.pairs.list.len() {
            let pair = self.pairs.list[column];
            self.load_pair(&pair, &(pair.direction * pair.first));
            self.pairs.list[column].force += pair.first;
            self.go_on(factors, limits, until, report, out_of_time);
            for row in 0..self.pairs.list.len() {
                let other = &self.pairs.list[row];
                let opening = other.opening() + self.opens(other, |place| to_vec(&self.u[place]));
                let agreement = &mut self.pairs.agreement;
                // Forces close the openings.
                let response = (agreement.openings[row] - opening) / pair.first;
                agreement.set_response(row, column, response);
                agreement.openings[row] = opening;
            }
        }
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
        let Pairs {
            list,
            surplus,
            lost,
            ..
        } = &mut self.pairs;
        list.retain(|pair| {
            let is_over = pair.is_over();
            if is_over {
                // The next pair cannot take the energy of a pair that was dropped.
                *if pair.is_dropped {
                    &mut *lost
                } else {
                    &mut *surplus
                } += pair.left();
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
