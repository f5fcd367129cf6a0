//! Quasi-static equilibrium: Newton's method under loads and displacements that grow in steps.
//!
//! Handles, supports and loads change linearly from their present to their final values, in one load step unless the
//! options ask for more. Loads change either all together, by a factor that gravity shares, or by vertex, while gravity
//! stays: a body that settles under its weight first is loaded afterwards. A load step that does not converge is halved,
//! and the size grows again after a success (the usual incremental procedure: Crisfield, "Non-linear finite element analysis
//! of solids and structures", chapter 9).
//! A search that ends early leaves the body at the last load step that succeeded. The velocities of the body are zero
//! afterwards. [`in_contact`] has bodies that touch.

pub mod in_contact;
mod lent;
mod pace;

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
        if result.is_err() {
            self.go_back(body, factors);
        }
        self.end(body, targets, |_| {});
        result.map(|()| self.report)
    }

    /// After a failed search: brings the body to the last load step that succeeded.
    fn go_back(&self, body: &mut Body, factors: [f64; 2]) {
        body.state.x.copy_from_slice(&self.last);
        self.load(body, factors, self.report.reached);
        if self.report.reached > 0.0 {
            body.assemble_with(Tangent::Exact);
        }
    }

    /// Ends a search: reports on hands and supports, after `touch` has added the forces of contacts to those of the elements.
    /// A search that took no step leaves the body as it was, with its velocities and its reports.
    fn end(&mut self, body: &mut Body, targets: &[HandlePose], touch: impl FnOnce(&mut Body)) {
        let reached = self.report.reached;
        if reached > 0.0 {
            let handles = body.constraints.handles.iter().zip(targets);
            let poses = handles.map(|(handle, to)| between(&handle.report.pose, to, reached));
            self.poses.clear();
            self.poses.extend(poses);
            body.state.v.fill(Vec3::zeros());
            // At zero velocity, the reports contain no damping and no inertia.
            self.last.fill(Vec3::zeros());
            touch(body);
            body.report_stage(f64::INFINITY, &self.poses, &self.last);
        }
        body.state.motions += 1;
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
        self.load_towards(body, forces)?;
        let result = self.solve(body, targets, body.model.load_factor);
        self.loads = [Vec::new(), Vec::new()];
        result
    }

    /// Has the forces on the vertices change to `forces` (N) in the next search.
    fn load_towards(&mut self, body: &mut Body, forces: &[Vec3]) -> Result<(), StepError> {
        let before = body.model.external.clone();
        body.set_external_forces(forces)
            .map_err(StepError::Forces)?;
        let after = std::mem::replace(&mut body.model.external, before);
        let loads = [body.model.external.clone(), after];
        self.follow(body)?;
        self.loads = loads;
        Ok(())
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
        let options = self.options;
        in_load_steps(&options, &mut |[done, next]| {
            let inverted = self.begin(body, targets, factors, next);
            let guide = Guide::By(part([done, next]));
            let outcome = self.newton.solve(body, None, &self.held, guide);
            match judge(&options, outcome, inverted, body.inverted_count()) {
                Ok(newton) => {
                    let is_open = options.find_snaps && self.report.snapped.is_none();
                    if is_open
                        && newton.clipped + newton.halvings > 0
                        && self.has_snapped(body, targets, factors, [done, next])
                    {
                        self.report.snapped = Some(next);
                    }
                    self.report.add(next, newton);
                    Ok(())
                }
                Err(error) => {
                    if !matches!(error, StepError::Rounding { .. }) {
                        self.report.refused += 1;
                        body.state.x.copy_from_slice(&self.last);
                    }
                    Err(error)
                }
            }
        })
    }

    /// Begins a load step that ends at the fraction `next` of the way. Returns the number of inverted elements before it.
    fn begin(
        &mut self,
        body: &mut Body,
        targets: &[HandlePose],
        factors: [f64; 2],
        next: f64,
    ) -> usize {
        self.last.copy_from_slice(&body.state.x);
        let inverted = if self.options.refuse_inversion {
            body.inverted_count()
        } else {
            0
        };
        self.aim(body, targets, factors, next);
        inverted
    }
}

impl EquilibriumReport {
    /// Adds a load step that ends at the fraction `reached` of the way.
    fn add(&mut self, reached: f64, newton: NewtonReport) {
        self.reached = reached;
        self.load_steps += 1;
        self.iterations += newton.iterations;
        self.last = newton;
    }
}

/// The part of the remaining way that a load step covers.
fn part([done, next]: [f64; 2]) -> f64 {
    if next == 1.0 {
        1.0
    } else {
        (next - done) / (1.0 - done)
    }
}

/// The report of a load step, or the reason why it fails. `inverted` elements were so before, and `now` are.
fn judge(
    options: &EquilibriumOptions,
    outcome: Result<NewtonReport, StepError>,
    inverted: usize,
    now: usize,
) -> Result<NewtonReport, StepError> {
    let newton = outcome?;
    if !newton.converged {
        return Err(StepError::NotConverged {
            iterations: newton.iterations,
            residual: newton.residual,
            reference: newton.reference,
        });
    }
    if options.refuse_inversion && now > inverted {
        return Err(StepError::Inverted { count: now });
    }
    Ok(newton)
}

/// Takes load steps, each from one fraction of the way to another. A step that fails is taken again, half as long.
fn in_load_steps(
    options: &EquilibriumOptions,
    step: &mut dyn FnMut([f64; 2]) -> Result<(), StepError>,
) -> Result<(), StepError> {
    let widest = 1.0 / f64::from(options.load_steps.max(1));
    let narrowest = widest * libm::exp2(-f64::from(options.max_halvings));
    let (mut size, mut done) = (widest, 0.0);
    while done < 1.0 {
        let next = if done + size > 1.0 - 0.5 * narrowest {
            1.0
        } else {
            done + size
        };
        match step([done, next]) {
            Ok(()) => {
                done = next;
                size = (2.0 * size).min(widest);
            }
            // A shorter load step would have even fewer digits.
            Err(error @ StepError::Rounding { .. }) => return Err(error),
            Err(error) => {
                size *= 0.5;
                if size < narrowest {
                    return Err(error);
                }
            }
        }
    }
    Ok(())
}
