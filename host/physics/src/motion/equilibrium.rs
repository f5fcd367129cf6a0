//! Quasi-static equilibrium: Newton's method under loads and displacements that grow in steps.
//!
//! Handles, supports and loads change linearly from their present to their final values, in one load step unless the
//! options ask for more. Loads change either all together, by a factor that gravity shares, or by vertex, while gravity
//! stays: a body that settles under its weight first is loaded afterwards. A load step that does not converge is halved,
//! and the size grows again after a success (the usual incremental procedure: Crisfield, "Non-linear finite element analysis
//! of solids and structures", chapter 9).
//! A search that ends early leaves the body at the last load step that succeeded. The velocities of the body are zero
//! afterwards.

use super::integrator::between;
use super::newton::{Guide, Newton, NewtonOptions, NewtonReport};
use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::error::{CondenseError, StepError};
use crate::material::Tangent;

/// A body that returns to its place within this fraction of its motion has not snapped.
const RETURNED: f64 = 0.1;

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
    /// Whether to find out if the body [snapped](EquilibriumReport::snapped). It costs a second solve of each load step
    /// that passed a place where the body is not stable.
    pub find_snaps: bool,
}

impl Default for EquilibriumOptions {
    fn default() -> Self {
        Self {
            newton: NewtonOptions::default(),
            load_steps: 1,
            max_halvings: 10,
            refuse_inversion: true,
            find_snaps: false,
        }
    }
}

/// The report of a search for equilibrium.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EquilibriumReport {
    /// Fraction of the way from the first to the final values that the load steps cover: 1 after a success.
    pub reached: f64,
    /// Number of load steps taken.
    pub load_steps: usize,
    /// Number of load steps discarded.
    pub refused: usize,
    /// Sum of all Newton iterations.
    pub iterations: usize,
    /// The report of the last solve.
    pub last: NewtonReport,
    /// The way (as `reached`) at the end of the first load step in which the body snapped to another balance: with the
    /// loads of before, the body does not return to where it was.
    pub snapped: Option<f64>,
}

