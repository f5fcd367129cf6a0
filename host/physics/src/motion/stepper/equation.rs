//! The equation of a step, lent to a solver of several bodies that are joined together (`joined`).
//!
//! After `constrain` a body has its equation `A u = f`, with the start of the iterations in `u` and the residual there.
//! `Equation::solved` stands for `solve`. The forces of the joints are forces from outside: their work over the step is
//! counted as that of hands is.

use super::calls::{Call, Underway};
use super::{Limits, Solved, Stepper, StepperReport};
use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::element::precision::Precision;
use crate::error::StepError;
use crate::lanes::{Node, to_node, to_vec};
use crate::motion::constraint::by_node;
use crate::motion::joint_equation::JointEquation;

/// The equation of a step. If [`joined::solve`](crate::motion::joined::solve) does not solve the equation, the step is
/// discarded and has to begin again.
#[derive(Debug)]
pub struct Equation<'a, T> {
    stepper: &'a mut Stepper<T>,
    step: Underway,
    /// Whether the pairs of a tear are springs of the equation.
    holds_pairs: bool,
}

impl<T: Precision> Stepper<T> {
    /// Lends the equation of the step between `constrain` and `finish`, instead of `solve`; `None` for a body that sleeps,
    /// which has none: [`wake`](Self::wake) it before `constrain`. The forces of [pairs](Self::pairs) along their directions
    /// are loads in it and stay as they are.
    ///
    /// # Errors
    ///
    /// [`StepError::Order`] if the step has not been constrained.
    pub fn equation(&mut self) -> Result<Option<Equation<'_, T>>, StepError> {
        let step = self.begun(Call::Constrain)?;
        if step.report.asleep {
            self.present.underway = Some(step);
            return Ok(None);
        }
        self.weigh(step.factors.0);
        self.cg.learned[Solved::Step as usize].begin(step.limits.uses_learned);
        Ok(Some(Equation {
            stepper: self,
            step,
            holds_pairs: false,
        }))
    }

    /// Lends the equation of a shape of a local model, between two steps. `u` and the residual are those that have been laid.
    pub(crate) fn shape_equation(
        &mut self,
        factors: (f64, f64),
        limits: Limits,
    ) -> Equation<'_, T> {
        self.weigh(factors.0);
        self.cg.learned[limits.of as usize].begin(limits.uses_learned);
        Equation {
            step: Underway::of_shape(factors, limits),
            stepper: self,
            holds_pairs: false,
        }
    }

    /// Whether the present step has been solved.
    pub fn is_solved(&self) -> bool {
        self.present
            .underway
            .is_some_and(|step| step.last == Call::Solve)
    }

    /// Wakes a body that sleeps.
    pub fn wake(&mut self) {
        self.sleep.wake();
    }

    /// Whether a step of `h` seconds to `targets` would leave the body asleep.
    pub fn rests(&self, body: &Body, h: f64, targets: &[HandlePose]) -> bool {
        let speed = self.options.sleep_speed;
        speed > 0.0 && self.sleep.would_go_on(body, h, targets, speed)
    }

    /// Keeps the body awake, or lets it sleep again, from the next `constrain` on: a body sleeps together with the bodies
    /// that it touches.
    pub fn keep_awake(&mut self, is_kept: bool) {
        self.sleep.keep_awake(is_kept);
    }

    /// The work of joints with other bodies over the step (J).
    pub(super) fn joint_work(&self, body: &Body) -> f64 {
        let work = self.present.joints.iter();
        work.map(|(node, force)| force.dot(&body.state.displacement[*node as usize]))
            .sum()
    }

    /// Adds a force (N) on a node to the residual.
    pub(crate) fn load(&mut self, node: u32, force: &Vec3) {
        add(&self.places.of, node, force, &mut self.cg.residual);
    }

    /// The forces of joints with other bodies on nodes at the end of the last step (N).
    pub(crate) fn joint_forces(&self) -> &[(u32, Vec3)] {
        &self.present.joints
    }

    /// Adds the forces of joints with other bodies to the residual.
    pub(super) fn add_joints(&mut self) {
        for (node, force) in &self.present.joints {
            add(&self.places.of, *node, force, &mut self.cg.residual);
        }
    }
}

/// Adds `value` to the entry of a node.
fn add<T: Precision>(place: &[u32], node: u32, value: &Vec3, to: &mut [Node<T>]) {
    let sum = &mut to[place[node as usize] as usize];
    let value: Node<T> = to_node(value);
    for i in 0..4 {
        sum[i] += value[i];
    }
}

