//! A step in four calls: `predict`, `constrain`, `solve`, `finish`.
//!
//! Whoever moves several bodies makes each call for all of them in turn. What joins bodies then finds its place between
//! two: after `constrain` every body has its equation of motion, after `solve` what it would do alone. One body by itself
//! takes all four in [`Stepper::step`].

use super::{Limits, Stepper, StepperReport, factors};
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::error::StepError;
use crate::lanes::Real;

/// How far a step has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Predicted,
    Constrained,
    Solved,
}

/// A step that has begun.
#[derive(Clone, Copy, Debug)]
pub(super) struct Underway {
    stage: Stage,
    /// How long it is (s).
    h: f64,
    /// Factors of mass and stiffness in its matrix.
    factors: (f64, f64),
    limits: Limits,
    report: StepperReport,
}

impl<T: Real> Stepper<T> {
    /// Advances `body` by `h` seconds to the handle poses `targets`, one per handle. `out_of_time` is asked
    /// after each iteration; where it says so, the step is taken with what has been found.
    ///
    /// A solve that runs out of time or iterations is no error: the report says how far it came.
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

    /// Begins a step of `h` seconds: forces and tangent where `body` is, if anything but the last step moved it. A step
    /// that has begun already is forgotten.
    ///
    /// # Errors
    ///
    /// [`StepError::StepLength`] and [`StepError::Matrix`].
    pub fn predict(&mut self, body: &Body, h: f64) -> Result<(), StepError> {
        self.underway = None;
        Body::check_length(h)?;
        self.follow(body).map_err(StepError::Matrix)?;
        if body.state.x != self.at {
            self.sleep.wake();
            self.at.copy_from_slice(&body.state.x);
            self.linearize();
            self.begin_history(body);
        }
        self.underway = Some(Underway {
            stage: Stage::Predicted,
            h,
            factors: factors(body, h),
            limits: Limits {
                goal: 0.0,
                start: 0.0,
                max_iterations: 0,
            },
            report: StepperReport::default(),
        });
        Ok(())
    }

    /// Lays out the equation of the step: what handles, which go to `targets`, and supports prescribe, where the
    /// iterations start and what they leave over there. Finds whether the body sleeps on.
    ///
    /// # Errors
    ///
    /// [`StepError::Targets`], [`StepError::Target`], [`StepError::Matrix`], and [`StepError::Stage`] where the step has
    /// not been predicted; it has to begin again then.
    pub fn constrain(&mut self, body: &mut Body, targets: &[HandlePose]) -> Result<(), StepError> {
        let mut step = self.underway(body, Stage::Predicted)?;
        body.check_targets(targets)?;
        let (h, factors) = (step.h, step.factors);
        self.targets.clear();
        self.targets.extend_from_slice(targets);
        step.stage = Stage::Constrained;
        let speed = self.options.sleep_speed;
        if speed > 0.0 && self.sleep.goes_on(body, h, targets, speed) {
            step.report = StepperReport {
                converged: true,
                asleep: true,
                ..StepperReport::default()
            };
            self.underway = Some(step);
            return Ok(());
        }
        if self.factors != Some(factors) || (self.stale && self.options.refresh) {
            self.refresh(factors).map_err(StepError::Matrix)?;
        }
        self.stepped = None;
        self.prescribe(body, h, targets);
        let reference = self.start(body, h, factors.0, factors.1);
        let goal = self.options.tolerance * reference;
        // A body at rest and in balance but for rounding stays where it is.
        let unseen = if self.u.iter().flatten().all(|u| *u == T::ZERO) {
            self.unseen / (h * h)
        } else {
            0.0
        };
        step.limits = Limits {
            goal,
            // What iterations leave over is rough and moves little. What a guess leaves over is smooth, and moves a
            // hand by a hundred times as much.
            start: (0.1 * goal).max(unseen),
            max_iterations: self.options.max_iterations,
        };
        step.report.reference = reference;
        self.underway = Some(step);
        Ok(())
    }

    /// Solves the equation of the step. `out_of_time` is asked after each iteration; where it says so, the step goes on
    /// with what has been found.
    ///
    /// # Errors
    ///
    /// [`StepError::Stage`] where the step has not been constrained.
    pub fn solve(&mut self, mut out_of_time: impl FnMut() -> bool) -> Result<(), StepError> {
        let mut step = self.begun(Stage::Constrained)?;
        if !step.report.asleep {
            let reference = step.report.reference;
            step.report = self.iterate(step.factors, step.limits, &mut out_of_time);
            step.report.reference = reference;
            self.unfinished = !step.report.converged;
            self.stale |= self.is_slow(&step.report);
        }
        step.stage = Stage::Solved;
        self.underway = Some(step);
        Ok(())
    }

    /// Takes the step into `body`, as far as energy allows, and says how it went. Where cells are inside out the equation
    /// may be linearized and solved again, for which `out_of_time` is asked as before.
    ///
    /// # Errors
    ///
    /// [`StepError::Diverged`], and [`StepError::Stage`] where the step has not been solved; the body keeps its state
    /// then.
    pub fn finish(
        &mut self,
        body: &mut Body,
        mut out_of_time: impl FnMut() -> bool,
    ) -> Result<StepperReport, StepError> {
        let step = self.underway(body, Stage::Solved)?;
        let (h, mut report) = (step.h, step.report);
        if report.asleep {
            return Ok(report);
        }
        let targets = core::mem::take(&mut self.targets);
        let ended = self.end(
            body,
            h,
            &targets,
            step.factors,
            &mut report,
            &mut out_of_time,
        );
        if ended.is_ok() {
            let speed = self.options.sleep_speed;
            if speed > 0.0 && report.converged {
                self.sleep.observe(body, h, &targets, speed);
            } else {
                self.sleep.wake();
            }
        }
        self.targets = targets;
        ended.map(|()| report)
    }

    /// The step that has begun, if it has come as far as `stage` and `body` is as it was then.
    fn underway(&mut self, body: &Body, stage: Stage) -> Result<Underway, StepError> {
        let step = self.begun(stage)?;
        if self.epoch == body.epoch() {
            Ok(step)
        } else {
            Err(stage.missing())
        }
    }

    fn begun(&mut self, stage: Stage) -> Result<Underway, StepError> {
        match self.underway.take() {
            Some(step) if step.stage == stage => Ok(step),
            _ => Err(stage.missing()),
        }
    }
}

impl Stage {
    /// What it is to ask for more where a step has not come as far.
    fn missing(self) -> StepError {
        let (call, first) = match self {
            Self::Predicted => ("constrain", "predict"),
            Self::Constrained => ("solve", "constrain"),
            Self::Solved => ("finish", "solve"),
        };
        StepError::Stage { call, first }
    }
}