/// Brings one body to equilibrium, repeatedly.
#[derive(Debug)]
pub struct Equilibrium {
    options: EquilibriumOptions,
    /// The topology epoch of the body for which all data here are made.
    epoch: u64,
    newton: Newton,
    /// The positions before the present load step (m).
    last: Vec<Vec3>,
    /// The goals of the held nodes, handle by handle (m).
    held: Vec<Vec3>,
    /// The poses of the handles at the end of a search.
    poses: Vec<HandlePose>,
    /// The external forces at the beginning and at the end of a solve (N). Both are empty while the forces are constant.
    loads: [Vec<Vec3>; 2],
    /// The report of the last search, so far as it came.
    report: EquilibriumReport,
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
            last: body.state.x.clone(),
            held: Vec::with_capacity(body.constraints.held_nodes().count()),
            poses: Vec::with_capacity(body.constraints.handles.len()),
            loads: [Vec::new(), Vec::new()],
            report: EquilibriumReport::default(),
        })
    }

    /// The report of the last search. After an error, the report tells how far the search came.
    pub fn report(&self) -> &EquilibriumReport {
        &self.report
    }

    /// Brings `body` to equilibrium with its handles at `targets`, its supports at their set displacements, and the
    /// fraction `load_factor` of its loads. The loads start from the body's present load factor.
    ///
    /// # Errors
    ///
    /// [`StepError`]; the body then stays in the equilibrium of the last load step that succeeded, with the loads and the
    /// handles of that step, the fraction [`reached`](EquilibriumReport::reached) of the way.
    pub fn solve(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        load_factor: f64,
    ) -> Result<EquilibriumReport, StepError> {
        self.report = EquilibriumReport::default();
        body.check_step(1.0, targets)?;
        self.follow(body)?;
        if !load_factor.is_finite() {
            return Err(StepError::Load { found: load_factor });
        }
        let factors = [body.model.load_factor, load_factor];
        let result = self.advance(body, targets, factors);
        let reached = self.report.reached;
        if result.is_err() {
            body.state.x.copy_from_slice(&self.last);
            self.load(body, factors, reached);
        }
        // A search that took no step leaves the body as it was, with its velocities and its reports.
        if reached > 0.0 {
            let handles = body.constraints.handles.iter().zip(targets);
            let poses = handles.map(|(handle, to)| between(&handle.report.pose, to, reached));
            self.poses.clear();
            self.poses.extend(poses);
            if result.is_err() {
                body.assemble_with(Tangent::Exact);
            }
            body.state.v.fill(Vec3::zeros());
            // At zero velocity, the reports contain no damping and no inertia.
            self.last.fill(Vec3::zeros());
            body.report_stage(f64::INFINITY, &self.poses, &self.last);
        }
        body.state.motions += 1;
        result.map(|()| self.report)
    }

    /// Makes the memory again if `body` has begun another topology epoch since.
    fn follow(&mut self, body: &Body) -> Result<(), StepError> {
        if self.epoch != body.epoch() {
            *self = Self::new(body, self.options).map_err(StepError::Matrix)?;
        }
        Ok(())
    }

    /// Brings `body` to equilibrium as [`solve`](Self::solve) does, at the body's present load factor, while the forces on
    /// the vertices, in addition to gravity, change linearly from the present forces to `forces` (N). The body keeps
    /// `forces` afterwards.
    ///
    /// # Errors
    ///
    /// As [`solve`](Self::solve), and [`StepError::Forces`] for forces that [`Body::set_external_forces`] refuses.
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
        self.follow(body)?;
        self.loads = loads;
        let result = self.solve(body, targets, body.model.load_factor);
        self.loads = [Vec::new(), Vec::new()];
        result
    }

    /// Gives `body` the loads at the fraction `at` of the way between two load `factors`, and between two sets of forces.
    fn load(&self, body: &mut Body, factors: [f64; 2], at: f64) {
        // The last load step ends exactly at the final values.
        let [from, to] = factors;
        body.model.load_factor = if at == 1.0 {
            to
        } else {
            from + (to - from) * at
        };
        let [before, after] = &self.loads;
        for (force, (from, to)) in body.model.external.iter_mut().zip(before.iter().zip(after)) {
            *force = if at == 1.0 {
                *to
            } else {
                from + (to - from) * at
            };
        }
    }

    /// Gives the handles and the loads their places and values at the fraction `at` of the way.
    fn aim(&mut self, body: &mut Body, targets: &[HandlePose], factors: [f64; 2], at: f64) {
        self.held.clear();
        for (handle, target) in body.constraints.handles.iter().zip(targets) {
            let pose = between(&handle.report.pose, target, at);
            let goals = handle.offsets.iter();
            self.held
                .extend(goals.map(|offset| pose.position + pose.rotation * offset));
        }
        self.load(body, factors, at);
    }

    /// Whether the body does not return to its balance before the last load step, from `done` to `next`, when that step is
    /// taken back. A body that cannot be taken back has not been seen to snap. The body keeps its state.
    fn has_snapped(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        factors: [f64; 2],
        [done, next]: [f64; 2],
    ) -> bool {
        let there = body.state.x.clone();
        self.aim(body, targets, factors, done);
        let mut balance = |body: &mut Body| {
            let report = self
                .newton
                .solve(body, None, &self.held, Guide::To(&self.last));
            report.is_ok_and(|report| report.converged)
        };
        let returned = balance(body);
        let back = body.state.x.clone();
        // The places before the first load step need not be in balance: a flat pattern draws its mesh to another shape.
        body.state.x.copy_from_slice(&self.last);
        let returned = returned && balance(body);
        let distance = |a: &[Vec3], b: &[Vec3]| {
            let apart = a.iter().zip(b).map(|(a, b)| (a - b).norm());
            apart.fold(0.0, f64::max)
        };
        let moved = distance(&there, &self.last);
        let apart = distance(&back, &body.state.x);
        body.state.x = there;
        self.aim(body, targets, factors, next);
        body.assemble_with(Tangent::Exact);
        returned && apart > RETURNED * moved
    }

    /// Takes the load steps. After an error, `last` has the positions after the last load step that succeeded.
    fn advance(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        factors: [f64; 2],
    ) -> Result<(), StepError> {
        let widest = 1.0 / f64::from(self.options.load_steps.max(1));
        let narrowest = widest * libm::exp2(-f64::from(self.options.max_halvings));
        let mut size = widest;
        while self.report.reached < 1.0 {
            let done = self.report.reached;
            self.last.copy_from_slice(&body.state.x);
            let inverted = if self.options.refuse_inversion {
                body.inverted_count()
            } else {
                0
            };
            let next = if done + size > 1.0 - 0.5 * narrowest {
                1.0
            } else {
                done + size
            };
            self.aim(body, targets, factors, next);
            let fraction = if next == 1.0 {
                1.0
            } else {
                (next - done) / (1.0 - done)
            };
            let outcome = self
                .newton
                .solve(body, None, &self.held, Guide::By(fraction));
            let good = |newton: &NewtonReport| {
                newton.converged
                    && !(self.options.refuse_inversion && body.inverted_count() > inverted)
            };
            match outcome {
                Ok(newton) if good(&newton) => {
                    let is_open = self.options.find_snaps && self.report.snapped.is_none();
                    if is_open
                        && newton.clipped + newton.halvings > 0
                        && self.has_snapped(body, targets, factors, [done, next])
                    {
                        self.report.snapped = Some(next);
                    }
                    let report = &mut self.report;
                    report.reached = next;
                    report.load_steps += 1;
                    report.iterations += newton.iterations;
                    report.last = newton;
                    size = (2.0 * size).min(widest);
                }
                // A shorter load step would have even fewer digits.
                Err(error @ StepError::Rounding { .. }) => return Err(error),
                other => {
                    self.report.refused += 1;
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
        Ok(())
    }
}
