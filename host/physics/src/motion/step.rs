//! The time step: implicit Euler with one linearization.
//!
//! With the displacement over the step `u = h v'` as the unknown, Rayleigh damping `C = alpha M + beta K`
//! and the matrix `A = M / h^2 + C / h + K`,
//!
//! ```text
//! A u = M v / h + f_internal + f_external        x' = x + u        v' = u / h
//! ```
//!
//! on the free nodes. The handle nodes move as their handles prescribe (Baraff and Witkin, "Large steps in cloth
//! simulation", 1998). The residual of the same equation on a handle node is the force of the hand. A step that would
//! add energy is shortened (`guard`).

use crate::Vec3;
use crate::body::Body;
use crate::body::handle::{Handle, HandlePose, HandleReport, Wrench};
use crate::error::StepError;
use crate::linear::pcg::SolveReport;

impl Body {
    /// Assembles and solves one step of `h` seconds.
    ///
    /// # Errors
    ///
    /// As [`solve`](Self::solve).
    pub fn step(&mut self, h: f64, targets: &[HandlePose]) -> Result<SolveReport, StepError> {
        self.assemble();
        self.solve(h, targets)
    }

    /// Advances the body by `h` seconds to the handle poses `targets`, one per handle, with the forces and the
    /// stiffness that were assembled last.
    ///
    /// A solve that runs out of iterations is no error: the report gives the residual that it reached.
    ///
    /// # Errors
    ///
    /// [`StepError`]; the body keeps its state then.
    pub fn solve(&mut self, h: f64, targets: &[HandlePose]) -> Result<SolveReport, StepError> {
        self.check_step(h, targets)?;
        self.lay_out_step(h, targets)?;
        let factors = self.step_factors(h);
        let budget = self.model.config.budget();
        let displacement = &mut self.state.displacement;
        let report = self.assembly.solve(displacement, factors, &budget);
        self.end_step(h, targets, report)
    }

    /// Factors of mass and stiffness in the matrix of a step of `h` seconds.
    fn step_factors(&self, h: f64) -> (f64, f64) {
        let config = &self.model.config;
        (
            1.0 / (h * h) + config.mass_damping / h,
            1.0 + config.stiffness_damping / h,
        )
    }

    /// Sets the displacements that handles and supports prescribe, the start of the iterations, and the residual there.
    fn lay_out_step(&mut self, h: f64, targets: &[HandlePose]) -> Result<(), StepError> {
        if self.assembly.at != Some(self.state.motions) {
            return Err(StepError::NotAssembled);
        }
        let (mass_factor, stiffness_factor) = self.step_factors(h);
        self.see_missed();

        for (u, v) in self.state.displacement.iter_mut().zip(&self.state.v) {
            *u = v * h;
        }
        self.prescribe(targets);
        for (place, node) in self.assembly.places.free_nodes().enumerate() {
            self.assembly.pcg.residual[place] =
                -self.imbalance(node, h, mass_factor, stiffness_factor);
        }
        Ok(())
    }

    /// Takes the solved step, as far as the energy allows.
    fn end_step(
        &mut self,
        h: f64,
        targets: &[HandlePose],
        mut report: SolveReport,
    ) -> Result<SolveReport, StepError> {
        let (mass_factor, stiffness_factor) = self.step_factors(h);
        let mut work = self.take_grip(h, mass_factor, stiffness_factor);
        // A residual that has overflowed is no valid guide.
        if !(self.is_step_finite(h) && report.final_residual.is_finite()) {
            // The forces do not belong to the state that is kept. With zero forces, a condensation has no lever term.
            self.constraints.forget_grips();
            return Err(StepError::Diverged {
                iterations: report.iterations,
            });
        }
        work += self.constraints.supports.work(
            |node| self.imbalance(node, h, mass_factor, stiffness_factor),
            |node| self.state.displacement[node],
        );
        report.held_back = self.hold_back(h, work);
        if report.held_back > 0.0 {
            self.take_grip(h, mass_factor, stiffness_factor);
        }
        self.report_handles(h, targets);
        let mut supports = core::mem::take(&mut self.constraints.supports);
        supports.collect_reactions(|node| self.imbalance(node, h, mass_factor, stiffness_factor));
        self.constraints.supports = supports;
        if report.held_back == 0.0 {
            self.promise(h, mass_factor, stiffness_factor);
        }
        for ((x, v), u) in self
            .state
            .x
            .iter_mut()
            .zip(&mut self.state.v)
            .zip(&self.state.displacement)
        {
            *x += u;
            *v = u / h;
        }
        self.state.motions += 1;
        Ok(report)
    }

