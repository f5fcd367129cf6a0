//! How a body is stepped and condensed: assembled, or on a frozen factor.

use super::beside::Beside;
use super::stats::{EngineStats, StepFault, Stopwatch};
use physics::{
    AssembledStepper, Body, Condensed, Condenser, HandlePose, Real, ShapeOptions, Shapes, Stepper,
};

/// Steps and condenses one body. A step is four calls in this order, each over all bodies in turn; a body of which one
/// fails keeps its state, and is left out until the next step.
pub trait Solver: Send {
    /// Begins a step of `h` seconds: forces and tangent where `body` is.
    ///
    /// # Errors
    /// [`StepFault`].
    fn predict(
        &mut self,
        body: &mut Body,
        h: f64,
        watch: &dyn Stopwatch,
        stats: &mut EngineStats,
    ) -> Result<(), StepFault>;

    /// Lays out its equation, with handles going to `targets`.
    ///
    /// # Errors
    /// [`StepFault`].
    fn constrain(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault>;

    /// Solves it.
    ///
    /// # Errors
    /// [`StepFault`].
    fn solve(&mut self, body: &mut Body, watch: &dyn Stopwatch) -> Result<(), StepFault>;

    /// Takes the step into `body`.
    ///
    /// # Errors
    /// [`StepFault`].
    fn finish(
        &mut self,
        body: &mut Body,
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

/// Time that a step of one body has taken so far (ns): other bodies' calls lie between its own.
#[derive(Clone, Copy, Debug, Default)]
struct Spent(u64);

impl Spent {
    /// Does `call` and counts its time.
    fn count<R>(&mut self, watch: &dyn Stopwatch, call: impl FnOnce() -> R) -> R {
        let start = watch.now_ns();
        let result = call();
        self.0 += watch.now_ns().saturating_sub(start);
        result
    }

    /// Whether it has reached `budget_ns`, with a call that began at `start`.
    fn reaches(self, budget_ns: Option<u64>, watch: &dyn Stopwatch, start: u64) -> bool {
        budget_ns.is_some_and(|budget| self.0 + watch.now_ns().saturating_sub(start) >= budget)
    }
}

/// The assembled matrix, and conjugate gradients on its diagonal blocks.
#[derive(Default)]
pub(super) struct Assembled {
    stepper: AssembledStepper,
    spent: Spent,
    /// Condenses, where the scheme wants that.
    condenser: Option<Condenser>,
}

impl Assembled {
    /// With what condenses, where the scheme wants that.
    pub(super) fn new(condenser: Option<Condenser>) -> Self {
        Self {
            condenser,
            ..Self::default()
        }
    }
}

impl Solver for Assembled {
    fn predict(
        &mut self,
        body: &mut Body,
        h: f64,
        watch: &dyn Stopwatch,
        stats: &mut EngineStats,
    ) -> Result<(), StepFault> {
        let mut assemble = Spent::default();
        assemble.count(watch, || self.stepper.predict(body, h))?;
        stats.assemble.record(assemble.0);
        self.spent = Spent::default();
        Ok(())
    }

    fn constrain(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        let stepper = &mut self.stepper;
        Ok(self
            .spent
            .count(watch, || stepper.constrain(body, targets))?)
    }

    fn solve(&mut self, body: &mut Body, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        let stepper = &mut self.stepper;
        Ok(self.spent.count(watch, || stepper.solve(body))?)
    }

    fn finish(
        &mut self,
        body: &mut Body,
        watch: &dyn Stopwatch,
        stats: &mut EngineStats,
    ) -> Result<(), StepFault> {
        let stepper = &mut self.stepper;
        let report = self.spent.count(watch, || stepper.finish(body))?;
        stats.solve.record(self.spent.0);
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
    stepper: Stepper<T>,
    /// Makes the others.
    beside: Beside<T>,
    /// How local models are kept up, where the scheme wants them.
    options: Option<ShapeOptions>,
    /// What the latest of them leaves for the next.
    shapes: Shapes,
    /// Real clock: time that a step may take (ns).
    budget_ns: Option<u64>,
    /// Of the present step.
    spent: Spent,
}

impl<T: Real> Frozen<T> {
    /// A `stepper` that never makes a factor but its first; `beside` makes the others. `options` say how local models are
    /// kept up, where the scheme wants them. Under the real clock a step may take `budget_ns` (ns).
    pub(super) fn new(
        stepper: Stepper<T>,
        beside: Beside<T>,
        options: Option<ShapeOptions>,
        budget_ns: Option<u64>,
    ) -> Self {
        Self {
            stepper,
            beside,
            options,
            shapes: Shapes::default(),
            budget_ns,
            spent: Spent::default(),
        }
    }
}

impl<T: Real> Solver for Frozen<T> {
    fn predict(
        &mut self,
        body: &mut Body,
        h: f64,
        watch: &dyn Stopwatch,
        stats: &mut EngineStats,
    ) -> Result<(), StepFault> {
        if let Some(refresher) = self.beside.done() {
            self.stepper.give_back(refresher);
            stats.factors += 1;
        }
        self.spent = Spent::default();
        let stepper = &mut self.stepper;
        Ok(self.spent.count(watch, || stepper.predict(body, h))?)
    }

    fn constrain(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        let stepper = &mut self.stepper;
        Ok(self
            .spent
            .count(watch, || stepper.constrain(body, targets))?)
    }

    fn solve(&mut self, _body: &mut Body, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        let (start, before) = (watch.now_ns(), self.spent);
        let late = || before.reaches(self.budget_ns, watch, start);
        let stepper = &mut self.stepper;
        Ok(self.spent.count(watch, || stepper.solve(late))?)
    }

    fn finish(
        &mut self,
        body: &mut Body,
        watch: &dyn Stopwatch,
        stats: &mut EngineStats,
    ) -> Result<(), StepFault> {
        let (start, before) = (watch.now_ns(), self.spent);
        let late = || before.reaches(self.budget_ns, watch, start);
        let stepper = &mut self.stepper;
        let report = self.spent.count(watch, || stepper.finish(body, late))?;
        stats.solve.record(self.spent.0);
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
