//! Time steps that are solved to a tolerance: implicit Euler, and TR-BDF2 with little damping of its own (`substep`).
//!
//! A handle moves at constant velocity over a step, and loads go evenly from what they were to what they will be: each
//! stage has those of its own time. A step that does not converge is taken in halves; one that cannot be taken leaves
//! the body as it was.

mod substep;

use super::newton::{Newton, NewtonOptions, NewtonReport, check_digits};
use crate::Vec3;
use crate::body::Body;
use crate::body::guard::Guard;
use crate::body::handle::{HandlePose, HandleReport};
use crate::error::{CondenseError, StepError};

/// How time is discretized.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimeScheme {
    /// First order, strongly damped.
    #[default]
    ImplicitEuler,
    /// Second order, two solves a step.
    TrBdf2,
}

/// How a step is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegratorOptions {
    /// The scheme.
    pub scheme: TimeScheme,
    /// When a solve stops.
    pub newton: NewtonOptions,
    /// How often a step may be halved.
    pub max_halvings: u32,
    /// Whether a step that turns further elements inside out is taken in halves too.
    pub refuse_inversion: bool,
}

impl Default for IntegratorOptions {
    fn default() -> Self {
        Self {
            scheme: TimeScheme::default(),
            newton: NewtonOptions::default(),
            max_halvings: 8,
            refuse_inversion: false,
        }
    }
}

/// How a step went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Substeps taken; 1 where nothing was halved.
    pub substeps: usize,
    /// Attempts that were thrown away.
    pub refused: usize,
    /// Substeps taken by implicit Euler, for TR-BDF2 would have made energy.
    pub damped: usize,
    /// Newton iterations, all together.
    pub iterations: usize,
    /// The worst residual of any solve kept, as a fraction of the forces that balance.
    pub relative_residual: f64,
    /// The last solve.
    pub last: NewtonReport,
}

/// Steps one body again and again without allocating.
#[derive(Debug)]
pub struct Integrator {
    options: IntegratorOptions,
    /// The epoch of the body for which everything here is made.
    epoch: u64,
    newton: Newton,
    anchor: Vec<Vec3>,
    predicted: Vec<Vec3>,
    held: Vec<Vec3>,
    /// State at the start of the substep.
    x: Vec<Vec3>,
    v: Vec<Vec3>,
    /// Positions after the first stage.
    middle: Vec<Vec3>,
    /// State at the start of the step, and what was reported of it.
    kept: (Vec<Vec3>, Vec<Vec3>),
    reports: Vec<HandleReport>,
    reactions: Vec<Vec3>,
    grip: Vec<Vec3>,
    aims: Vec<HandlePose>,
    guard: Guard,
    /// The most that hands, and the change of loads, can have put in over the substep (J).
    work: f64,
    /// Loads (N) by node at the start of the step and at its end; where they differ, `ramped`.
    loads: (Vec<Vec3>, Vec<Vec3>),
    ramped: bool,
    /// Fractions of the step at which the substep starts and ends.
    span: (f64, f64),
    /// The most that rounding left open of the motion in any step, and the farthest from rest that the body was then
    /// (m).
    open: f64,
    moved: f64,
}

/// `fraction` of the way between two poses.
pub(crate) fn between(from: &HandlePose, to: &HandlePose, fraction: f64) -> HandlePose {
    if fraction == 1.0 {
        return *to;
    }
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis() * fraction;
    HandlePose {
        position: from.position + (to.position - from.position) * fraction,
        rotation: nalgebra::UnitQuaternion::from_scaled_axis(turn) * from.rotation,
    }
}

impl Integrator {
    /// Memory for `body`'s topology.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`].
    pub fn new(body: &Body, options: IntegratorOptions) -> Result<Self, CondenseError> {
        let zeros = vec![Vec3::zeros(); body.state.x.len()];
        let reports: Vec<HandleReport> =
            body.constraints.handles.iter().map(|h| h.report).collect();
        Ok(Self {
            options,
            epoch: body.epoch(),
            newton: Newton::new(body, options.newton)?,
            anchor: zeros.clone(),
            predicted: zeros.clone(),
            held: vec![Vec3::zeros(); body.assembly.grip.len()],
            x: zeros.clone(),
            v: zeros.clone(),
            middle: zeros.clone(),
            kept: (zeros.clone(), zeros.clone()),
            loads: (zeros.clone(), zeros),
            ramped: false,
            span: (0.0, 1.0),
            open: 0.0,
            moved: 0.0,
            aims: reports.iter().map(|report| report.pose).collect(),
            reports,
            reactions: Vec::with_capacity(body.constraints.supports.list.len()),
            grip: body.assembly.grip.clone(),
            guard: Guard::default(),
            work: 0.0,
        })
    }

    /// Makes its memory anew where `body` has begun another epoch since.
    fn follow(&mut self, body: &Body) -> Result<(), CondenseError> {
        if self.epoch != body.epoch() {
            let (open, moved) = (self.open, self.moved);
            *self = Self::new(body, self.options)?;
            (self.open, self.moved) = (open, moved);
        }
        Ok(())
    }

