//! Quasi-static equilibrium: Newton's method under loads and displacements that grow in steps.
//!
//! Handles, supports and loads change linearly from their present to their final values, in one load step unless the
//! options ask for more. Loads change either all together, by a factor that gravity shares, or by vertex, while gravity
//! stays: a body that settles under its weight first is loaded afterwards. A load step that does not converge is halved, and the size grows again after a success (the
//! usual incremental procedure: Crisfield, "Non-linear finite element analysis of solids and structures", chapter 9).
//! The velocities of the body are zero afterwards.

use super::integrator::between;
use super::newton::{Newton, NewtonOptions, NewtonReport};
use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::error::{CondenseError, StepError};

/// The options of a search for equilibrium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EquilibriumOptions {
    /// The limits of a solve.
    pub newton: NewtonOptions,
    /// Number of load steps at the start, at least one.
    pub load_steps: u32,
    /// How many times a load step may be halved.
    pub max_halvings: u32,
    /// Whether a load step that inverts further elements is halved, too.
    pub refuse_inversion: bool,
}

impl Default for EquilibriumOptions {
    fn default() -> Self {
        Self {
            newton: NewtonOptions::default(),
            load_steps: 1,
            max_halvings: 10,
            refuse_inversion: true,
        }
    }
}

/// The report of a search for equilibrium.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EquilibriumReport {
    /// Number of load steps taken.
    pub load_steps: usize,
    /// Number of load steps discarded.
    pub refused: usize,
    /// Sum of all Newton iterations.
    pub iterations: usize,
    /// The report of the last solve.
    pub last: NewtonReport,
}

/// Brings one body to equilibrium, repeatedly.
#[derive(Debug)]
pub struct Equilibrium {
    options: EquilibriumOptions,
    /// The topology epoch of the body for which all data here are made.
    epoch: u64,
    newton: Newton,
    first: Vec<Vec3>,
    last: Vec<Vec3>,
    /// The goals of the held nodes, handle by handle (m).
    held: Vec<Vec3>,
    /// The external forces at the beginning and at the end of a solve (N). Both are empty while the forces are constant.
    loads: [Vec<Vec3>; 2],
}

impl Equilibrium {
    /// Allocates the memory for `body`'s topology.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`].
    pub fn new(body: &Body, options: EquilibriumOptions) -> Result<Self, CondenseError> {
        Ok(Self {
            options,
            epoch: body.epoch(),
            newton: Newton::new(body, options.newton)?,
            first: body.state.x.clone(),
            last: body.state.x.clone(),
            held: Vec::with_capacity(body.constraints.held_nodes().count()),
            loads: [Vec::new(), Vec::new()],
        })
    }

    /// Brings `body` to equilibrium with its handles at `targets`, its supports at their set displacements, and the
    /// fraction `load_factor` of its loads. The loads start from the body's present load factor.
    ///
    /// # Errors
    ///
    /// [`StepError`]; the body keeps its state then.
    pub fn solve(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        load_factor: f64,
    ) -> Result<EquilibriumReport, StepError> {
        body.check_step(1.0, targets)?;
        if self.epoch != body.epoch() {
            *self = Self::new(body, self.options).map_err(StepError::Matrix)?;
        }
        if !load_factor.is_finite() {
            return Err(StepError::Load { found: load_factor });
        }
        self.first.copy_from_slice(&body.state.x);
        let load = body.model.load_factor;
        let result = self.advance(body, targets, load, load_factor);
        if result.is_ok() {
            body.state.v.fill(Vec3::zeros());
            // At zero velocity, the reports contain no damping and no inertia.
            self.last.fill(Vec3::zeros());
            body.report_stage(f64::INFINITY, targets, &self.last);
        } else {
            body.state.x.copy_from_slice(&self.first);
            body.model.load_factor = load;
        }
        body.state.motions += 1;
        result
    }

    /// Brings `body` to equilibrium as [`solve`](Self::solve) does, at the body's present load factor, while the forces on
    /// the vertices, in addition to gravity, change linearly from the present forces to `forces` (N). The body keeps
    /// `forces` afterwards.
    ///
    /// # Errors
    ///
    /// [`StepError`], with [`StepError::Forces`] for forces that [`Body::set_external_forces`] refuses; the body keeps
    /// its state and its forces then.
    pub fn solve_loaded(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        forces: &[Vec3],
    ) -> Result<EquilibriumReport, StepError> {
        let before = body.model.external.clone();
        body.set_external_forces(forces)
            .map_err(StepError::Forces)?;
        let after = std::mem::replace(&mut body.model.external, before);
        let loads = [body.model.external.clone(), after];
        if self.epoch != body.epoch() {
            *self = Self::new(body, self.options).map_err(StepError::Matrix)?;
        }
        self.loads = loads;
        let result = self.solve(body, targets, body.model.load_factor);
        let [before, after] = std::mem::take(&mut self.loads);
        body.model.external = if result.is_ok() { after } else { before };
        result
    }

    fn advance(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        load: f64,
        goal: f64,
    ) -> Result<EquilibriumReport, StepError> {
        let mut report = EquilibriumReport::default();
        let widest = 1.0 / f64::from(self.options.load_steps.max(1));
        let narrowest = widest * libm::exp2(-f64::from(self.options.max_halvings));
        let (mut done, mut size) = (0.0, widest);
        while done < 1.0 {
            self.last.copy_from_slice(&body.state.x);
            let inverted = if self.options.refuse_inversion {
                body.inverted_count()
            } else {
                0
            };
            // The last load step ends exactly at the final values.
            let next = if done + size > 1.0 - 0.5 * narrowest {
                1.0
            } else {
                done + size
            };
            self.held.clear();
            for (handle, target) in body.constraints.handles.iter().zip(targets) {
                let pose = between(&handle.report.pose, target, next);
                let goals = handle.offsets.iter();
                self.held
                    .extend(goals.map(|offset| pose.position + pose.rotation * offset));
            }
            body.model.load_factor = if next == 1.0 {
                goal
            } else {
                load + (goal - load) * next
            };
            let [before, after] = &self.loads;
            for (force, (from, to)) in body.model.external.iter_mut().zip(before.iter().zip(after))
            {
                *force = if next == 1.0 {
                    *to
                } else {
                    from + (to - from) * next
                };
            }
            let fraction = if next == 1.0 {
                1.0
            } else {
                (next - done) / (1.0 - done)
            };
            let outcome = self.newton.solve(body, None, &self.held, fraction);
            let good = |newton: &NewtonReport| {
                newton.converged
                    && !(self.options.refuse_inversion && body.inverted_count() > inverted)
            };
            match outcome {
                Ok(newton) if good(&newton) => {
                    done = next;
                    report.load_steps += 1;
                    report.iterations += newton.iterations;
                    report.last = newton;
                    size = (2.0 * size).min(widest);
                }
                // A shorter load step would have even fewer digits.
                Err(error @ StepError::Rounding { .. }) => return Err(error),
                other => {
                    report.refused += 1;
                    let count = body.inverted_count();
                    body.state.x.copy_from_slice(&self.last);
                    size *= 0.5;
                    if size < narrowest {
                        return Err(match other {
                            Ok(newton) if newton.converged => StepError::Inverted { count },
                            Ok(newton) => StepError::NotConverged {
                                iterations: newton.iterations,
                                residual: newton.residual,
                                reference: newton.reference,
                            },
                            Err(error) => error,
                        });
                    }
                }
            }
        }
        Ok(report)
    }
}