    /// Whether the motion over a step of `h` and the forces of the hands are finite. The velocity overflows before the
    /// displacement does.
    pub(crate) fn is_step_finite(&self, h: f64) -> bool {
        let mut moves = self.state.displacement.iter().flat_map(Vec3::iter);
        let mut grips = self.constraints.grips().flat_map(Vec3::iter);
        moves.all(|u| (u / h).is_finite()) && grips.all(|f| f.is_finite())
    }

    /// Stores the elastic forces that the step's linearization predicts for the step's end. The equation of the step
    /// already gives `K u`, so no product is needed.
    fn promise(&mut self, h: f64, mass_factor: f64, stiffness_factor: f64) {
        let mut promised = core::mem::take(&mut self.assembly.promised);
        let places = &self.assembly.places;
        let free = places.free_nodes();
        let free = free.zip(self.assembly.pcg.residual.iter().copied());
        let held = places.held_nodes().zip(self.constraints.grips());
        let held = held.map(|(node, grip)| (node, -grip - self.inertia(node, h)));
        for (node, left) in free.chain(held) {
            let momentum = self.state.v[node] / h - self.state.displacement[node] * mass_factor;
            let acting = self.assembly.internal[node]
                + self.model.external[node] * self.model.load_factor
                + momentum * self.model.mass[node];
            promised[node] = self.assembly.internal[node] - (acting - left) / stiffness_factor;
        }
        self.assembly.promised = promised;
        self.assembly.promised_over = Some(h);
    }

    /// Computes the rate by which the elastic forces at the end of the last step, where the elements have just been
    /// assembled, deviate from the prediction of its linearization.
    fn see_missed(&mut self) {
        let Some(h) = self.assembly.promised_over.take() else {
            self.assembly.missed.fill(Vec3::zeros());
            return;
        };
        let ends = self.assembly.internal.iter().zip(&self.assembly.promised);
        for (missed, (force, promised)) in self.assembly.missed.iter_mut().zip(ends) {
            *missed = (force - promised) / h;
        }
    }

    /// Discards the prediction of the last step, because the state has changed.
    pub(crate) fn forget_promise(&mut self) {
        self.assembly.promised_over = None;
        self.assembly.missed.fill(Vec3::zeros());
    }

    /// Sets the displacements that handles and supports prescribe.
    pub(crate) fn prescribe(&mut self, targets: &[HandlePose]) {
        for (handle, target) in self.constraints.handles.iter().zip(targets) {
            for (node, offset) in handle.nodes() {
                self.state.displacement[node] =
                    target.position + target.rotation * offset - self.state.x[node];
            }
        }
        self.constraints
            .supports
            .prescribe(&self.state.x, 1.0, &mut self.state.displacement);
    }

    /// Refuses a step length or targets that are invalid.
    pub(crate) fn check_step(&self, h: f64, targets: &[HandlePose]) -> Result<(), StepError> {
        Self::check_length(h)?;
        self.check_targets(targets)
    }

    pub(crate) fn check_length(h: f64) -> Result<(), StepError> {
        if h > 0.0 && h.is_finite() {
            Ok(())
        } else {
            Err(StepError::StepLength { found: h })
        }
    }

    pub(crate) fn check_targets(&self, targets: &[HandlePose]) -> Result<(), StepError> {
        if targets.len() != self.constraints.handles.len() {
            let (found, expected) = (targets.len(), self.constraints.handles.len());
            return Err(StepError::Targets { found, expected });
        }
        if let Some(handle) = targets.iter().position(|target| !target.is_finite()) {
            return Err(StepError::Target { handle });
        }
        Ok(())
    }

    /// Computes the forces of the hands. Returns an upper bound of their work (J).
    fn take_grip(&mut self, h: f64, mass_factor: f64, stiffness_factor: f64) -> f64 {
        self.grip(h, |body, node| {
            body.imbalance(node, h, mass_factor, stiffness_factor)
        })
    }

    /// Computes the forces of the hands from the `force` of hand and inertia on a node. Returns an upper bound of their
    /// work (J).
    fn grip(&mut self, h: f64, force: impl Fn(&Self, usize) -> Vec3) -> f64 {
        let mut work = 0.0;
        let mut handles = core::mem::take(&mut self.constraints.handles);
        for handle in &mut handles {
            for (grip, &vertex) in handle.grip.iter_mut().zip(&handle.vertices) {
                let node = vertex as usize;
                let force = force(self, node);
                *grip = force - self.inertia(node, h);
                work += force.norm() * self.state.displacement[node].norm();
            }
        }
        self.constraints.handles = handles;
        work
    }

