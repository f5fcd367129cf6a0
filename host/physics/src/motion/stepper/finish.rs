//! The end of a step: the reports on hands and supports, and the bound on the energy.

use super::correct::MOST_SOLUTIONS;
use super::{RUN, Stepper, StepperReport};
use crate::Vec3;
use crate::body::Body;
use crate::body::guard::{Energy, Guard};
use crate::body::handle::HandlePose;
use crate::element::precision::Precision;
use crate::error::StepError;
use crate::lanes::{Node, to_node, to_vec};
use crate::team;

/// What is known of the last step.
#[derive(Debug)]
pub(crate) struct Last<T> {
    /// Whether it took more than a few iterations.
    pub(super) is_hard: bool,
    /// Whether its displacement was certified, because the body touches something or may do so.
    pub(super) was_certified: bool,
    /// Room for the positions at its end (m).
    pub(super) ahead: Vec<Vec3>,
    /// Whether it ended before it converged.
    pub(super) unfinished: bool,
    /// The step, as long as the residual belongs to its end.
    pub(crate) stepped: Option<Stepped>,
    /// Elastic forces at its start, by place (N).
    pub(crate) began: Vec<Node<T>>,
}

/// A step that has been taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stepped {
    /// Length of the step (s).
    pub(crate) length: f64,
    /// Whether the step followed its linearization: neither corrected nor held back.
    pub(crate) whole: bool,
}

impl<T: Precision> Stepper<T> {
    /// Takes the step into `body`, and linearizes at its end.
    pub(crate) fn end(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        factors: (f64, f64),
        report: &mut StepperReport,
        out_of_time: &mut dyn FnMut() -> bool,
    ) -> Result<(), StepError> {
        self.last.was_certified = self.present.is_certified;
        self.begin_account(body);
        let mut work = self.take(body, h, report)?;
        let before = self.energy(body);
        // If a hand does work on a body, the hand decides where the body goes.
        let promised =
            (work == 0.0 && self.present.joints.is_empty() && !self.present.is_certified)
                .then(|| self.promise(body, h, factors))
                .flatten();
        let mut after = self.energy_ahead(body, h);
        let breaks = promised.is_some_and(|promised| self.breaks(body, promised));
        if breaks {
            (work, after) = self.correct(body, h, factors, report, out_of_time)?;
        }
        if !self.pairs.is_empty() {
            work += self.given_back(body);
        }
        if !self.present.joints.is_empty() {
            work += self.joint_work(body);
        }
        let again = self.end_where_energy_allows(
            body,
            h,
            factors,
            ((before, after), work),
            report,
            out_of_time,
        )?;
        let is_linear = report.held_back == 0.0 && !again;
        if !is_linear {
            self.pull_at_the_end(body, h);
            body.take_grip_from(h, |node| self.pull(node));
        }
        self.last.stepped = Some(Stepped {
            length: h,
            whole: !breaks && is_linear,
        });
        body.report_step(h, targets, |node| self.pull(node));
        let release = self.open_pairs(body);
        self.end_account(body, h, release, (breaks, is_linear));
        let state = &mut body.state;
        let nodes = (
            &mut *state.x,
            &*self.elements.at,
            &mut *state.v,
            &*state.displacement,
        );
        team::each_of(&*self.team, nodes, RUN, &|(x, at, v, u)| {
            x.copy_from_slice(at);
            for (v, u) in v.iter_mut().zip(u) {
                *v = u / h;
            }
        });
        if self.present.slowed.is_some() {
            for node in 0..body.state.v.len() {
                body.state.v[node] = self.velocity(body, h, node);
            }
        }
        body.state.motions += 1;
        Ok(())
    }

    /// Energy at the start of the step.
    pub(super) fn energy(&self, body: &Body) -> Energy {
        let stored = body.kinetic_energy() + self.elements.energy;
        Energy::new(stored, body.load_potential())
    }

    /// Copies the computed displacement into `body`. Returns an upper bound of the work of hands (J).
    pub(crate) fn take(
        &mut self,
        body: &mut Body,
        h: f64,
        report: &StepperReport,
    ) -> Result<f64, StepError> {
        let nodes = (&mut *body.state.displacement, &*self.places.of);
        team::each_of(&*self.team, nodes, RUN, &|(displacement, places)| {
            for (displacement, &place) in displacement.iter_mut().zip(places) {
                *displacement = to_vec(&self.cg.u[place as usize]);
            }
        });
        let work = body.take_grip_from(h, |node| self.pull(node));
        if body.is_step_finite(h) && report.residual.is_finite() {
            return Ok(work);
        }
        body.constraints.forget_grips();
        Err(StepError::Diverged {
            iterations: report.iterations,
        })
    }

    /// The force of a hand or support on a node (N): minus the residual of the equation.
    fn pull(&self, node: usize) -> Vec3 {
        -to_vec(&self.cg.residual[self.places.of[node] as usize])
    }