    /// The same as [`step`](Self::step) under forces on the vertices, beside gravity, that go evenly from those that
    /// `body` has to `forces` (N), which it has afterwards. Loads that jump are
    /// [set](Body::set_external_forces) between steps instead.
    ///
    /// # Errors
    ///
    /// [`StepError`], with [`StepError::Forces`] for forces that [`Body::set_external_forces`] would refuse; the body
    /// keeps its state and its forces then.
    pub fn step_loaded(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        forces: &[Vec3],
    ) -> Result<StepReport, StepError> {
        self.follow(body).map_err(StepError::Matrix)?;
        self.loads.0.copy_from_slice(&body.model.external);
        body.set_external_forces(forces)
            .map_err(StepError::Forces)?;
        self.loads.1.copy_from_slice(&body.model.external);
        self.ramped = self.loads.0 != self.loads.1;
        let result = self.step(body, h, targets);
        self.ramped = false;
        if result.is_err() {
            body.model.external.copy_from_slice(&self.loads.0);
        } else {
            body.model.external.copy_from_slice(&self.loads.1);
        }
        result
    }

    /// Whether the motion so far, of which `body` is the end, has digits enough: the most that rounding left open in a
    /// step is a hundredth of the motion from rest at most. A motion that begins gently has none in its first steps,
    /// so the whole of it is judged.
    ///
    /// # Errors
    ///
    /// [`StepError::Rounding`].
    pub fn check_digits(&self, body: &Body) -> Result<(), StepError> {
        check_digits(body, self.open, self.moved.max(body.moved()))
    }

    /// Advances `body` by `h` seconds to the handle poses `targets`, one per handle.
    ///
    /// # Errors
    ///
    /// [`StepError`]; the body keeps its state then.
    pub fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
    ) -> Result<StepReport, StepError> {
        body.check_step(h, targets)?;
        self.follow(body).map_err(StepError::Matrix)?;
        self.kept.0.copy_from_slice(&body.state.x);
        self.kept.1.copy_from_slice(&body.state.v);
        for (report, handle) in self.reports.iter_mut().zip(&body.constraints.handles) {
            *report = handle.report;
        }
        self.reactions.clear();
        self.reactions.extend(
            body.constraints
                .supports
                .list
                .iter()
                .map(|support| support.reaction),
        );
        self.grip.copy_from_slice(&body.assembly.grip);
        let result = self.halve(body, h, targets);
        if result.is_err() {
            body.state.x.copy_from_slice(&self.kept.0);
            body.state.v.copy_from_slice(&self.kept.1);
            for (handle, report) in body.constraints.handles.iter_mut().zip(&self.reports) {
                handle.report = *report;
            }
            for (support, reaction) in body
                .constraints
                .supports
                .list
                .iter_mut()
                .zip(&self.reactions)
            {
                support.reaction = *reaction;
            }
            body.assembly.grip.copy_from_slice(&self.grip);
            body.assembly.fresh = false;
        }
        result
    }

    fn halve(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
    ) -> Result<StepReport, StepError> {
        let mut report = StepReport::default();
        // Time in units of the smallest substep: exact, so that the step ends where it should.
        let whole = 1_u64 << self.options.max_halvings.min(30);
        let (mut done, mut size) = (0, whole);
        while done < whole {
            self.x.copy_from_slice(&body.state.x);
            self.v.copy_from_slice(&body.state.v);
            let inverted = if self.options.refuse_inversion {
                body.inverted_count()
            } else {
                0
            };
            for i in 0..self.aims.len() {
                let fraction = (done + size) as f64 / whole as f64;
                self.aims[i] = between(&self.reports[i].pose, &targets[i], fraction);
            }
            self.span = (
                done as f64 / whole as f64,
                (done + size) as f64 / whole as f64,
            );
            let fraction = size as f64 / (whole - done) as f64;
            let dt = h * size as f64 / whole as f64;
            let guard = self.guard;
            let outcome = self.substep(body, dt, fraction);
            let good = |newton: &NewtonReport| {
                newton.converged
                    && !(self.options.refuse_inversion && body.inverted_count() > inverted)
            };
            match outcome {
                Ok((newton, damped)) if good(&newton) => {
                    // Only now: a refused attempt must leave the handles' poses for the next.
                    body.report_stage(dt, &self.aims, &self.v);
                    done += size;
                    report.substeps += 1;
                    report.damped += usize::from(damped);
                    if newton.open > 0.0 {
                        self.open = self.open.max(newton.open);
                        self.moved = self.moved.max(body.moved());
                    }
                    report.iterations += newton.iterations;
                    let relative = newton.residual / newton.reference.max(f64::MIN_POSITIVE);
                    report.relative_residual = report.relative_residual.max(relative);
                    report.last = newton;
                    // A power of two that divides what is done keeps the grid.
                    while size < whole - done
                        && done.is_multiple_of(2 * size)
                        && size * 2 <= whole - done
                    {
                        size *= 2;
                    }
                    size = size.min((whole - done).max(1));
                }
                other => {
                    report.refused += 1;
                    let count = body.inverted_count();
                    body.state.x.copy_from_slice(&self.x);
                    body.state.v.copy_from_slice(&self.v);
                    self.guard = guard;
                    if size == 1 {
                        return Err(match other {
                            Ok((newton, _)) if newton.converged => StepError::Inverted { count },
                            Ok((newton, _)) => StepError::NotConverged {
                                iterations: newton.iterations,
                                residual: newton.residual,
                                reference: newton.reference,
                            },
                            Err(error) => error,
                        });
                    }
                    size /= 2;
                }
            }
        }
        Ok(report)
    }
}