    /// Computes the forces of the hands for a step that was solved elsewhere, whose residual is `imbalance`. Returns an
    /// upper bound of the work of hands and supports (J).
    pub(crate) fn take_grip_from(&mut self, h: f64, imbalance: impl Fn(usize) -> Vec3) -> f64 {
        let work = self.grip(h, |_, node| imbalance(node));
        work + self
            .constraints
            .supports
            .work(imbalance, |node| self.state.displacement[node])
    }

    /// Writes the reports of handles and supports for a step that was solved elsewhere, before the step is taken.
    pub(crate) fn report_step(
        &mut self,
        h: f64,
        targets: &[HandlePose],
        imbalance: impl Fn(usize) -> Vec3,
    ) {
        self.report_handles(h, targets);
        self.constraints.supports.collect_reactions(imbalance);
    }

    /// `A u - M v / h - f_internal - f_external` at a node (N): zero if the step is solved, and the force of the
    /// hand on a handle node.
    fn imbalance(&self, node: usize, h: f64, mass_factor: f64, stiffness_factor: f64) -> Vec3 {
        let mass = self.model.mass[node];
        self.assembly.row_product(node, &self.state.displacement) * stiffness_factor
            + self.state.displacement[node] * (mass_factor * mass)
            - self.state.v[node] * (mass / h)
            - self.assembly.internal[node]
            - self.model.external[node] * self.model.load_factor
    }

    /// Mass times acceleration of a node over the step (N).
    fn inertia(&self, node: usize, h: f64) -> Vec3 {
        (self.state.displacement[node] / h - self.state.v[node]) * (self.model.mass[node] / h)
    }

    fn report_handles(&mut self, h: f64, targets: &[HandlePose]) {
        self.state.clock += h;
        let mut handles = core::mem::take(&mut self.constraints.handles);
        for (handle, target) in handles.iter_mut().zip(targets) {
            report_handle(handle, h, target, |node| {
                (
                    self.state.x[node] + self.state.displacement[node],
                    self.inertia(node, h),
                )
            });
        }
        self.constraints.handles = handles;
    }

    /// Writes the reports of handles and supports after a solve that has already moved the body, over a step of `h`
    /// from the velocities `before`. The forces are those assembled last. An infinite `h` means equilibrium.
    pub(crate) fn report_stage(&mut self, h: f64, targets: &[HandlePose], before: &[Vec3]) {
        self.forget_promise();
        let (alpha, beta) = (
            self.model.config.mass_damping,
            self.model.config.stiffness_damping,
        );
        let mut supports = core::mem::take(&mut self.constraints.supports);
        let mut handles = core::mem::take(&mut self.constraints.handles);
        let pull = |node: usize| {
            let damping = if beta > 0.0 {
                self.assembly.row_product(node, &self.state.v) * beta
            } else {
                Vec3::zeros()
            };
            self.state.v[node] * (alpha * self.model.mass[node]) + damping
                - self.assembly.internal[node]
                - self.model.external[node] * self.model.load_factor
        };
        let inertia =
            |node: usize| (self.state.v[node] - before[node]) * (self.model.mass[node] / h);
        for handle in &mut handles {
            for (grip, &vertex) in handle.grip.iter_mut().zip(&handle.vertices) {
                *grip = pull(vertex as usize);
            }
        }
        supports.collect_reactions(|node| pull(node) + inertia(node));
        self.constraints.supports = supports;
        for (handle, target) in handles.iter_mut().zip(targets) {
            report_handle(handle, h, target, |node| {
                (
                    self.state.x[node],
                    (self.state.v[node] - before[node]) * (self.model.mass[node] / h),
                )
            });
        }
        self.constraints.handles = handles;
    }
}

/// Sums the forces of a handle's nodes. `state` gives a node's position at the end of the step, and its inertia.
fn report_handle(
    handle: &mut Handle,
    h: f64,
    target: &HandlePose,
    state: impl Fn(usize) -> (Vec3, Vec3),
) {
    let old = handle.report.pose;
    let mut grip = Wrench::default();
    let mut inertia = Wrench::default();
    for (&vertex, held) in handle.vertices.iter().zip(&handle.grip) {
        let (position, force) = state(vertex as usize);
        let arm = position - target.position;
        grip.add(held, &arm);
        inertia.add(&force, &arm);
    }
    handle.report = HandleReport {
        pose: *target,
        linear_velocity: (target.position - old.position) / h,
        angular_velocity: (target.rotation * old.rotation.inverse()).scaled_axis() / h,
        wrench_on_hand: Wrench {
            force: -grip.force,
            moment: -grip.moment,
        },
        reaction: Wrench {
            force: grip.force + inertia.force,
            moment: grip.moment + inertia.moment,
        },
        inertia,
    };
}
