//! How a body is stepped and condensed: assembled, or on a frozen factor.

use super::beside::Beside;
use super::stats::{EngineStats, StepFault, Stopwatch};
use physics::{Body, Condensed, Condenser, HandlePose, Real, ShapeOptions, Shapes, Stepper};

/// Steps and condenses one body.
pub trait Solver: Send {
    /// One step of `h` seconds to the handles' `targets`.
    ///
    /// # Errors
    /// [`StepFault`]; the body keeps its state then.
    fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        watch: &dyn Stopwatch,
        stats: &mut EngineStats,
    ) -> Result<(), StepFault>;

    /// Elastic energy of `body` (J) after the last step.
    fn elastic_energy(&self, body: &Body) -> f64;

    /// The matrices of a local model published every `period` seconds, where the scheme wants them.
    ///
    /// # Errors
    /// [`StepFault`].
    fn condense(&mut self, body: &Body, period: f64) -> Result<Option<&Condensed>, StepFault>;
}

/// The assembled matrix, and conjugate gradients on its diagonal blocks.
pub(super) struct Assembled {
    /// Condenses, where the scheme wants that.
    pub condenser: Option<Condenser>,
}

impl Solver for Assembled {
    fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        watch: &dyn Stopwatch,
        stats: &mut EngineStats,
    ) -> Result<(), StepFault> {
        let start = watch.now_ns();
        body.assemble();
        let assembled = watch.now_ns();
        let report = body.solve(h, targets)?;
        let solved = watch.now_ns();
        stats.assemble.record(assembled.saturating_sub(start));
        stats.solve.record(solved.saturating_sub(assembled));
        stats.solved(
            report.iterations,
            report.converged,
            report.relative_residual(),
        );
        Ok(())
    }

    fn elastic_energy(&self, body: &Body) -> f64 {
        body.elastic_energy()
    }

    fn condense(&mut self, body: &Body, period: f64) -> Result<Option<&Condensed>, StepFault> {
        match &mut self.condenser {
            Some(condenser) => Ok(Some(condenser.condense(body, period)?)),
            None => Ok(None),
        }
    }
}

/// A frozen factor, and elements that multiply by themselves.
pub(super) struct Frozen<T> {
    /// Steps the body; never makes a factor itself but the first.
    pub stepper: Stepper<T>,
    /// Makes the others.
    pub beside: Beside<T>,
    /// How local models are kept up, where the scheme wants them.
    pub options: Option<ShapeOptions>,
    /// What the latest of them leaves for the next.
    pub shapes: Shapes,
    /// Real clock: time that a step may take (ns).
    pub budget_ns: Option<u64>,
}

impl<T: Real> Solver for Frozen<T> {
    fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        watch: &dyn Stopwatch,
        stats: &mut EngineStats,
    ) -> Result<(), StepFault> {
        if let Some(refresher) = self.beside.done() {
            self.stepper.give_back(refresher);
            stats.factors += 1;
        }
        let start = watch.now_ns();
        let late = || {
            self.budget_ns
                .is_some_and(|budget| watch.now_ns().saturating_sub(start) >= budget)
        };
        let report = self.stepper.step(body, h, targets, late)?;
        stats.solve.record(watch.now_ns().saturating_sub(start));
        stats.solved(
            report.iterations,
            report.converged,
            report.residual / report.reference.max(f64::MIN_POSITIVE),
        );
        if let Some(refresher) = self.stepper.lend() {
            self.beside.begin(refresher);
        }
        Ok(())
    }

    fn elastic_energy(&self, _body: &Body) -> f64 {
        // Steps have it at no cost.
        self.stepper.elastic_energy()
    }

    fn condense(&mut self, body: &Body, period: f64) -> Result<Option<&Condensed>, StepFault> {
        match &self.options {
            Some(options) => {
                let (condensed, _) =
                    self.shapes
                        .condense(&mut self.stepper, body, period, options)?;
                Ok(Some(condensed))
            }
            None => Ok(None),
        }
    }
}
