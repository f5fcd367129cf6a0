//! The equation of a step, lent to a caller who solves several bodies that are joined together.
//!
//! After `constrain` a body has its equation `A u = f`, with the start of the iterations in `u` and the residual there. A
//! caller that joins bodies lets each of them lend its equation, adds the forces of its joints to the residuals, and solves
//! all bodies at once with the products and the preconditioners of each. [`Equation::solved`] then stands for `solve`.
//!
//! The forces of the joints are forces from outside: their work over the step is counted as that of hands is.

use super::stages::{Stage, Underway};
use super::{Solved, Stepper, StepperReport};
use crate::Vec3;
use crate::body::Body;
use crate::element::precision::Precision;
use crate::error::StepError;
use crate::lanes::{Node, to_node};
use crate::motion::constraint::by_node;

/// The equation of a step. All vectors are by place: free places come first. Without [`solved`](Self::solved), the step
/// is discarded and has to begin again.
#[derive(Debug)]
pub struct Equation<'a, T> {
    stepper: &'a mut Stepper<T>,
    step: Underway,
}

impl<T: Precision> Stepper<T> {
    /// Lends the equation of the step between `constrain` and `finish`, instead of `solve`; `None` for a body that sleeps,
    /// which has none. The forces of [pairs](Self::pairs) along their directions are loads in it and stay as they are.
    ///
    /// # Errors
    ///
    /// [`StepError::Stage`] if the step has not been constrained.
    pub fn equation(&mut self) -> Result<Option<Equation<'_, T>>, StepError> {
        let step = self.begun(Stage::Constrained)?;
        if step.report.asleep {
            self.underway = Some(step);
            return Ok(None);
        }
        self.weigh(step.factors.0);
        self.learned[Solved::Step as usize].begin(step.limits.uses_learned);
        Ok(Some(Equation {
            stepper: self,
            step,
        }))
    }

    /// The work of joints with other bodies over the step (J).
    pub(super) fn joint_work(&self, body: &Body) -> f64 {
        let work = self.joints.iter();
        work.map(|(node, force)| force.dot(&body.state.displacement[*node as usize]))
            .sum()
    }

    /// Adds the forces of joints with other bodies to the residual.
    pub(super) fn add_joints(&mut self) {
        for (node, force) in &self.joints {
            let r = &mut self.residual[self.place[*node as usize] as usize];
            let load: Node<T> = to_node(force);
            for i in 0..4 {
                r[i] += load[i];
            }
        }
    }
}

impl<T: Precision> Equation<'_, T> {
    /// Number of places, and of the free ones among them.
    pub fn places(&self) -> (usize, usize) {
        (self.stepper.node.len(), self.stepper.free)
    }

    /// The place of each node.
    pub fn place(&self) -> &[u32] {
        &self.stepper.place
    }

    /// The residual (N) at which the body by itself would be solved.
    pub fn goal(&self) -> f64 {
        self.step.limits.goal
    }

    /// The displacement over the step (m). Held places have that of their hand or support, and keep it.
    pub fn displacement(&mut self) -> &mut [Node<T>] {
        &mut self.stepper.u
    }

    /// The residual of the equation (N). On held places it is minus the force of the hand or support.
    pub fn residual(&mut self) -> &mut [Node<T>] {
        &mut self.stepper.residual
    }

    /// The displacement of a node over the step (m).
    pub fn displacement_of(&self, node: u32) -> Vec3 {
        by_node(&self.stepper.place, &self.stepper.u)(node)
    }

    /// The product `q = A p` of the matrix (N/m) with a vector (m) that is zero on held places.
    pub fn multiply(&mut self, p: &[Node<T>], q: &mut [Node<T>]) {
        let stepper = &mut *self.stepper;
        for ((q, p), inertia) in q.iter_mut().zip(p).zip(&stepper.inertia) {
            *q = p.map(|p| *inertia * p);
        }
        for set in &mut stepper.elements {
            set.product(stepper.team, T::of(self.step.factors.1), p, q);
        }
        stepper.pairs.add_springs(&stepper.place, p, q);
    }

    /// The free places of the residual, preconditioned (m). Guided axes are zero.
    pub fn precondition(&mut self) -> &[Node<f32>] {
        self.stepper.precondition(Solved::Step);
        &self.stepper.z[..self.stepper.free]
    }

    /// Ends the solve, so that `finish` may follow. `forces` are those of the joints on nodes (N), which the residual
    /// includes; `residual` is the norm of what is left of it on free axes (N).
    pub fn solved(self, forces: &[(u32, Vec3)], iterations: usize, residual: f64) {
        let Self { stepper, mut step } = self;
        step.report = StepperReport {
            iterations,
            residual,
            converged: residual <= step.limits.goal,
            ..step.report
        };
        stepper.joints.extend_from_slice(forces);
        stepper.pairs.lean(by_node(&stepper.place, &stepper.u));
        stepper.unfinished = !step.report.converged;
        step.stage = Stage::Solved;
        stepper.underway = Some(step);
    }
}