    /// Linearizes at the end of the step. A step that would add energy is shortened first. If no shorter step is
    /// allowed, because hands move so far that one linearization does not hold, the equation is solved again, and the
    /// new motion is shortened if it would add energy. The
    /// energies are those before the step and at the end of the whole step, where the elements are linearized on entry,
    /// beside an upper bound of the `work` of hands (J). Returns whether the equation was solved again.
    fn end_where_energy_allows(
        &mut self,
        body: &mut Body,
        h: f64,
        factors: (f64, f64),
        ((before, after), mut work): ((Energy, Energy), f64),
        report: &mut StepperReport,
        out_of_time: &mut dyn FnMut() -> bool,
    ) -> Result<bool, StepError> {
        let mut guard = body.state.guard;
        guard.begin(before);
        if self.present.is_certified {
            let after = self.slow(body, h, &guard, (after, work), report);
            guard.end(after, work);
            body.state.guard = guard;
            return Ok(false);
        }
        let hands_work = work > 0.0;
        let (mut whole, mut solutions) = (Some(after), 0);
        let after = loop {
            let held = guard.hold_back(body, work, |body| {
                whole.take().unwrap_or_else(|| self.energy_ahead(body, h))
            });
            report.held_back = 1.0 - held.kept;
            // The linearization must belong to the step's end, and the last evaluation belongs to another displacement.
            let after = if held.returned {
                self.energy_ahead(body, h)
            } else {
                held.energy
            };
            if !hands_work || solutions == MOST_SOLUTIONS || guard.allows(body, after, work) {
                break after;
            }
            solutions += 1;
            let (again, energy) = self.solve_again(body, h, factors, report, out_of_time)?;
            (work, whole) = (again, Some(energy));
        };
        guard.end(after, work);
        body.state.guard = guard;
        Ok(solutions > 0)
    }

    /// Takes velocity from a body whose step has been certified and would add energy. Its displacement stays, because a body
    /// that goes less far than was certified may be where another body passes. Returns the energy at the end.
    fn slow(
        &mut self,
        body: &Body,
        h: f64,
        guard: &Guard,
        (after, work): (Energy, f64),
        report: &mut StepperReport,
    ) -> Energy {
        let drift = body.free_drift() / h;
        let free = body.constraints.free_nodes();
        let own = free.map(|node| {
            let own = body.state.displacement[node] / h - drift;
            0.5 * body.model.mass[node] * own.norm_squared()
        });
        let kept = guard.slow(body, after, work, own.sum());
        self.present.slowed = (kept < 1.0).then_some((kept, drift));
        report.held_back = 1.0 - kept;
        if kept == 1.0 {
            return after;
        }
        let kinetic = body.kinetic_energy_of(|node| self.velocity(body, h, node));
        let loads = body.load_potential_at(&self.elements.at);
        Energy::new(kinetic + self.elements.energy, loads)
    }

    /// The velocity of a node at the end of the present step (m/s).
    pub(super) fn velocity(&self, body: &Body, h: f64, node: usize) -> Vec3 {
        let v = body.state.displacement[node] / h;
        match self.present.slowed {
            Some((kept, drift)) if (self.places.of[node] as usize) < self.places.free => {
                drift + (v - drift) * kept
            }
            _ => v,
        }
    }

    /// Energy at the end of the present displacement. The elements are linearized there.
    pub(crate) fn energy_ahead(&mut self, body: &Body, h: f64) -> Energy {
        let (state, at) = (&body.state, &mut *self.elements.at);
        let nodes = (at, &*state.x, &*state.displacement);
        team::each_of(&*self.team, nodes, RUN, &|(at, x, u)| {
            for ((at, x), u) in at.iter_mut().zip(x).zip(u) {
                *at = x + u;
            }
        });
        self.linearize();
        let kinetic = body.kinetic_energy_of(|node| body.state.displacement[node] / h);
        let loads = body.load_potential_at(&self.elements.at);
        Energy::new(kinetic + self.elements.energy, loads)
    }

    /// The residual of the equation of motion with the forces at the end of the step.
    pub(crate) fn pull_at_the_end(&mut self, body: &Body, h: f64) {
        let drag = body.model.config.mass_damping / h;
        let (cg, force) = (&mut self.cg, &self.elements.force);
        for (place, r) in cg.residual.iter_mut().enumerate() {
            let node = self.places.node[place] as usize;
            let u = body.state.displacement[node];
            let inertia = (body.state.v[node] - u / h) / h - u * drag;
            let external = body.model.external[node] * body.model.load_factor;
            let inertia = inertia * self.places.mass[place];
            *r = to_node(&(to_vec(&force[place]) + external + inertia));
            cg.u[place] = to_node(&u);
        }
        self.pairs.load(&self.places.of, &mut self.cg.residual);
        self.add_joints();
        let damping = T::of(-body.model.config.stiffness_damping / h);
        self.elements
            .product(&*self.team, damping, &self.cg.u, &mut self.cg.residual);
    }
}
