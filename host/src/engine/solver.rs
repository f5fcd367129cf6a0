//! How a body is stepped and condensed: on a frozen factor, without an assembled matrix.

use super::background::{Background, Work};
use super::renewal::{Renewals, catch_up};
use super::stats::{StepFault, Stopwatch, Tally};
use super::tears::{MOST_PAIRS, UnderWay};
use physics::topology::Edit;
use physics::{
    Around, Body, Condensed, Equation, HandlePose, IsClear, Refresher, ShapeOptions, Shapes,
    Stepper, Team, TearLimit, Tearing, TearingError,
};
use rt_core::MAX_HANDLES;
use std::sync::Arc;

/// A step of a sheet that tears has much work if it took more iterations than this number, or if it made an edit. Its model
/// has the shapes of the model before, so that the longest steps are shorter.
const MUCH_WORK: usize = 3;
/// Time in which an iteration of a sheet that tears counts in virtual time (s): a step of many iterations takes longer than
/// its length, and the background work continues meanwhile.
const ITERATION: f64 = 0.25e-3;
/// Most models in turn with the same shapes.
const MOST_KEPT: usize = 2;

/// Time that a step of one body has taken so far (ns). It is summed over the calls, because the calls of other bodies
/// lie between them.
#[derive(Clone, Copy, Debug, Default)]
struct Elapsed(u64);

impl Elapsed {
    /// Makes `call` and counts its time.
    fn count<R>(&mut self, watch: &dyn Stopwatch, call: impl FnOnce() -> R) -> R {
        let start = watch.now_ns();
        let result = call();
        self.0 += watch.now_ns().saturating_sub(start);
        result
    }

    /// Whether the time has reached `budget_ns`, including a call that began at `start`.
    fn reaches(self, budget_ns: Option<u64>, watch: &dyn Stopwatch, start: u64) -> bool {
        budget_ns.is_some_and(|budget| self.0 + watch.now_ns().saturating_sub(start) >= budget)
    }
}

/// A new factor.
impl Work for Box<Refresher<f64>> {
    const THREAD: &'static str = "factor";
    const TIME: f64 = 0.01;

    fn work(&mut self) {
        // A refresher that fails gives no new factor, and the old factor stays in use.
        let _ = Refresher::work(self);
    }
}

/// Steps and condenses one body. The elements multiply without an assembled matrix.
///
/// A step consists of four calls in this order: [`predict`](Self::predict), [`constrain`](Self::constrain),
/// [`solve`](Self::solve), [`finish`](Self::finish). The engine makes each call for all bodies before the next call. A
/// body for which a call fails keeps its state and is left out until the next step.
pub(super) struct Solver {
    /// Steps the body. It makes only the first factor itself.
    stepper: Stepper<f64>,
    /// Makes the other factors.
    background: Background<Box<Refresher<f64>>>,
    /// The refresher that has done its work, while its factor is read ahead.
    made: Option<Box<Refresher<f64>>>,
    /// Whether a refresher is under way.
    lent: bool,
    /// Whether the whole factor has been read.
    read: bool,
    /// Number of parts in which a factor is read ahead; 0 if a step takes a new factor at once.
    parts: usize,
    /// How the shapes are kept current; `None` if the scheme does not use them.
    options: Option<ShapeOptions>,
    /// The latest shapes, from which the next condensation starts.
    shapes: Shapes,
    /// The shapes with the contacts that close before the next model.
    closed: Shapes,
    /// Time that a step may take under the real clock (ns).
    budget_ns: Option<u64>,
    /// Time spent on the present step.
    elapsed: Elapsed,
    /// Steppers for the topologies that tears make; `None` for a body that does not tear.
    renewals: Option<Renewals>,
    /// Whether the present step of a body that tears has much work, and the number of models in turn with the same shapes.
    is_busy: bool,
    kept: usize,
    /// Number of steps whose time the present step takes in virtual time.
    passed: u32,
    /// Length of a step (s).
    h: f64,
    /// Whether the run is under the real clock.
    real: bool,
}

