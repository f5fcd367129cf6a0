//! The step of one body: its physics, its solver and its tears, stage by stage.

use super::balance::Balance;
use super::contact::Contact;
use super::publisher::{Elastic, Publisher};
use super::recipe::Recipe;
use super::solver::Solver;
use super::stats::{StepFault, Stopwatch, Tally};
use super::tears::{BodyTears, UnderWay};
use physics::{Around, Body, BodyError, BodyMap, Condensed, Equation, HandlePose};

/// A body with what steps it.
pub(super) struct Stepping {
    pub(super) body: Body,
    /// Steps and condenses the body.
    pub(super) solver: Solver,
    /// How the solver is made again when the body's topology changes.
    pub(super) recipe: Recipe,
    /// The tears of the body; `None` for a body that does not tear.
    pub(super) tears: Option<BodyTears>,
    /// Length of a step (s).
    pub(super) step: f64,
    /// The time over which models predict the response of the body (s).
    pub(super) response: f64,
    /// Whether nothing has failed in the present step.
    pub(super) sound: bool,
    /// The counts and times of the present step.
    pub(super) tally: Tally,
}

impl Stepping {
    /// Continues with the body and the solver of `other`, at the present positions and velocities. Returns the body of
    /// before.
    ///
    /// # Errors
    /// [`BodyError`] if the two bodies are not of the same mesh. Nothing is changed in this case.
    pub(super) fn exchange(&mut self, mut other: Self) -> Result<Body, BodyError> {
        let map = BodyMap::identity(&self.body);
        other.body.continue_from(&self.body, &map)?;
        self.solver.replace(other.solver);
        self.recipe = other.recipe;
        if let Some(tears) = &mut self.tears {
            // The same shape stores another energy.
            tears.balance = Balance::default();
            tears.tearing.begin_balance();
            // The change that was under way was made for the body before.
            tears.under_way = UnderWay::Nothing;
        }
        Ok(core::mem::replace(&mut self.body, other.body))
    }

    /// Begins a step: computes forces and tangent.
    pub(super) fn predict(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        self.tally = Tally::default();
        self.sound = false;
        if let Some(tears) = &self.tears {
            tears.balance.check()?;
        }
        self.solver
            .predict(&mut self.body, self.step, watch, &mut self.tally)?;
        self.sound = true;
        Ok(())
    }

    /// Sets up the step's equation. Does nothing if an earlier stage of the step failed.
    pub(super) fn constrain(
        &mut self,
        targets: &[HandlePose],
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        if core::mem::take(&mut self.sound) {
            self.solver.constrain(&mut self.body, targets, watch)?;
            self.sound = true;
        }
        Ok(())
    }

    /// Lends the step's equation to a group of joined bodies; `None` if an earlier stage of the step failed.
    pub(super) fn equation(&mut self) -> Option<Equation<'_, f64>> {
        self.sound.then(|| self.solver.equation()).flatten()
    }

    /// Notes that a group has solved the lent equation in `time` (ns).
    pub(super) fn solved_in(&mut self, time: u64) {
        self.sound &= self.solver.solved_in(time);
    }

    /// Solves the step's equation, unless a group has solved it. Does nothing if an earlier stage of the step failed.
    pub(super) fn solve(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        if core::mem::take(&mut self.sound) {
            if !self.solver.is_solved() {
                self.solver.solve(watch)?;
            }
            self.sound = true;
        }
        Ok(())
    }

    /// Takes the step, lets the tears grow, and tells `publisher` of them. Returns whether there is a state to publish:
    /// there is none if an earlier stage of the step failed. `contact` holds the contacts of the engine,
    /// and the number of this body in them.
    pub(super) fn finish(
        &mut self,
        publisher: &mut Publisher,
        contact: Option<(&Contact, usize)>,
        watch: &dyn Stopwatch,
    ) -> Result<bool, StepFault> {
        if !self.sound {
            return Ok(false);
        }
        self.solver.finish(&mut self.body, watch, &mut self.tally)?;
        if let Some(tears) = &mut self.tears {
            let start = watch.now_ns();
            let torn = self.solver.tear(
                &mut self.body,
                &mut tears.tearing,
                tears.under_way,
                &|body, vertex, to| {
                    contact.is_none_or(|(all, number)| all.is_clear(number, body, vertex, to))
                },
                &mut self.tally,
            );
            if torn {
                publisher.begin_epoch();
                let parted = tears.tearing.report().parted;
                if let Some(from) = tears.parting.follow(&self.body, parted) {
                    let elastic = self.solver.elastic_energy();
                    publisher.part(&mut tears.parting, from, &self.body, elastic);
                }
            }
            tears.parting.dismiss(&mut self.body);
            self.tally.torn = torn;
            self.tally.tear = Some(watch.now_ns().saturating_sub(start));
            let elastic = self.solver.elastic_energy();
            tears.balance.take(&self.body, elastic, self.step)?;
        }
        Ok(true)
    }

    /// Takes from the step what a model needs.
    pub(super) fn see(&mut self) -> Result<(), StepFault> {
        self.solver.see(&self.body, self.response)
    }

    /// Has `publisher` publish a model of the present state, which is that of `time_ns`, with what the body touches.
    pub(super) fn publish(
        &mut self,
        publisher: &mut Publisher,
        time_ns: u64,
        mut around: Option<&mut Around<'_, f64>>,
    ) -> Result<(), StepFault> {
        let lent = around.as_deref_mut();
        if let Some(condensed) = self.solver.condense(&self.body, self.response, lent)? {
            publisher.take(condensed);
            self.tally.clip = clip(condensed);
        }
        let mut elastic = Elastic::Whole(self.solver.elastic_energy());
        if let Some(tears) = &mut self.tears {
            let (solver, body) = (&mut self.solver, &self.body);
            publisher.limit(|slope| solver.tear_limit(body, &mut tears.tearing, slope));
        }
        // A model has one limit, and a tear goes before the contacts.
        if let Some(around) = around
            && !(self.tears.is_some() && publisher.has_limit())
        {
            let (solver, body, period) = (&mut self.solver, &self.body, self.response);
            publisher.limit(|slope| solver.contact_limit(body, period, around, slope));
        }
        if let Some(tears) = &mut self.tears
            && publisher.has_energy()
            && tears.parting.groups() > 1
        {
            elastic = Elastic::Pieces(tears.parting.sum(&self.body));
        }
        publisher.publish(&self.body, elastic, time_ns);
        Ok(())
    }
}

/// The larger fraction by which stiffness or damping was clipped, if one was.
fn clip(condensed: &Condensed) -> Option<f64> {
    let clips = [condensed.stiffness_clip, condensed.damping_clip];
    let clipped = clips.iter().any(|clip| clip.count > 0);
    clipped.then(|| clips.iter().fold(0.0_f64, |worst, c| worst.max(c.fraction)))
}
