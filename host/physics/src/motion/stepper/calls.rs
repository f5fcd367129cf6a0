//! A step in four calls: `predict`, `constrain`, `solve`, `finish`.
//!
//! A caller that moves several bodies makes each call for all of them in turn. Connections between bodies act between
//! two calls. After `constrain` every body has its equation of motion; after `solve` each body has the solution for
//! itself alone. Bodies that are [joined](crate::motion::joined) are solved together: between `constrain` and
//! `finish` each of them [lends](Stepper::equation) its equation. For a single body, [`Stepper::step`] makes all four calls.

use super::{EASY, Limits, Solved, Stepper, StepperReport, factors};
use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::element::precision::Precision;
use crate::error::StepError;
use crate::motion::constraint::by_node;

/// A call of a step that another call must follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Call {
    Predict,
    Constrain,
    Solve,
}

/// A step that has begun.
#[derive(Clone, Copy, Debug)]
pub(super) struct Underway {
    /// The last call that was made.
    pub(super) last: Call,
    /// Length of the step (s).
    pub(super) h: f64,
    /// Factors of mass and stiffness in the matrix of the step.
    pub(super) factors: (f64, f64),
    pub(super) limits: Limits,
    pub(super) report: StepperReport,
}

impl Underway {
    /// The equation of a shape, which belongs to no step.
    pub(super) fn of_shape(factors: (f64, f64), limits: Limits) -> Self {
        Self {
            last: Call::Constrain,
            h: 0.0,
            factors,
            limits,
            report: StepperReport::default(),
        }
    }
}

/// The present step, with what it is given from outside.
#[derive(Debug, Default)]
pub(super) struct Present {
    /// The step, if it has begun and not ended.
    pub(super) underway: Option<Underway>,
    /// The handle poses at its end.
    pub(super) targets: Vec<HandlePose>,
    /// The forces of joints with other bodies on nodes at its end (N).
    pub(super) joints: Vec<(u32, Vec3)>,
    /// Whether the displacement is [certified](super::Stepper::certify): it is what the body does.
    pub(super) is_certified: bool,
    /// What part of its velocity, less a drift (m/s), a body keeps at the end of a certified step; `None` for all.
    pub(super) slowed: Option<(f64, Vec3)>,
}