impl Solver {
    /// A solver whose `stepper` makes only its first factor; `beside` makes the others. The `options` are those of
    /// the shapes, if the scheme uses them. Steps take `h` seconds of the body's time; under the `real` clock they may
    /// take `budget_ns` (ns).
    pub(super) fn new(
        stepper: Stepper<f64>,
        background: Background<Box<Refresher<f64>>>,
        options: Option<ShapeOptions>,
        (h, real): (f64, bool),
        budget_ns: Option<u64>,
    ) -> Self {
        Self {
            stepper,
            background,
            made: None,
            lent: false,
            read: false,
            parts: Refresher::<f64>::parts(h),
            options,
            shapes: Shapes::default(),
            closed: Shapes::default(),
            budget_ns,
            elapsed: Elapsed::default(),
            renewals: None,
            is_busy: false,
            kept: 0,
            passed: 1,
            h,
            real,
        }
    }

    /// Has `team` do the parts of the steps.
    pub(super) fn work_with(&mut self, team: Arc<dyn Team>) {
        self.stepper.team = team;
    }

    /// Puts `other` in the place of this solver, with its team. Returns this solver.
    pub(super) fn replace(&mut self, mut other: Self) -> Self {
        other.work_with(Arc::clone(&self.stepper.team));
        core::mem::replace(self, other)
    }

    /// Takes back a refresher that has done its work, and reads the next part of its factor.
    fn receive(&mut self) {
        if self.made.is_none() {
            // If the thread has ended, the factor in use stays in use.
            self.made = self.background.done(self.passed).unwrap_or_default();
            self.lent &= self.made.is_none();
        }
        if let Some(refresher) = &mut self.made {
            // A step that takes longer than it should waits for no factor that is there.
            for _ in 0..self.passed {
                self.read = refresher.read_ahead(self.parts);
            }
        }
    }

    /// Begins a step of `h` seconds: computes forces and tangent at the state of `body`.
    ///
    /// # Errors
    /// [`StepFault`].
    pub(super) fn predict(
        &mut self,
        body: &mut Body,
        h: f64,
        watch: &dyn Stopwatch,
        tally: &mut Tally,
    ) -> Result<(), StepFault> {
        if self.parts == 0 {
            self.receive();
        }
        if self.read
            && let Some(refresher) = self.made.take()
        {
            self.read = false;
            self.stepper.give_back(refresher);
            tally.factors += 1;
        }
        self.elapsed = Elapsed::default();
        let stepper = &mut self.stepper;
        Ok(self.elapsed.count(watch, || stepper.predict(body, h))?)
    }

    /// Sets up the equation of the step, in which the handles move to `targets`.
    ///
    /// # Errors
    /// [`StepFault`].
    pub(super) fn constrain(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        watch: &dyn Stopwatch,
    ) -> Result<(), StepFault> {
        let stepper = &mut self.stepper;
        Ok(self
            .elapsed
            .count(watch, || stepper.constrain(body, targets))?)
    }

    /// Solves the equation.
    ///
    /// # Errors
    /// [`StepFault`].
    pub(super) fn solve(&mut self, watch: &dyn Stopwatch) -> Result<(), StepFault> {
        let (start, before) = (watch.now_ns(), self.elapsed);
        let late = || before.reaches(self.budget_ns, watch, start);
        let stepper = &mut self.stepper;
        Ok(self.elapsed.count(watch, || stepper.solve(late))?)
    }

    /// Time that is left for the present step (ns); `None` if it has no limit.
    pub(super) fn left_ns(&self) -> Option<u64> {
        Some(self.budget_ns?.saturating_sub(self.elapsed.0))
    }

    /// Wakes a body that sleeps.
    pub(super) fn wake(&mut self) {
        self.stepper.wake();
    }

    /// Whether the body would sleep in the next step, to `targets`.
    pub(super) fn rests(&self, body: &Body, targets: &[HandlePose]) -> bool {
        self.stepper.rests(body, self.h, targets)
    }

    /// Number of pieces that sleep while the body is awake.
    pub(super) fn pieces_asleep(&self) -> usize {
        self.stepper.pieces_asleep()
    }

    /// Keeps the body awake, or lets it sleep again.
    pub(super) fn keep_awake(&mut self, is_kept: bool) {
        self.stepper.keep_awake(is_kept);
    }

