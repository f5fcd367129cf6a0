//! Time steps that are solved to a tolerance: implicit Euler, and TR-BDF2 with little damping of its own.
//!
//! TR-BDF2 (Bank et al., "Transient simulation of silicon devices and circuits", 1985; Hosea and Shampine,
//! "Analysis and implementation of TR-BDF2", 1996) takes a trapezoidal stage over `gamma h` and a BDF2 stage
//! to `h`; with `gamma = 2 - sqrt 2` both have the same matrix. It was chosen over BDF2 because it needs no
//! past: a step may be halved, a handle let go or a mesh torn without starting again at first order. It is
//! L-stable, so by von Neumann's theorem the energy of a linear, dissipative body never grows. It costs two
//! solves a step.
//!
//! A substep of TR-BDF2 that would make energy in a body that is not linear is taken by implicit Euler instead
//! (`guard`). A handle moves at constant velocity over a step. A step that does not converge is taken in halves; one
//! that cannot be taken leaves the body as it was.

use super::body::Body;
use super::error::{CondenseError, StepError};
use super::guard::{Energy, Guard};
use super::handle::{HandlePose, HandleReport};
use super::newton::{Newton, NewtonOptions, NewtonReport, Stage};
use crate::Vec3;

/// How time is discretized.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scheme {
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
    pub scheme: Scheme,
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
            scheme: Scheme::default(),
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
    /// The worst residual of any solve kept, as a share of the forces that balance.
    pub relative_residual: f64,
    /// The last solve.
    pub last: NewtonReport,
}

/// 1 - 1 / sqrt 2: half of `gamma`, and the share of the step in both stages' matrix.
const D: f64 = 1.0 - core::f64::consts::FRAC_1_SQRT_2;
const GAMMA: f64 = 2.0 * D;

/// Steps one body again and again without allocating.
#[derive(Debug)]
pub struct Integrator {
    options: IntegratorOptions,
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
    /// The most that hands can have put in over the substep (J).
    work: f64,
}

