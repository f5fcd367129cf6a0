//! One linearized step of implicit Euler by conjugate gradients on a frozen factor.
//!
//! The equation is that of [`Body::step`](crate::fem::Body::step),
//!
//! ```text
//! A u = M v / h + f_internal + f_external        A = M (1 / h^2 + alpha / h) + K (1 + beta / h)
//! ```
//!
//! with the displacement `u` over the step as the unknown. Nothing is assembled: elements multiply by their own
//! tangent. What makes few iterations enough is the preconditioner, a sparse Cholesky factor of `A` as it was
//! some time ago: elements turn and stretch little from step to step, and conjugate gradients take care of the
//! rest (a frozen factor has long served so, e.g. Courtecuisse et al., "Real-time simulation of contact and
//! cutting of heterogeneous soft-tissues", 2014).
//!
//! Forces and tangent at the end of a step are those with which the next begins, and their energy bounds the
//! step (`guard`) at no cost.

use super::condense::Shapes;
use super::kernel::{Assembled, Kernel, Placed, ScalarMatrix};
use super::panel::Panels;
use super::refresh::Refresher;
use super::sleep::Sleep;
use super::{Node, Real, to_node, to_vec, vectors};
use crate::Vec3;
use crate::fem::cholesky::Kernels;
use crate::fem::guard::{Energy, MOST_HALVINGS};
use crate::fem::{BlockMatrix, Body, CondenseError, HandlePose, StepError};

/// Where conjugate gradients start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Guess {
    /// The velocity stays.
    #[default]
    Velocity,
    /// The velocity changes as in the last step: closer in a smooth motion.
    Acceleration,
}

/// How a step is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepperOptions {
    /// The residual to reach, as a share of the forces that act on the free nodes and of the guess's residual.
    pub tolerance: f64,
    /// Most iterations; the step is taken with what they have found.
    pub max_iterations: usize,
    /// Where they start.
    pub guess: Guess,
    /// A step of more iterations than this asks for a new factor.
    pub patience: usize,
    /// Whether the next step makes it, which takes many times as long as a step. Otherwise someone else has to:
    /// see [`Stepper::lend`].
    pub refresh: bool,
    /// The code that factorizes.
    pub kernels: Kernels,
    /// A body of which no vertex has been faster than this for some steps sleeps (m/s); 0 for none that does. See
    /// `sleep` for what that leaves out.
    pub sleep_speed: f64,
}

impl Default for StepperOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            max_iterations: 100,
            guess: Guess::Acceleration,
            patience: 5,
            refresh: true,
            kernels: Kernels::default(),
            sleep_speed: 1e-7,
        }
    }
}

/// How a step went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepperReport {
    /// Iterations spent.
    pub iterations: usize,
    /// Norm of the residual at the end (N), as the recurrence carries it.
    pub residual: f64,
    /// Norm of the forces that act on the free nodes, and of the guess's residual (N).
    pub reference: f64,
    /// Whether the tolerance was met.
    pub converged: bool,
    /// Share of the motion that was held back, for with all of it the body would have made energy.
    pub held_back: f64,
    /// Whether the body sleeps and nothing was done.
    pub asleep: bool,
}

/// When conjugate gradients stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// At this residual (N).
    pub(super) goal: f64,
    pub(super) max_iterations: usize,
}

/// Steps one body again and again without allocating.
#[derive(Debug)]
pub struct Stepper<T> {
    /// How steps are solved; may be changed between them.
    pub options: StepperOptions,
    /// The place of each node, and the node at each place: free ones first, in an order that fills little.
    pub(super) place: Vec<u32>,
    pub(super) node: Vec<u32>,
    pub(super) free: usize,
    pub(super) kernels: Vec<Box<dyn Kernel<T>>>,
    /// Absent while it is lent.
    pub(super) refresher: Option<Box<Refresher<T>>>,
    pub(super) panels: Panels,
    /// Factors of mass and stiffness in the matrix that was factorized.
    pub(super) factors: Option<(f64, f64)>,
    stale: bool,
    /// Positions (m) by node for which the kernels are linearized.
    pub(super) at: Vec<Vec3>,
    elastic: f64,