    /// The stepper, for contacts between the stages of the step.
    pub(super) fn stepper(&mut self) -> &mut Stepper<f64> {
        &mut self.stepper
    }

    /// Counts time (ns) that was spent on the step outside of its own calls.
    pub(super) fn spend(&mut self, time: u64) {
        self.elapsed.0 += time;
    }

    /// Lends the equation, instead of [`solve`](Self::solve).
    pub(super) fn equation(&mut self) -> Option<Equation<'_, f64>> {
        self.stepper.equation().ok().flatten()
    }

    /// Counts the time (ns) of the solution of the lent equation. Returns whether there is one.
    pub(super) fn solved_in(&mut self, time: u64) -> bool {
        self.spend(time);
        self.is_solved()
    }

    /// Whether the present step has been solved.
    pub(super) fn is_solved(&self) -> bool {
        self.stepper.is_solved()
    }

    /// Applies the step to `body`.
    ///
    /// # Errors
    /// [`StepFault`].
    pub(super) fn finish(
        &mut self,
        body: &mut Body,
        watch: &dyn Stopwatch,
        tally: &mut Tally,
    ) -> Result<(), StepFault> {
        let (start, before) = (watch.now_ns(), self.elapsed);
        let late = || before.reaches(self.budget_ns, watch, start);
        let stepper = &mut self.stepper;
        let report = self.elapsed.count(watch, || stepper.finish(body, late))?;
        tally.solve = Some(self.elapsed.0);
        self.is_busy = self.renewals.is_some() && report.iterations > MUCH_WORK;
        if self.renewals.is_some() {
            let time = report.iterations as f64 * ITERATION;
            self.passed = ((time / self.h) as u32).max(1);
        }
        tally.solved = Some((
            report.iterations,
            report.converged,
            report.residual / report.reference.max(f64::MIN_POSITIVE),
        ));
        // While a tear renews the stepper, the refresher of the stepper before may still be under way.
        if !self.lent
            && let Some(refresher) = self.stepper.lend()
        {
            self.lent = true;
            self.background.begin(refresher);
        }
        Ok(())
    }

    /// Prepares the solver for the tears of `body`, which has made this number of edits.
    pub(super) fn begin_tears(&mut self, body: &Body, edits: usize) {
        let room = body
            .surface()
            .map_or(0, |s| s.limits().vertices - s.vertex_count());
        self.stepper.reserve_pairs(MOST_PAIRS);
        self.renewals = Some(Renewals::new(
            body,
            &self.stepper,
            self.real,
            self.h,
            (edits, room),
        ));
    }

    /// Makes `edits` on `body`, the copy for which the solver was made.
    ///
    /// # Errors
    /// [`TearingError`] for an edit that the copy cannot make.
    pub(super) fn catch_up(&mut self, body: &mut Body, edits: &[Edit]) -> Result<(), TearingError> {
        catch_up(&mut self.stepper, body, edits)
    }

    /// Takes the pairs that let go from a solver that this one replaces.
    pub(super) fn take_pairs(&mut self, running: &mut Self, body: &Body) {
        self.stepper.take_pairs(&mut running.stepper, body);
    }

    /// Lets the tears of `body` grow after a step, as far as the change allows that is `under_way`. Returns whether the topology
    /// has changed. See [`Tearing::advance_among`] for `is_clear`.
    pub(super) fn tear(
        &mut self,
        body: &mut Body,
        tearing: &mut Tearing,
        under_way: UnderWay,
        is_clear: &IsClear<'_>,
        tally: &mut Tally,
    ) -> bool {
        let before = tearing.journal().len();
        if under_way == UnderWay::Mesh {
            tearing.rest(body, &mut self.stepper);
        } else {
            tearing.advance_among(body, &mut self.stepper, is_clear);
        }
        if let Some(renewals) = &mut self.renewals
            && under_way == UnderWay::Nothing
        {
            // If the thread has ended, the stepper in use stays in use.
            let landed = renewals.land(body, &mut self.stepper, tearing.journal(), self.passed);
            if landed.unwrap_or(false) {
                tally.renewed += 1;
                // A factor that is still made belongs to the stepper before.
                self.read = false;
            }
            renewals.begin(body, &self.stepper, tearing.journal());
        }
        let torn = tearing.journal().len() > before;
        self.is_busy |= torn;
        torn
    }

    /// The limit of the tip that is nearest to its next edge, after a condensation. `slope` is called with the handle, the motion and the
    /// slope of each motion.
    pub(super) fn tear_limit(
        &mut self,
        body: &Body,
        tearing: &mut Tearing,
        slope: &mut dyn FnMut(usize, usize, f64),
    ) -> Option<TearLimit> {
        let shapes = &self.shapes;
        let mut slopes = [0.0; 6 * MAX_HANDLES];
        let slopes = slopes.get_mut(..shapes.motions().count())?;
        let limit = tearing.limit(
            body,
            &self.stepper,
            &|motion, node| shapes.displacement(motion, node),
            slopes,
        )?;
        for ((handle, motion), found) in shapes.motions().zip(slopes) {
            slope(handle, motion, *found);
        }
        Some(limit)
    }

    /// Reads ahead what a later step will need. Called once after each step, when its model has been published.
    pub(super) fn read_ahead(&mut self) {
        if self.parts > 0 {
            self.receive();
        }
    }

    /// Elastic energy of the body (J) after the last step.
    pub(super) fn elastic_energy(&self) -> f64 {
        // The stepper already has the energy.
        self.stepper.elastic_energy()
    }

    /// Takes from the last step what a local model needs, before the models of other bodies are made.
    ///
    /// # Errors
    /// [`StepFault`].
    pub(super) fn see(&mut self, body: &Body, period: f64) -> Result<(), StepFault> {
        if self.options.is_some() {
            self.shapes.see(&mut self.stepper, body, period)?;
        }
        Ok(())
    }

    /// The limit that the hands reach first: of the contacts of the body with what it touches, or of those that close before the
    /// next model. Called after a condensation. `slope` is called with the handle, the motion and the slope of each motion.
    pub(super) fn contact_limit(
        &mut self,
        body: &Body,
        period: f64,
        around: &mut Around<'_, f64>,
        slope: &mut dyn FnMut(usize, usize, f64),
    ) -> Option<TearLimit> {
        let mut slopes = [0.0; 6 * MAX_HANDLES];
        let mut limit = self.shapes.limit(around, &mut slopes);
        if let Some(options) = self
            .options
            .filter(|_| around.coming.len() > around.springs.len())
        {
            let mut touching = [0.0; 6 * MAX_HANDLES];
            let count = self.shapes.motions().count();
            around.springs = around.coming;
            let (stepper, closed) = (&mut self.stepper, &mut self.closed);
            let made = closed.condense_among(stepper, body, period, &options, Some(&mut *around));
            let touch = made.is_ok().then_some(()).and_then(|()| {
                let touching = touching.get_mut(..count)?;
                self.closed.touch(&self.shapes, around, touching)
            });
            let until = |limit: &TearLimit, slopes: &[f64]| self.shapes.until(limit, slopes);
            if let Some(touch) = touch
                && limit.is_none_or(|limit| until(&touch, &touching) < until(&limit, &slopes))
            {
                (limit, slopes) = (Some(touch), touching);
            }
        }
        let limit = limit?;
        for ((handle, motion), found) in self.shapes.motions().zip(slopes) {
            slope(handle, motion, found);
        }
        Some(limit)
    }

    /// The matrices of a local model that is published every `period` seconds, with what the body touches; `None` if the scheme
    /// does not use them.
    ///
    /// # Errors
    /// [`StepFault`].
    pub(super) fn condense(
        &mut self,
        body: &Body,
        period: f64,
        around: Option<&mut Around<'_, f64>>,
    ) -> Result<Option<&Condensed>, StepFault> {
        let Some(mut options) = self.options else {
            return Ok(None);
        };
        let keeps = self.is_busy && self.kept < MOST_KEPT;
        self.kept = if keeps { self.kept + 1 } else { 0 };
        if keeps {
            options.at_a_time = 0;
        }
        let stepper = &mut self.stepper;
        let (condensed, _) = self
            .shapes
            .condense_among(stepper, body, period, &options, around)?;
        Ok(Some(condensed))
    }
}