/// `share` of the way between two poses.
pub(crate) fn between(from: &HandlePose, to: &HandlePose, share: f64) -> HandlePose {
    if share == 1.0 {
        return *to;
    }
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis() * share;
    HandlePose {
        position: from.position + (to.position - from.position) * share,
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
        let zeros = vec![Vec3::zeros(); body.x.len()];
        let reports: Vec<HandleReport> = body.handles.iter().map(|h| h.report).collect();
        Ok(Self {
            options,
            newton: Newton::new(body, options.newton)?,
            anchor: zeros.clone(),
            predicted: zeros.clone(),
            held: vec![Vec3::zeros(); body.grip.len()],
            x: zeros.clone(),
            v: zeros.clone(),
            middle: zeros.clone(),
            kept: (zeros.clone(), zeros),
            aims: reports.iter().map(|report| report.pose).collect(),
            reports,
            reactions: Vec::with_capacity(body.supports.list.len()),
            grip: body.grip.clone(),
            guard: Guard::default(),
            work: 0.0,
        })
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
        self.kept.0.copy_from_slice(&body.x);
        self.kept.1.copy_from_slice(&body.v);
        for (report, handle) in self.reports.iter_mut().zip(&body.handles) {
            *report = handle.report;
        }
        self.reactions.clear();
        self.reactions
            .extend(body.supports.list.iter().map(|support| support.reaction));
        self.grip.copy_from_slice(&body.grip);
        let result = self.halve(body, h, targets);
        if result.is_err() {
            body.x.copy_from_slice(&self.kept.0);
            body.v.copy_from_slice(&self.kept.1);
            for (handle, report) in body.handles.iter_mut().zip(&self.reports) {
                handle.report = *report;
            }
            for (support, reaction) in body.supports.list.iter_mut().zip(&self.reactions) {
                support.reaction = *reaction;
            }
            body.grip.copy_from_slice(&self.grip);
            body.fresh = false;
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
            self.x.copy_from_slice(&body.x);
            self.v.copy_from_slice(&body.v);
            let inverted = if self.options.refuse_inversion {
                body.inverted_count()
            } else {
                0
            };
            for i in 0..self.aims.len() {
                let share = (done + size) as f64 / whole as f64;
                self.aims[i] = between(&self.reports[i].pose, &targets[i], share);
            }
            let share = size as f64 / (whole - done) as f64;
            let dt = h * size as f64 / whole as f64;
            let guard = self.guard;
            let outcome = self.substep(body, dt, share);
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
                    body.x.copy_from_slice(&self.x);
                    body.v.copy_from_slice(&self.v);
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

    /// One substep of `h`, guided axes going `share` of what is left; whether it had to be taken by implicit
    /// Euler instead of the scheme.
    fn substep(
        &mut self,
        body: &mut Body,
        h: f64,
        share: f64,
    ) -> Result<(NewtonReport, bool), StepError> {
        let scheme = self.options.scheme;
        if scheme == Scheme::ImplicitEuler {
            return Ok((self.attempt(body, scheme, h, share)?, false));
        }
        self.guard.begin(Energy::now(body));
        let found = self.attempt(body, scheme, h, share)?;
        if !found.converged {
            return Ok((found, false));
        }
        let after = Energy::now(body);
        if self.guard.allows(body, after, self.work) {
            self.guard.end(after, self.work);
            return Ok((found, false));
        }
        body.x.copy_from_slice(&self.x);
        body.v.copy_from_slice(&self.v);
        let mut safer = self.attempt(body, Scheme::ImplicitEuler, h, share)?;
        safer.iterations += found.iterations;
        self.guard.end(Energy::now(body), self.work);
        Ok((safer, true))
    }

    /// One substep of `h` by `scheme`, guided axes going `share` of what is left.
    fn attempt(
        &mut self,
        body: &mut Body,
        scheme: Scheme,
        h: f64,
        share: f64,
    ) -> Result<NewtonReport, StepError> {
        let mut report = match scheme {
            Scheme::ImplicitEuler => {
                for node in 0..self.x.len() {
                    self.anchor[node] = self.x[node];
                    self.predicted[node] = self.x[node] + self.v[node] * h;
                }
                let report = self.solve(body, h, 1.0, share, h)?;
                self.work = self.hands(body, &self.x);
                report
            }
            Scheme::TrBdf2 => {
                let g = D * h;
                body.assemble();
                for node in 0..self.x.len() {
                    let acceleration = acceleration(body, node);
                    self.anchor[node] = self.x[node] + self.v[node] * g;
                    self.predicted[node] =
                        self.anchor[node] + (self.v[node] + acceleration * g) * g;
                }
                let first = self.solve(body, g, GAMMA, share * GAMMA, h)?;
                if !first.converged {
                    return Ok(first);
                }
                self.work = self.hands(body, &self.x);
                self.middle.copy_from_slice(&body.x);
                let to_middle = 1.0 / (GAMMA * (2.0 - GAMMA));
                let to_start = to_middle - 1.0;
                for node in 0..self.x.len() {
                    let velocity = (self.middle[node] - self.anchor[node]) / g;
                    let v = velocity * to_middle - self.v[node] * to_start;
                    self.anchor[node] = self.middle[node] * to_middle - self.x[node] * to_start;
                    self.predicted[node] = self.anchor[node] + v * g;
                }
                // What is left of the way after the first stage.
                let left = share * (1.0 - GAMMA) / (1.0 - share * GAMMA);
                let mut second = self.solve(body, g, 1.0, left, h)?;
                self.work += self.hands(body, &self.middle);
                second.iterations += first.iterations;
                second.clipped += first.clipped;
                second.halvings += first.halvings;
                second
            }
        };
        let g = if scheme == Scheme::TrBdf2 { D * h } else { h };
        for (node, v) in body.v.iter_mut().enumerate() {
            *v = (body.x[node] - self.anchor[node]) / g;
        }
        self.work += self.push(body);
        report.converged &= body.v.iter().flat_map(Vec3::iter).all(|v| v.is_finite());
        body.fresh = false;
        Ok(report)
    }

    /// The most work (J) that handles and supports can have done on what they hold `from` these positions to
    /// the end of the stage just solved, its inertia left out.
    fn hands(&self, body: &Body, from: &[Vec3]) -> f64 {
        let force = self.newton.residual();
        let moved = |node: usize| body.x[node] - from[node];
        let held = body.stiffness.free()..body.x.len();
        let work: f64 = held
            .map(|node| force[node].norm() * moved(node).norm())
            .sum();
        work + body.supports.work(|node| force[node], moved)
    }

    /// The same that its inertia took.
    fn push(&self, body: &Body) -> f64 {
        let gained = |node: usize| {
            let (now, then) = (&body.v[node], &self.v[node]);
            (now.component_mul(now) - then.component_mul(then)) * (0.5 * body.mass[node])
        };
        let held = body.stiffness.free()..body.x.len();
        let work: f64 = held.map(|node| gained(node).abs().sum()).sum();
        work + body.supports.work(gained, |_| Vec3::repeat(1.0))
    }

    /// Solves a stage that ends `part` of a substep of `h` after its start.
    fn solve(
        &mut self,
        body: &mut Body,
        g: f64,
        part: f64,
        share: f64,
        h: f64,
    ) -> Result<NewtonReport, StepError> {
        let free = body.stiffness.free();
        for (handle, aim) in body.handles.iter().zip(&self.aims) {
            let pose = between(&handle.report.pose, aim, part);
            for (node, offset) in handle.nodes().zip(&handle.offsets) {
                let goal = pose.position + pose.rotation * offset;
                let velocity = (goal - self.x[node]) / (part * h);
                self.held[node - free] = goal;
                self.anchor[node] = goal - velocity * g;
                self.predicted[node] = goal;
            }
        }
        if let Some(mask) = body.supports.mask() {
            // Where the guided axes will be, by the same rule as the solver's.
            body.displacement[..free].fill(Vec3::zeros());
            body.supports
                .prescribe(&body.x, share, &mut body.displacement);
            for node in 0..free {
                for axis in 0..3 {
                    if mask[node][axis] == 0.0 {
                        let goal = body.x[node][axis] + body.displacement[node][axis];
                        let velocity = (goal - self.x[node][axis]) / (part * h);
                        self.anchor[node][axis] = goal - velocity * g;
                        self.predicted[node][axis] = goal;
                    }
                }
            }
        }
        let stage = Stage {
            anchor: &self.anchor,
            predicted: &self.predicted,
            g,
        };
        self.newton.solve(body, Some(stage), &self.held, share)
    }
}

/// Acceleration of a node at the present state, from forces as just assembled.
fn acceleration(body: &Body, node: usize) -> Vec3 {
    let mut force = body.internal[node] + body.external[node] * body.load_factor
        - body.v[node] * (body.config.mass_damping * body.mass[node]);
    if body.config.stiffness_damping > 0.0 {
        force -= body.stiffness.row_product(node, &body.v) * body.config.stiffness_damping;
    }
    force / body.mass[node]
}
