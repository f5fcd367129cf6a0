//! Pairs of vertices that let each other go: the cohesive forces behind a tip that has moved on, in the equation of a
//! step. The law of a pair is [`Cohesion`]; [`Constraints`] are the pairs of a body. This file solves the equation
//! together with them.

use super::learned::Learned;
use super::{Limits, Stepper, StepperReport};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::lanes::{to_node, to_vec};
use crate::motion::constraint::cohesion::Cohesion;
use crate::motion::constraint::{Constraints, by_node};

/// Most iterations that are followed by other forces.
const MOST_ROUNDS: usize = 16;
/// Forces converge slowly if they change by more than this fraction of the change before, or of the residual before,
/// and by more than `CLOSE` times the goal.
const SLOW_ROUND: f64 = 0.5;
const CLOSE: f64 = 10.0;

/// The energy of pairs that have let go.
#[derive(Debug, Default)]
pub(super) struct Released {
    /// The energy that pairs took too little in their last steps (J).
    surplus: f64,
    /// The energy that no pair will take any more (J), since it was asked for.
    lost: f64,
}

impl<T: Precision> Stepper<T> {
    /// Room for `most` pairs of vertices that let each other go at the same time, and for what solves tell the
    /// preconditioner about them. Pairs that there are vanish.
    pub fn reserve_pairs(&mut self, most: usize) {
        self.pairs = Constraints::new(most, self.places.held);
        self.released = Released::default();
        let places = if most > 0 { self.places.held } else { 0 };
        self.cg.learned = [places; 2].map(Learned::new);
    }

    /// The pairs that have not let go.
    pub fn pairs(&self) -> &[Cohesion] {
        self.pairs.laws()
    }

    /// The pair of these vertices, if it has not let go.
    pub fn pair(&self, nodes: [u32; 2]) -> Option<&Cohesion> {
        self.pairs().iter().find(|pair| pair.nodes == nodes)
    }

    /// Takes the pairs of `running`, a stepper of the same sheet that this one replaces. A pair of which a handle of `body` holds
    /// a vertex lets go.
    pub fn take_pairs(&mut self, running: &mut Self, body: &Body) {
        self.released = core::mem::take(&mut running.released);
        for pair in running.pairs() {
            if pair.nodes.iter().any(|node| body.constraints.holds(*node)) {
                self.released.lost += pair.left();
            } else {
                self.add_pair(*pair);
            }
        }
        running.clear_pairs();
    }

    /// Forgets all pairs: they let go at once.
    pub fn clear_pairs(&mut self) {
        self.pairs.clear();
        self.forget_solves();
    }

    /// The energy (J) that the pairs that have let go since the last [`take_surplus`](Self::take_surplus) took too little
    /// (positive) or too much (negative) in their last steps.
    pub fn surplus(&self) -> f64 {
        self.released.surplus
    }

    /// The energy that pairs have still to take (J), with the error of those that have let go.
    pub fn pending(&self) -> f64 {
        self.pairs().iter().map(Cohesion::ahead).sum::<f64>() + self.released.surplus
    }

    /// Returns the [surplus](Self::surplus), at most `most` (J) of either sign. Of the rest, at most `kept` stays for the next
    /// pair.
    pub fn take_surplus(&mut self, most: f64, kept: f64) -> f64 {
        let taken = self.released.surplus.clamp(-most, most);
        self.released.surplus = (self.released.surplus - taken).clamp(-kept, kept);
        taken
    }

    /// The energy (J) that pairs had still to take and no pair will take, since the last call: that of paced pairs that have let
    /// go, and of pairs that were let go because they would have thrown a light piece. Negative if paced pairs took more than
    /// their energy.
    pub fn take_lost(&mut self) -> f64 {
        core::mem::take(&mut self.released.lost)
    }

    /// Lets the tip before the pair of these vertices move on by the part `part` of its edge: the pair
    /// [slackens](Cohesion::slacken), and is forgotten if it has let go. Returns by how much the energy of the pair falls (J).
    pub fn slacken(&mut self, nodes: [u32; 2], part: f64) -> f64 {
        let Some(at) = self.pairs().iter().position(|pair| pair.nodes == nodes) else {
            return 0.0;
        };
        let pair = &mut self.pairs.laws_mut()[at];
        let fallen = pair.slacken(part);
        if pair.is_over() {
            self.released.lost += self.pairs.remove(at).left();
        }
        self.sleep.wake();
        fallen
    }

    /// [Paces](Cohesion::pace) the pair of these vertices over the next step.
    pub fn pace(&mut self, nodes: [u32; 2], pace: f64) {
        let mut pairs = self.pairs.laws_mut().iter_mut();
        if let Some(pair) = pairs.find(|pair| pair.nodes == nodes) {
            pair.pace(pace);
        }
    }