impl<T: Precision> Stepper<T> {
    /// Advances `body` by `h` seconds to the handle poses `targets`, one per handle. `out_of_time` is called after each
    /// iteration. If it returns true, the step uses the solution so far.
    ///
    /// A solve that runs out of time or iterations is no error: the report gives the residual that it reached.
    ///
    /// # Errors
    ///
    /// [`StepError`]; the body keeps its state then.
    pub fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        mut out_of_time: impl FnMut() -> bool,
    ) -> Result<StepperReport, StepError> {
        body.check_step(h, targets)?;
        self.predict(body, h)?;
        self.constrain(body, targets)?;
        self.solve(&mut out_of_time)?;
        self.finish(body, &mut out_of_time)
    }

    /// Begins a step of `h` seconds. Forces and tangent are computed at the present state of `body`, if anything but
    /// the last step has moved the body. A step that has already begun is discarded.
    ///
    /// # Errors
    ///
    /// [`StepError::StepLength`] and [`StepError::Matrix`].
    #[inline(never)]
    pub fn predict(&mut self, body: &Body, h: f64) -> Result<(), StepError> {
        self.present.underway = None;
        self.present.joints.clear();
        self.present.is_certified = false;
        self.present.slowed = None;
        Body::check_length(h)?;
        self.follow(body).map_err(StepError::Matrix)?;
        // A step that has been discarded may have left pieces guided.
        self.sleep.lift(body, &mut self.places);
        if self.is_due() {
            self.join(body);
            self.linearize();
        }
        if body.state.x != self.elements.at {
            self.sleep.wake();
            self.sleep.wake_pieces();
            self.elements.at.copy_from_slice(&body.state.x);
            self.linearize();
            self.begin_history(body);
        }
        self.present.underway = Some(Underway {
            last: Call::Predict,
            h,
            factors: factors(body, h),
            limits: Limits {
                of: Solved::Step,
                uses_learned: false,
                goal: 0.0,
                start: 0.0,
                max_iterations: 0,
            },
            report: StepperReport::default(),
        });
        Ok(())
    }

    /// Builds the equation of the step: the displacements that supports and the handle poses `targets` prescribe, the
    /// start of the iterations, and the residual there. Finds whether the body continues to sleep.
    ///
    /// # Errors
    ///
    /// [`StepError::Targets`], [`StepError::Target`], [`StepError::Matrix`], and [`StepError::Order`] if the step has
    /// not been predicted. After an error the step has to begin again.
    #[inline(never)]
    pub fn constrain(&mut self, body: &mut Body, targets: &[HandlePose]) -> Result<(), StepError> {
        let mut step = self.underway(body, Call::Predict)?;
        body.check_targets(targets)?;
        let (h, factors) = (step.h, step.factors);
        self.present.targets.clear();
        self.present.targets.extend_from_slice(targets);
        step.last = Call::Constrain;
        let speed = self.options.sleep_speed;
        if speed > 0.0 && self.sleep.goes_on(body, h, targets, speed) {
            step.report = StepperReport {
                converged: true,
                asleep: true,
                ..StepperReport::default()
            };
            self.rest_account();
            self.present.underway = Some(step);
            return Ok(());
        }
        if self.factor.factors != Some(factors) || (self.factor.stale && self.options.refresh) {
            self.refresh(factors).map_err(StepError::Matrix)?;
        }
        self.last.stepped = None;
        let is_awake = !self.pairs.is_empty();
        self.sleep.lay(body, h, is_awake, &mut self.places);
        self.prescribe(body, h, targets);
        self.turn(body);
        self.respond();
        self.pairs.follow(by_node(&self.places.of, &self.cg.u));
        // Forces below this one move nothing, so no residual is relative to less.
        let unseen = self.places.unseen / (h * h);
        let reference = self.start(body, h, factors.0, factors.1).max(unseen);
        let (places, cg) = (&self.places, &mut self.cg);
        (self.pairs).predict(&places.of, &cg.u, places.free, &mut cg.residual);
        let goal = self.options.tolerance * reference;
        // A body at rest whose residual is only rounding stays where it is.
        let still = if self.cg.u.iter().flatten().all(|u| *u == T::ZERO) {
            unseen
        } else {
            0.0
        };
        step.limits = Limits {
            of: Solved::Step,
            uses_learned: self.last.is_hard,
            goal,
            // The residual of iterations is rough and moves little. The residual of a guess is smooth, and moves a hand
            // by a hundred times as much.
            start: (0.1 * goal).max(still),
            max_iterations: self.options.max_iterations,
        };
        step.report.reference = reference;
        self.present.underway = Some(step);
        Ok(())
    }

    /// Solves the equation of the step. `out_of_time` is called after each iteration. If it returns true, the step
    /// continues with the solution so far.
    ///
    /// # Errors
    ///
    /// [`StepError::Order`] if the step has not been constrained.
    pub fn solve(&mut self, mut out_of_time: impl FnMut() -> bool) -> Result<(), StepError> {
        self.solve_until(&mut out_of_time)
    }

    /// [`Self::solve`] with any function. Never inlined, see `compiled`.
    #[inline(never)]
    pub(crate) fn solve_until(
        &mut self,
        out_of_time: &mut dyn FnMut() -> bool,
    ) -> Result<(), StepError> {
        let mut step = self.begun(Call::Constrain)?;
        if !step.report.asleep {
            let reference = step.report.reference;
            step.report = if self.pairs.is_empty() {
                self.iterate(step.factors, step.limits, out_of_time)
            } else {
                self.let_go(step.factors, step.limits, out_of_time)
            };
            step.report.reference = reference;
            self.last.unfinished = !step.report.converged;
            self.observe(&step.report);
        }
        step.last = Call::Solve;
        self.present.underway = Some(step);
        Ok(())
    }

    /// Notes what the solution took, for the factor and the start of the next solution.
    pub(super) fn observe(&mut self, report: &StepperReport) {
        self.last.is_hard = report.iterations > EASY;
        self.factor.observe(report, self.options.patience);
        self.ask_for_turns(report.iterations);
    }

    /// Takes the step into `body`, as far as the energy allows, and returns its report. If elements are inverted, the
    /// equation may be linearized and solved again; `out_of_time` is then called as in `solve`.
    ///
    /// # Errors
    ///
    /// [`StepError::Diverged`], and [`StepError::Order`] if the step has not been solved; the body keeps its state
    /// then.
    pub fn finish(
        &mut self,
        body: &mut Body,
        mut out_of_time: impl FnMut() -> bool,
    ) -> Result<StepperReport, StepError> {
        self.finish_until(body, &mut out_of_time)
    }

    /// [`Self::finish`] with any function. Never inlined, see `compiled`.
    #[inline(never)]
    pub(crate) fn finish_until(
        &mut self,
        body: &mut Body,
        out_of_time: &mut dyn FnMut() -> bool,
    ) -> Result<StepperReport, StepError> {
        let step = self.underway(body, Call::Solve)?;
        let (h, mut report) = (step.h, step.report);
        if report.asleep {
            return Ok(report);
        }
        let targets = core::mem::take(&mut self.present.targets);
        let ended = self.end(body, h, &targets, step.factors, &mut report, out_of_time);
        if ended.is_ok() {
            let speed = self.options.sleep_speed;
            // A joint may move a body that rests, and a body that sleeps has no equation. Contacts tell of motion themselves
            // (`keep_awake`).
            let is_free = self.present.joints.is_empty() || self.present.is_certified;
            if speed > 0.0 && report.converged && is_free {
                self.sleep.observe(body, h, &targets, speed);
                self.sleep.observe_pieces(body, speed);
            } else {
                self.sleep.wake();
                if !is_free {
                    self.sleep.wake_pieces();
                }
            }
        }
        self.sleep.lift(body, &mut self.places);
        self.present.targets = targets;
        ended.map(|()| report)
    }

    /// The step that has begun, if its last call was `last` and the topology epoch of `body` has not changed since.
    fn underway(&mut self, body: &Body, last: Call) -> Result<Underway, StepError> {
        let step = self.begun(last)?;
        if self.epoch == body.epoch() {
            Ok(step)
        } else {
            Err(last.missing())
        }
    }

    /// The step that has begun, if its last call was `last`.
    pub(super) fn begun(&mut self, last: Call) -> Result<Underway, StepError> {
        match self.present.underway.take() {
            Some(step) if step.last == last => Ok(step),
            _ => Err(last.missing()),
        }
    }
}

impl Call {
    /// The error of the call that must follow this call, for a step whose last call was another.
    fn missing(self) -> StepError {
        let (call, first) = match self {
            Self::Predict => ("constrain", "predict"),
            Self::Constrain => ("solve", "constrain"),
            Self::Solve => ("finish", "solve"),
        };
        StepError::Order { call, first }
    }
}
