//! The assembled step in four calls: `predict`, `constrain`, `solve`, `finish`.
//!
//! The calls are those of the frozen [`Stepper`](super::Stepper), with the same meaning. The equation is that of
//! `step`.

use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::error::StepError;
use crate::linear::pcg::SolveReport;

/// The stage that a step has reached.
#[derive(Clone, Copy, Debug, Default)]
enum Stage {
    #[default]
    Idle,
    Predicted,
    Constrained,
    Solved(SolveReport),
}

/// Steps one body by its assembled matrix.
#[derive(Clone, Debug, Default)]
pub struct AssembledStepper {
    stage: Stage,
    /// Length of the step (s).
    h: f64,
    /// The topology epoch of the body in which the step began.
    epoch: u64,
    /// The poses of the handles at the end of the step.
    targets: Vec<HandlePose>,
}

impl AssembledStepper {
    /// Begins a step of `h` seconds and assembles `body` at its present state. A step that has already begun is
    /// discarded.
    ///
    /// # Errors
    ///
    /// [`StepError::StepLength`].
    pub fn predict(&mut self, body: &mut Body, h: f64) -> Result<(), StepError> {
        self.stage = Stage::Idle;
        Body::check_length(h)?;
        body.assemble();
        self.h = h;
        self.epoch = body.epoch();
        self.stage = Stage::Predicted;
        Ok(())
    }

    /// Builds the equation of the step, with the handle poses `targets` at its end.
    ///
    /// # Errors
    ///
    /// [`StepError::Targets`], [`StepError::Target`], [`StepError::NotAssembled`] if the body's state was changed in
    /// between, and [`StepError::Stage`] if the step has not been predicted. After an error the step has to begin
    /// again.
    pub fn constrain(&mut self, body: &mut Body, targets: &[HandlePose]) -> Result<(), StepError> {
        let (call, first) = ("constrain", "predict");
        match core::mem::take(&mut self.stage) {
            Stage::Predicted if self.epoch == body.epoch() => {}
            _ => return Err(StepError::Stage { call, first }),
        }
        body.check_targets(targets)?;
        self.targets.clear();
        self.targets.extend_from_slice(targets);
        body.lay_out_step(self.h, targets)?;
        self.stage = Stage::Constrained;
        Ok(())
    }

    /// Solves the equation of the step.
    ///
    /// # Errors
    ///
    /// [`StepError::Stage`] if the step has not been constrained.
    pub fn solve(&mut self, body: &mut Body) -> Result<(), StepError> {
        let (call, first) = ("solve", "constrain");
        match core::mem::take(&mut self.stage) {
            Stage::Constrained if self.epoch == body.epoch() => {
                self.stage = Stage::Solved(body.solve_step(self.h));
                Ok(())
            }
            _ => Err(StepError::Stage { call, first }),
        }
    }

    /// Takes the step into `body`, as far as the energy allows, and returns the report of the solve.
    ///
    /// # Errors
    ///
    /// [`StepError::Diverged`], and [`StepError::Stage`] if the step has not been solved; the body keeps its state
    /// then.
    pub fn finish(&mut self, body: &mut Body) -> Result<SolveReport, StepError> {
        let (call, first) = ("finish", "solve");
        match core::mem::take(&mut self.stage) {
            Stage::Solved(report) if self.epoch == body.epoch() => {
                body.end_step(self.h, &self.targets, report)
            }
            _ => Err(StepError::Stage { call, first }),
        }
    }
}