    // By place.
    pub(super) rest: Vec<Vec3>,
    pub(super) mass: Vec<f64>,
    /// 1 where an axis of a free place is free, 0 where a support guides it; empty without supports.
    pub(super) mask: Vec<Node<T>>,
    /// Mass in the matrix that is being solved with (kg/s^2).
    pub(super) inertia: Vec<T>,
    pub(super) d: Vec<Node<T>>,
    pub(super) force: Vec<Node<T>>,
    /// Displacement over the step, and over the last.
    pub(super) u: Vec<Node<T>>,
    pub(super) last: Vec<Node<T>>,
    /// The step of which `last` is the displacement (s); 0 where there is none.
    last_h: f64,
    pub(super) residual: Vec<Node<T>>,
    pub(super) z: Vec<Node<f32>>,
    pub(super) p: Vec<Node<T>>,
    pub(super) q: Vec<Node<T>>,
    pub(super) shapes: Option<Box<Shapes>>,
    sleep: Sleep,
    /// Counts linearizations.
    pub(super) state: u64,
}

/// Factors of mass and stiffness in the matrix of a step of `h` seconds.
fn factors(body: &Body, h: f64) -> (f64, f64) {
    (
        1.0 / (h * h) + body.config.mass_damping / h,
        1.0 + body.config.stiffness_damping / h,
    )
}

/// The elements of `body` in the order of places, each set by the best kernel that there is.
fn kernels<T: Real>(
    body: &Body,
    place: &[u32],
    matrix: &BlockMatrix,
    rest: &[Vec3],
) -> Vec<Box<dyn Kernel<T>>> {
    let mut kernels: Vec<Box<dyn Kernel<T>>> = Vec::new();
    for set in &body.elements {
        let mut set = set.boxed();
        set.renumber(place);
        if let Some(tets) = set.corotational_tets() {
            kernels.push(Box::new(Placed::tets(tets, matrix)));
        } else if let Some(triangles) = set.corotational_triangles() {
            kernels.push(Box::new(Placed::triangles(&triangles, matrix)));
        } else {
            set.bind(matrix);
            kernels.push(Box::new(Assembled::new(set, matrix, rest)));
        }
    }
    if let Some(bending) = &body.bending {
        let weights = body
            .stiffness
            .renumbered_weights(bending.weights(), place, matrix);
        kernels.push(Box::new(ScalarMatrix::new(matrix, &weights)));
    }
    kernels
}

impl<T: Real> Stepper<T> {
    /// Memory for `body`'s topology; supports are those that it has now.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`].
    pub fn new(body: &Body, options: StepperOptions) -> Result<Self, CondenseError> {
        let count = body.x.len();
        let free = body.stiffness.free();
        let mut node = super::order::order(&body.stiffness, &body.rest);
        node.extend(free as u32..count as u32);
        let mut place = vec![0; count];
        for (at, &node) in node.iter().enumerate() {
            place[node as usize] = at as u32;
        }
        let by_place = |values: &[Vec3]| -> Vec<Vec3> {
            node.iter().map(|&node| values[node as usize]).collect()
        };
        let rest = by_place(&body.rest);
        let matrix = body.stiffness.renumbered(&place);
        let kernels = || kernels(body, &place, &matrix, &rest);
        let guided = body.supports.mask().map_or_else(Vec::new, |mask| {
            let free = &node[..free];
            free.iter().map(|&node| mask[node as usize]).collect()
        });
        let mass: Vec<f64> = node.iter().map(|&node| body.mass[node as usize]).collect();
        let kept = kernels();
        let mask = guided.iter().map(to_node).collect();
        let refresher = Refresher::new(
            kernels(),
            matrix.clone(),
            mass.clone(),
            guided,
            options.kernels,
        )?;
        let zeros = vec![[T::ZERO; 4]; count];
        Ok(Self {
            options,
            kernels: kept,
            panels: refresher.panels(),
            refresher: Some(Box::new(refresher)),
            place,
            node,
            free,
            mass,
            factors: None,
            stale: true,
            at: vec![Vec3::repeat(f64::NAN); count],
            elastic: 0.0,
            rest,
            mask,
            inertia: vec![T::ZERO; count],
            d: zeros.clone(),
            force: zeros.clone(),
            u: zeros.clone(),
            last: zeros.clone(),
            last_h: 0.0,
            residual: zeros.clone(),
            z: vec![[0.0; 4]; free],
            p: zeros.clone(),
            q: zeros,
            shapes: None,
            sleep: Sleep::new(body),
            state: 0,
        })
    }