    /// Adds a pair. Returns whether there was [room](Self::reserve_pairs).
    pub fn add_pair(&mut self, pair: Cohesion) -> bool {
        let has_room = self.pairs.push(pair);
        if has_room {
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

    /// Elastic force, loads and forces of joints on a vertex (N) at the end of the last step: what inertia, damping and the
    /// pairs balance.
    fn acting(&self, body: &Body, node: u32) -> Vec3 {
        let elastic = to_vec(&self.elements.force[self.places.of[node as usize] as usize]);
        let joints = self.joint_forces().iter().filter(|(at, _)| *at == node);
        let joined: Vec3 = joints.map(|(_, force)| force).sum();
        elastic + body.model.external[node as usize] * body.model.load_factor + joined
    }

    /// As [`acting`](Self::acting), along the axes of the vertex that no support guides (N).
    pub(crate) fn unbalanced(&self, body: &Body, node: u32) -> Vec3 {
        let acting = self.acting(body, node);
        let mask = self.places.mask.get(self.places.of[node as usize] as usize);
        mask.map_or(acting, |mask| acting.component_mul(&to_vec(mask)))
    }

    /// Solves, in `z`, for the displacements under a unit force that parts two vertices.
    fn push_apart(&mut self, nodes: [u32; 2], direction: &Vec3) {
        self.cg.z.fill([0.0; 4]);
        for (node, sign) in nodes.into_iter().zip([-1.0, 1.0]) {
            let place = self.places.of[node as usize] as usize;
            if place < self.places.free {
                self.cg.z[place] = to_node(&(direction * sign));
            }
        }
        self.solve_factor();
    }

    /// Computes the columns of the pairs that are not known, and the responses of the openings.
    pub(super) fn respond(&mut self) {
        if self.pairs.needs_columns() {
            for column in 0..self.pairs.laws().len() {
                let nodes = self.pairs.laws()[column].nodes;
                for axis in 0..3 {
                    self.push_apart(nodes, &Vec3::ith(axis, 1.0));
                    let z = &self.cg.z[..self.places.free];
                    self.pairs.take_column(column, axis, &self.places.of, z);
                }
            }
        }
        self.pairs.respond();
    }

    /// Solves the equation of the step together with the forces of the pairs. After each iteration, the forces are made
    /// to agree with the openings: an exact solution for forces that still change would be of no use. What an iteration
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
            let change = self.pairs.agree(by_node(&self.places.of, &self.cg.u));
            let agrees = change <= limits.goal;
            let is_out = is_late || report.iterations >= limits.max_iterations;
            if is_last || (agrees && (report.converged || is_out)) {
                break;
            }
            if is_out || round >= MOST_ROUNDS {
                if !agrees {
                    (self.pairs).drop_strays(&self.places.of, &self.cg.u, &mut self.cg.residual);
                }
                is_last = true;
            } else if !(is_measured || change < slow.max(CLOSE * limits.goal)) {
                // The comparison is false for a change that is not a number.
                self.measure_responses(factors, limits, &mut report, out_of_time);
                is_measured = true;
            } else if !agrees {
                slow = SLOW_ROUND * change.max(report.residual);
                self.pairs
                    .take_forces(&self.places.of, &mut self.cg.residual);
            }
        }
        self.pairs.shear(by_node(&self.places.of, &self.cg.u));
        report
    }

    /// Continues the iterations of a step: at most `most` more, and none if the residual is at most `start` (N).
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
        self.pairs
            .find_openings(by_node(&self.places.of, &self.cg.u));
        for column in 0..self.pairs.laws().len() {
            (self.pairs).push_law(column, &self.places.of, &mut self.cg.residual);
            self.go_on(factors, limits, until, report, out_of_time);
            (self.pairs).take_responses(column, by_node(&self.places.of, &self.cg.u));
        }
    }

    /// Ends the step for the pairs, and forgets those that have let go. Returns the work that they took (J).
    pub(super) fn open_pairs(&mut self, body: &Body) -> f64 {
        let Released { surplus, lost } = &mut self.released;
        let moved = |node: u32| body.state.displacement[node as usize];
        self.pairs.accept(moved, |pair| {
            // The next pair cannot take the energy of a pair that was dropped.
            *(if pair.is_dropped() {
                &mut *lost
            } else {
                &mut *surplus
            }) += pair.left();
        })
    }

    /// The energy (J) that pairs give back in the step.
    pub(super) fn given_back(&self, body: &Body) -> f64 {
        (self.pairs).given_back(|node| body.state.displacement[node as usize])
    }
}
