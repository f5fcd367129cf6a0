//! Time steps solved to a tolerance: implicit Euler, and TR-BDF2, which adds little damping (`substep`).
//!
//! A handle moves at constant velocity over a step. Loads change linearly from their old to their new values, and each
//! stage has the loads of its own time. A step that does not converge is divided into halves. A step that cannot be
//! taken leaves the body unchanged.

mod substep;

use super::newton::{Newton, NewtonOptions, NewtonReport, check_digits};
use crate::Vec3;
use crate::body::Body;
use crate::body::guard::Guard;
use crate::body::handle::{HandlePose, HandleReport};
use crate::error::{CondenseError, StepError};

/// The time scheme.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TimeScheme {
    /// First order, with strong damping.
    #[default]
    ImplicitEuler,
    /// Second order, with two solves per step.
    TrBdf2,
}

/// The options of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IntegratorOptions {
    /// The scheme.
    pub scheme: TimeScheme,
    /// The limits of a solve.
    pub newton: NewtonOptions,
    /// How many times a step may be halved.
    pub max_halvings: u32,
    /// Whether a step that inverts further elements is halved, too.
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

/// The report of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Number of substeps; 1 if nothing was halved.
    pub substeps: usize,
    /// Number of attempts that were discarded.
    pub refused: usize,
    /// Number of substeps by implicit Euler, because TR-BDF2 would have added energy.
    pub damped: usize,
    /// Sum of all Newton iterations.
    pub iterations: usize,
    /// The largest residual of the accepted solves, as a fraction of the forces that balance.
    pub relative_residual: f64,
    /// The report of the last solve.
    pub last: NewtonReport,
}

/// Advances one body repeatedly without allocating memory.
#[derive(Debug)]
pub struct Integrator {
    options: IntegratorOptions,
    /// The topology epoch of the body for which all data here are made.
    epoch: u64,
    newton: Newton,
    anchor: Vec<Vec3>,
    predicted: Vec<Vec3>,
    /// The goals of the held nodes, handle by handle (m).
    held: Vec<Vec3>,
    /// State at the start of the substep.
    x: Vec<Vec3>,
    v: Vec<Vec3>,
    /// Positions after the first stage.
    middle: Vec<Vec3>,
    /// State at the start of the step, and its reports.
    kept: (Vec<Vec3>, Vec<Vec3>),
    reports: Vec<HandleReport>,
    reactions: Vec<Vec3>,
    grip: Vec<Vec3>,
    aims: Vec<HandlePose>,
    guard: Guard,
    /// An upper bound of the work of hands and of the change of loads over the substep (J).
    work: f64,
    /// Loads (N) by node at the start of the step and at its end. `ramped` tells whether they differ.
    loads: (Vec<Vec3>, Vec<Vec3>),
    ramped: bool,
    /// Fractions of the step at which the substep starts and ends.
    span: (f64, f64),
    /// The largest motion that rounding left undetermined in any step, and the largest displacement from rest in such
    /// steps (m).
    open: f64,
    moved: f64,
}

/// The pose at `fraction` of the path between two poses.
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
    /// Makes an integrator for `body`'s topology.
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
            held: Vec::with_capacity(body.constraints.held_nodes().count()),
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
            grip: body.constraints.grips().copied().collect(),
            guard: Guard::default(),
            work: 0.0,
        })
    }

    /// Makes the integrator again if `body` has begun another topology epoch since.
    fn follow(&mut self, body: &Body) -> Result<(), CondenseError> {
        if self.epoch != body.epoch() {
            let (open, moved) = (self.open, self.moved);
            *self = Self::new(body, self.options)?;
            (self.open, self.moved) = (open, moved);
        }
        Ok(())
    }

    /// Advances `body` as [`step`](Self::step) does, while the forces on the vertices, in addition to gravity, change
    /// linearly from the present forces to `forces` (N). The body keeps `forces` afterwards. Loads that jump are
    /// [set](Body::set_external_forces) between steps instead.
    ///
    /// # Errors
    ///
    /// [`StepError`], with [`StepError::Forces`] for forces that [`Body::set_external_forces`] refuses; the body keeps
    /// its state and its forces then.
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

    /// Checks that the motion so far, which ends at `body`, has enough digits: the largest motion that rounding left
    /// undetermined in a step may be at most a hundredth of the motion from rest. The first steps of a motion that
    /// begins gently do not have these digits, so the whole motion is checked.
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
        self.grip.clear();
        self.grip.extend(body.constraints.grips());
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
            for (grip, kept) in body.constraints.grips_mut().zip(&self.grip) {
                *grip = *kept;
            }
            body.state.motions += 1;
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
        // Time is an integer number of the smallest substeps, so that the step ends exactly at its end.
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
                    // The reports are updated only now, because the next attempt after a refused one needs the old
                    // poses of the handles.
                    body.report_stage(dt, &self.aims, &self.v);
                    done += size;
                    report.substeps += 1;
                    report.damped += usize::from(damped);
                    if newton.open > 0.0 {
                        self.open = self.open.max(newton.open);
                        self.moved = self.moved.max(body.moved());
                    }
                    report.iterations += newton.iterations;
                    report.relative_residual =
                        report.relative_residual.max(newton.relative_residual());
                    report.last = newton;
                    // The size doubles only if the time so far is a multiple of the new size.
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