impl<T: Precision> Equation<'_, T> {
    /// The displacement of a node over the step so far (m). A held node has that of its hand or support.
    pub fn displacement(&self, node: u32) -> Vec3 {
        by_node(&self.stepper.places.of, &self.stepper.cg.u)(node)
    }
}

impl<T: Precision> JointEquation for Equation<'_, T> {
    fn displacement(&self, node: u32) -> Vec3 {
        Equation::displacement(self, node)
    }

    fn goal(&self, load: f64) -> f64 {
        self.stepper.options.tolerance * self.step.report.reference.max(load)
    }

    fn most(&self) -> usize {
        self.step.limits.max_iterations
    }

    fn load(&mut self, node: u32, force: &Vec3) {
        self.stepper.load(node, force);
    }

    fn residual(&mut self) -> f64 {
        self.stepper.norm()
    }

    fn precondition(&mut self) -> f64 {
        self.stepper.precondition(self.step.limits.of)
    }

    fn direct(&mut self, beta: f64) {
        self.stepper.direct(beta, self.step.factors.1);
        if self.holds_pairs {
            let Stepper {
                pairs, places, cg, ..
            } = &mut *self.stepper;
            pairs.add_stiffness(&places.of, &cg.p, &mut cg.q);
        }
    }

    fn direction(&self, node: u32) -> Vec3 {
        by_node(&self.stepper.places.of, &self.stepper.cg.p)(node)
    }

    fn add_product(&mut self, node: u32, value: &Vec3) {
        add(&self.stepper.places.of, node, value, &mut self.stepper.cg.q);
    }

    fn curvature(&mut self) -> f64 {
        self.stepper.curvature()
    }

    fn advance(&mut self, alpha: f64) -> f64 {
        self.stepper.advance(alpha)
    }

    fn stop(&mut self) {
        self.stepper.cg.p.fill([T::ZERO; 4]);
    }

    fn mark(&mut self) {
        let cg = &mut self.stepper.cg;
        for (marked, of) in cg.marked.iter_mut().zip([&cg.u, &cg.residual]) {
            marked.clear();
            marked.extend_from_slice(of);
        }
    }

    fn along(&self) -> [f64; 2] {
        let cg = &self.stepper.cg;
        let [u0, r0] = &cg.marked;
        let mut sums = [0.0; 2];
        for (((u0, r0), u), r) in u0.iter().zip(r0).zip(&cg.u).zip(&cg.residual) {
            let by = to_vec(u) - to_vec(u0);
            sums[0] += by.dot(&to_vec(r0));
            sums[1] += by.dot(&to_vec(r));
        }
        sums
    }

    fn back(&mut self, a: f64) {
        let cg = &mut self.stepper.cg;
        let a = T::of(a);
        let [u0, r0] = &cg.marked;
        for (to, from) in [(&mut cg.u, u0), (&mut cg.residual, r0)] {
            for (to, from) in to.iter_mut().zip(from) {
                for i in 0..4 {
                    to[i] = from[i] + a * (to[i] - from[i]);
                }
            }
        }
    }

    fn hold_pairs(&mut self) {
        let Stepper {
            pairs, places, cg, ..
        } = &mut *self.stepper;
        self.holds_pairs = !pairs.is_empty();
        pairs.find_openings(by_node(&places.of, &cg.u));
    }

    fn let_go(&mut self) {
        if self.holds_pairs {
            let Stepper {
                pairs, places, cg, ..
            } = &mut *self.stepper;
            pairs.relinearize(&places.of, &cg.u, &mut cg.residual);
        }
    }

    fn solved(
        &mut self,
        forces: &mut dyn Iterator<Item = (u32, Vec3)>,
        load: f64,
        iterations: usize,
        residual: f64,
    ) {
        let converged = residual <= self.goal(load);
        let Self {
            stepper,
            step,
            holds_pairs,
        } = self;
        step.report = StepperReport {
            iterations,
            residual,
            converged,
            reference: step.report.reference.max(load),
            ..step.report
        };
        stepper.present.joints.extend(forces);
        let (places, cg) = (&stepper.places, &stepper.cg);
        if *holds_pairs {
            stepper.pairs.stretch(by_node(&places.of, &cg.u));
        }
        stepper.pairs.shear(by_node(&places.of, &cg.u));
        stepper.last.unfinished = !converged;
        stepper.observe(&step.report);
        step.last = Call::Solve;
        stepper.present.underway = Some(*step);
    }
}