    /// Whether there has been a step, from which a factor is left.
    pub(super) fn is_ready(&self) -> bool {
        self.factors.is_some()
    }

    /// Makes the first factor, for steps of `h` seconds: otherwise the first step does, and is late.
    ///
    /// # Errors
    ///
    /// [`StepError::StepLength`] and [`StepError::Matrix`].
    pub fn prepare(&mut self, body: &Body, h: f64) -> Result<(), StepError> {
        if !(h > 0.0 && h.is_finite()) {
            return Err(StepError::StepLength { found: h });
        }
        if body.x != self.at {
            self.at.copy_from_slice(&body.x);
            self.linearize();
        }
        self.refresh(factors(body, h)).map_err(StepError::Matrix)
    }

    /// Advances `body` by `h` seconds to the handle poses `targets`, one per handle. `out_of_time` is asked
    /// after each iteration; where it says so, the step is taken with what has been found.
    ///
    /// A solve that runs out of time or iterations is no error: the report says how far it came.
    ///
    /// # Errors
    ///
    /// [`StepError`]; the body keeps its state then.
    pub fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        mut out_of_time: impl FnMut() -> bool,
    ) -> Result<StepperReport, StepError> {
        body.check_step(h, targets)?;
        let factors = factors(body, h);
        let (mass_factor, stiffness_factor) = factors;
        let speed = self.options.sleep_speed;
        if body.x != self.at {
            self.sleep.wake();
            self.at.copy_from_slice(&body.x);
            self.linearize();
            self.last_h = 0.0;
        }
        if speed > 0.0 && self.sleep.goes_on(body, h, targets, speed) {
            return Ok(StepperReport {
                converged: true,
                asleep: true,
                ..StepperReport::default()
            });
        }
        if self.factors != Some(factors) || (self.stale && self.options.refresh) {
            self.refresh(factors).map_err(StepError::Matrix)?;
        }
        self.prescribe(body, h, targets);
        let reference = self.start(body, h, mass_factor, stiffness_factor);
        let reference = reference.hypot(self.norm());
        let limits = Limits {
            goal: self.options.tolerance * reference,
            max_iterations: self.options.max_iterations,
        };
        let mut report = self.iterate(factors, limits, &mut out_of_time);
        report.reference = reference;
        self.stale |= report.iterations > self.options.patience;
        self.finish(body, h, targets, &mut report)?;
        if speed > 0.0 && report.converged {
            self.sleep.observe(body, h, targets, speed);
        } else {
            self.sleep.wake();
        }
        Ok(report)
    }

    /// Forces, tangent and energy at the positions `self.at`.
    fn linearize(&mut self) {
        for ((d, rest), &node) in self.d.iter_mut().zip(&self.rest).zip(&self.node) {
            *d = to_node(&(self.at[node as usize] - rest));
        }
        self.state += 1;
        self.linearize_elements();
    }

    /// Forces, tangent and energy at the displacements `self.d`.
    pub(super) fn linearize_elements(&mut self) {
        self.force.fill([T::ZERO; 4]);
        self.elastic = 0.0;
        for kernel in &mut self.kernels {
            self.elastic += kernel.linearize(&self.d, &mut self.force);
        }
    }

    /// A new factor of the matrix as it is, where the refresher is at hand; otherwise the old one has to do.
    pub(super) fn refresh(&mut self, factors: (f64, f64)) -> Result<(), CondenseError> {
        if let Some(refresher) = &mut self.refresher {
            refresher.load(&self.d, factors);
            refresher.work()?;
            self.factors = refresher.exchange(&mut self.panels);
            self.stale = false;
        }
        Ok(())
    }

    /// Where a new factor is worth its while, what makes it: [`work`](Refresher::work) it, on any thread, and
    /// [give it back](Self::give_back). With [`StepperOptions::refresh`] off nobody else does.
    pub fn lend(&mut self) -> Option<Box<Refresher<T>>> {
        if !self.stale {
            return None;
        }
        let factors = self.factors?;
        let mut refresher = self.refresher.take()?;
        refresher.load(&self.d, factors);
        Some(refresher)
    }

    /// Takes the refresher back, and the factor that it has made.
    pub fn give_back(&mut self, mut refresher: Box<Refresher<T>>) {
        if let Some(factors) = refresher.exchange(&mut self.panels) {
            self.factors = Some(factors);
            self.stale = false;
        }
        self.refresher = Some(refresher);
    }

    /// The displacement to start from, with what handles and supports prescribe.
    fn prescribe(&mut self, body: &mut Body, h: f64, targets: &[HandlePose]) {
        let free = self.free;
        let known = self.last_h > 0.0 && self.options.guess == Guess::Acceleration;
        for place in 0..free {
            let node = self.node[place] as usize;
            let v = body.v[node];
            let mut u = v * h;
            if known {
                u += (v - to_vec(&self.last[place]) / self.last_h) * h;
            }
            body.displacement[node] = u;
        }
        body.prescribe(targets);
        for (u, &node) in self.u.iter_mut().zip(&self.node) {
            *u = to_node(&body.displacement[node as usize]);
        }
        for (last, &node) in self.last[..free].iter_mut().zip(&self.node) {
            *last = to_node(&(body.v[node as usize] * h));
        }
        self.last_h = h;
    }

    /// The residual of the guess; returns the norm of the forces that act on the free nodes (N).
    fn start(&mut self, body: &Body, h: f64, mass_factor: f64, stiffness_factor: f64) -> f64 {
        let mut reference = 0.0;
        for (place, r) in self.residual.iter_mut().enumerate() {
            let node = self.node[place] as usize;
            let mass = self.mass[place];
            let internal = to_vec(&self.force[place]);
            let external = body.external[node] * body.load_factor;
            let inertia = body.v[node] / h - to_vec(&self.u[place]) * mass_factor;
            *r = to_node(&(internal + external + inertia * mass));
            if place < self.free {
                reference += internal.norm_squared() + external.norm_squared();
            }
        }
        for kernel in &self.kernels {
            kernel.product(-T::of(stiffness_factor), &self.u, &mut self.residual);
        }
        reference.sqrt()
    }

    /// Conjugate gradients from `u` and `residual` (Saad, "Iterative methods for sparse linear systems",
    /// algorithm 9.1). Held places have no direction; their residual is carried along: minus the hand's force.
    pub(super) fn iterate(
        &mut self,
        (mass_factor, stiffness_factor): (f64, f64),
        limits: Limits,
        out_of_time: &mut impl FnMut() -> bool,
    ) -> StepperReport {
        let free = self.free;
        for (inertia, mass) in self.inertia.iter_mut().zip(&self.mass) {
            *inertia = T::of(mass_factor * mass);
        }
        let mut report = StepperReport {
            residual: self.norm(),
            ..StepperReport::default()
        };
        report.converged = report.residual <= limits.goal;
        let mut rz = 1.0;
        while !report.converged && report.iterations < limits.max_iterations {
            let rz_new = self.precondition();
            let beta = if report.iterations == 0 {
                0.0
            } else {
                rz_new / rz
            };
            rz = rz_new;
            vectors::turn(
                &self.z,
                T::of(beta),
                &self.inertia,
                &mut self.p[..free],
                &mut self.q[..free],
            );
            self.q[free..].fill([T::ZERO; 4]);
            for kernel in &self.kernels {
                kernel.product(T::of(stiffness_factor), &self.p, &mut self.q);
            }
            let curvature = vectors::dot(&self.p[..free], &self.q[..free]);
            // The matrix is positive definite: anything else is underflow, or a state that has blown up.
            if !(curvature > 0.0 && curvature.is_finite()) {
                break;
            }
            let alpha = T::of(rz / curvature);
            // Held places have no direction, but a residual.
            let (free_residual, held_residual) = self.residual.split_at_mut(free);
            let (free_q, held_q) = self.q.split_at(free);
            let square = vectors::advance(
                alpha,
                &self.p[..free],
                free_q,
                &mut self.u[..free],
                free_residual,
            );
            for (r, q) in held_residual.iter_mut().zip(held_q) {
                for i in 0..4 {
                    r[i] -= alpha * q[i];
                }
            }
            report.iterations += 1;
            report.residual = if self.mask.is_empty() {
                square.sqrt()
            } else {
                self.norm()
            };
            report.converged = report.residual <= limits.goal;
            if out_of_time() {
                break;
            }
        }
        report
    }

    /// `z` from the residual, without what is guided; returns their product.
    pub(super) fn precondition(&mut self) -> f64 {
        vectors::round(&self.residual, &mut self.z);
        vectors::filter(&self.mask, &mut self.z);
        self.panels.solve(&mut self.z);
        vectors::filter(&self.mask, &mut self.z);
        vectors::dot_single(&self.z, &self.residual)
    }

    /// Norm of the residual on what is free (N).
    pub(super) fn norm(&self) -> f64 {
        let free = &self.residual[..self.free];
        if self.mask.is_empty() {
            return vectors::dot(free, free).sqrt();
        }
        let mut sum = 0.0;
        for (r, mask) in free.iter().zip(&self.mask) {
            let r = to_vec(r).component_mul(&to_vec(mask));
            sum += r.norm_squared();
        }
        sum.sqrt()
    }

    /// Takes the step into `body`, and linearizes where it ends.
    fn finish(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
        report: &mut StepperReport,
    ) -> Result<(), StepError> {
        for (u, &node) in self.u.iter().zip(&self.node) {
            body.displacement[node as usize] = to_vec(u);
        }
        let work = body.take_grip_from(h, |node| self.pull(node));
        let mut moves = body.displacement.iter().flat_map(Vec3::iter);
        let sound = moves.all(|u| (u / h).is_finite())
            && body.grip.iter().flat_map(Vec3::iter).all(|f| f.is_finite())
            && report.residual.is_finite();
        if !sound {
            body.grip.fill(Vec3::zeros());
            self.last_h = 0.0;
            return Err(StepError::Diverged {
                iterations: report.iterations,
            });
        }
        report.held_back = self.end_where_energy_allows(body, h, work);
        if report.held_back > 0.0 {
            self.pull_at_the_end(body, h);
            body.take_grip_from(h, |node| self.pull(node));
        }
        body.report_step(h, targets, |node| self.pull(node));
        body.x.copy_from_slice(&self.at);
        for (v, u) in body.v.iter_mut().zip(&body.displacement) {
            *v = u / h;
        }
        body.fresh = false;
        Ok(())
    }

    /// The force of a hand or support on a node (N): what the equation leaves over.
    fn pull(&self, node: usize) -> Vec3 {
        -to_vec(&self.residual[self.place[node] as usize])
    }

    /// Linearizes where the step ends, which is nearer than the solver found where that would make energy;
    /// returns the share held back.
    fn end_where_energy_allows(&mut self, body: &mut Body, h: f64, work: f64) -> f64 {
        let mut guard = body.guard;
        guard.begin(Energy::new(
            body.kinetic_energy() + self.elastic,
            body.load_potential(),
        ));
        let mut after = self.energy_ahead(body, h);
        let mut kept = 1.0;
        if !guard.allows(body, after, work) {
            let drift = body.free_drift();
            for _ in 0..MOST_HALVINGS {
                body.scale_motion(0.5, &drift);
                let shorter = self.energy_ahead(body, h);
                if !shorter.is_below(&after) {
                    body.scale_motion(2.0, &drift);
                    after = self.energy_ahead(body, h);
                    break;
                }
                after = shorter;
                kept *= 0.5;
                if guard.allows(body, after, work) {
                    break;
                }
            }
        }
        guard.end(after, work);
        body.guard = guard;
        1.0 - kept
    }

    /// Energy after the displacement as it is; linearized there.
    fn energy_ahead(&mut self, body: &Body, h: f64) -> Energy {
        for ((at, x), u) in self.at.iter_mut().zip(&body.x).zip(&body.displacement) {
            *at = x + u;
        }
        self.linearize();
        let moving = body.displacement.iter().zip(&body.mass);
        let kinetic: f64 = moving
            .map(|(u, mass)| 0.5 * mass * (u / h).norm_squared())
            .sum();
        Energy::new(kinetic + self.elastic, body.load_potential_at(&self.at))
    }

    /// The residual of the equation of motion with forces as they are at the end of the step.
    fn pull_at_the_end(&mut self, body: &Body, h: f64) {
        let drag = body.config.mass_damping / h;
        for (place, r) in self.residual.iter_mut().enumerate() {
            let node = self.node[place] as usize;
            let u = body.displacement[node];
            let inertia = (body.v[node] - u / h) / h - u * drag;
            let external = body.external[node] * body.load_factor;
            *r = to_node(&(to_vec(&self.force[place]) + external + inertia * self.mass[place]));
            self.u[place] = to_node(&u);
        }
        let damping = T::of(-body.config.stiffness_damping / h);
        for kernel in &self.kernels {
            kernel.product(damping, &self.u, &mut self.residual);
        }
    }
}
