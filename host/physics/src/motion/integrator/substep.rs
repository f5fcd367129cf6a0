//! One substep, by implicit Euler or by TR-BDF2.
//!
//! TR-BDF2 (Bank et al., "Transient simulation of silicon devices and circuits", 1985; Hosea and Shampine, "Analysis
//! and implementation of TR-BDF2", 1996) takes a trapezoidal stage over `gamma h` and a BDF2 stage to `h`. Both stages
//! have the same matrix for `gamma = 2 - sqrt 2`. TR-BDF2 was chosen over BDF2 because it needs no earlier steps: a
//! step may be halved, a handle released or a mesh torn without a restart at first order. TR-BDF2 is L-stable, so by
//! von Neumann's theorem the energy of a linear, dissipative body never grows. Each step costs two solves.
//!
//! If a substep of TR-BDF2 would add energy to a nonlinear body, the substep is taken by implicit Euler instead
//! (`guard`).

use super::{Integrator, TimeScheme, between};
use crate::Vec3;
use crate::body::Body;
use crate::body::guard::Energy;
use crate::error::StepError;
use crate::motion::newton::{Guide, NewtonReport, StageEquation};

/// 1 - 1 / sqrt 2: half of `gamma`, and the factor of the step length in the matrix of both stages.
const D: f64 = 1.0 - core::f64::consts::FRAC_1_SQRT_2;
const GAMMA: f64 = 2.0 * D;

impl Integrator {
    /// Takes one substep of `h`, in which guided axes move by `fraction` of their remaining displacement. Returns the
    /// report, and whether the substep had to be taken by implicit Euler instead of the scheme.
    pub(super) fn substep(
        &mut self,
        body: &mut Body,
        h: f64,
        fraction: f64,
    ) -> Result<(NewtonReport, bool), StepError> {
        let scheme = self.options.scheme;
        // Energies are compared under the loads at the substep's end.
        self.load(body, 1.0);
        if scheme == TimeScheme::ImplicitEuler {
            return Ok((self.attempt(body, scheme, h, fraction)?, false));
        }
        self.guard.begin(Energy::now(body));
        let found = self.attempt(body, scheme, h, fraction)?;
        if !found.converged {
            return Ok((found, false));
        }
        let after = Energy::now(body);
        if self.guard.allows(body, after, self.work) {
            self.guard.end(after, self.work);
            return Ok((found, false));
        }
        body.state.x.copy_from_slice(&self.x);
        body.state.v.copy_from_slice(&self.v);
        let mut safer = self.attempt(body, TimeScheme::ImplicitEuler, h, fraction)?;
        safer.iterations += found.iterations;
        self.guard.end(Energy::now(body), self.work);
        Ok((safer, true))
    }

    /// Takes one substep of `h` by `scheme`, in which guided axes move by `fraction` of their remaining displacement.
    fn attempt(
        &mut self,
        body: &mut Body,
        scheme: TimeScheme,
        h: f64,
        fraction: f64,
    ) -> Result<NewtonReport, StepError> {
        let mut report = match scheme {
            TimeScheme::ImplicitEuler => {
                for node in 0..self.x.len() {
                    self.anchor[node] = self.x[node];
                    self.predicted[node] = self.x[node] + self.v[node] * h;
                }
                let report = self.solve(body, h, 1.0, fraction, h)?;
                self.work = self.hands(body, &self.x);
                report
            }
            TimeScheme::TrBdf2 => {
                let g = D * h;
                body.assemble();
                self.load(body, 0.0);
                for node in 0..self.x.len() {
                    let acceleration = acceleration(body, node);
                    self.anchor[node] = self.x[node] + self.v[node] * g;
                    self.predicted[node] =
                        self.anchor[node] + (self.v[node] + acceleration * g) * g;
                }
                self.load(body, GAMMA);
                let first = self.solve(body, g, GAMMA, fraction * GAMMA, h)?;
                if !first.converged {
                    return Ok(first);
                }
                self.work = self.hands(body, &self.x);
                self.middle.copy_from_slice(&body.state.x);
                let to_middle = 1.0 / (GAMMA * (2.0 - GAMMA));
                let to_start = to_middle - 1.0;
                for node in 0..self.x.len() {
                    let velocity = (self.middle[node] - self.anchor[node]) / g;
                    let v = velocity * to_middle - self.v[node] * to_start;
                    self.anchor[node] = self.middle[node] * to_middle - self.x[node] * to_start;
                    self.predicted[node] = self.anchor[node] + v * g;
                }
                // The fraction of the displacement that remains after the first stage.
                let left = fraction * (1.0 - GAMMA) / (1.0 - fraction * GAMMA);
                self.load(body, 1.0);
                let mut second = self.solve(body, g, 1.0, left, h)?;
                self.work += self.hands(body, &self.middle);
                second.iterations += first.iterations;
                second.clipped += first.clipped;
                second.halvings += first.halvings;
                second
            }
        };
        let g = if scheme == TimeScheme::TrBdf2 {
            D * h
        } else {
            h
        };
        for (node, v) in body.state.v.iter_mut().enumerate() {
            *v = (body.state.x[node] - self.anchor[node]) / g;
        }
        self.work += self.push(body) + self.ramp(body);
        report.converged &= body
            .state
            .v
            .iter()
            .flat_map(Vec3::iter)
            .all(|v| v.is_finite());
        body.state.motions += 1;
        Ok(report)
    }

    /// An upper bound of the work (J) of handles and supports on their nodes, from the positions `from` to the end of
    /// the stage just solved, without the inertia of these nodes.
    fn hands(&self, body: &Body, from: &[Vec3]) -> f64 {
        let force = self.newton.residual();
        let moved = |node: usize| body.state.x[node] - from[node];
        let held = body.constraints.held_nodes();
        let work: f64 = held
            .map(|node| force[node].norm() * moved(node).norm())
            .sum();
        work + body.constraints.supports.work(|node| force[node], moved)
    }

    /// An upper bound of the work (J) of handles and supports on the inertia of their nodes.
    fn push(&self, body: &Body) -> f64 {
        let gained = |node: usize| {
            let (now, then) = (&body.state.v[node], &self.v[node]);
            (now.component_mul(now) - then.component_mul(then)) * (0.5 * body.model.mass[node])
        };
        let held = body.constraints.held_nodes();
        let work: f64 = held.map(|node| gained(node).abs().sum()).sum();
        work + body
            .constraints
            .supports
            .work(gained, |_| Vec3::repeat(1.0))
    }

    /// Sets the loads to those at the fraction `part` of the substep.
    fn load(&self, body: &mut Body, part: f64) {
        if !self.ramped {
            return;
        }
        let fraction = self.span.0 + (self.span.1 - self.span.0) * part;
        if fraction == 1.0 {
            body.model.external.copy_from_slice(&self.loads.1);
            return;
        }
        let loads = self.loads.0.iter().zip(&self.loads.1);
        for (external, (from, to)) in body.model.external.iter_mut().zip(loads) {
            *external = from + (to - from) * fraction;
        }
    }

    /// An upper bound of the work (J) of the loads beyond the work of the loads at the end.
    fn ramp(&self, body: &Body) -> f64 {
        if !self.ramped {
            return 0.0;
        }
        let changed = |node: usize| (self.loads.1[node] - self.loads.0[node]).norm();
        let moved = |node: usize| (body.state.x[node] - self.x[node]).norm();
        let nodes = body.constraints.nodes();
        let work: f64 = nodes.map(|node| changed(node) * moved(node)).sum();
        work * (self.span.1 - self.span.0) * body.model.load_factor.abs()
    }

    /// Solves a stage that ends at the fraction `part` of a substep of `h`.
    fn solve(
        &mut self,
        body: &mut Body,
        g: f64,
        part: f64,
        fraction: f64,
        h: f64,
    ) -> Result<NewtonReport, StepError> {
        self.held.clear();
        for (handle, aim) in body.constraints.handles.iter().zip(&self.aims) {
            let pose = between(&handle.report.pose, aim, part);
            for (node, offset) in handle.nodes() {
                let goal = pose.position + pose.rotation * offset;
                let velocity = (goal - self.x[node]) / (part * h);
                self.held.push(goal);
                self.anchor[node] = goal - velocity * g;
                self.predicted[node] = goal;
            }
        }
        if let Some(mask) = body.constraints.supports.mask() {
            // The goals of the guided axes, by the same rule as in the solver.
            body.state.displacement.fill(Vec3::zeros());
            body.constraints.supports.prescribe(
                &body.state.x,
                fraction,
                &mut body.state.displacement,
            );
            for (node, mask) in mask.iter().enumerate() {
                for axis in 0..3 {
                    if mask[axis] == 0.0 {
                        let goal = body.state.x[node][axis] + body.state.displacement[node][axis];
                        let velocity = (goal - self.x[node][axis]) / (part * h);
                        self.anchor[node][axis] = goal - velocity * g;
                        self.predicted[node][axis] = goal;
                    }
                }
            }
        }
        let stage = StageEquation {
            anchor: &self.anchor,
            predicted: &self.predicted,
            g,
        };
        self.newton
            .solve(body, Some(stage), &self.held, Guide::By(fraction))
    }
}

/// Acceleration of a node at the present state, from the forces assembled last.
fn acceleration(body: &Body, node: usize) -> Vec3 {
    let mut force = body.assembly.internal[node]
        + body.model.external[node] * body.model.load_factor
        - body.state.v[node] * (body.model.config.mass_damping * body.model.mass[node]);
    if body.model.config.stiffness_damping > 0.0 {
        force -=
            body.assembly.row_product(node, &body.state.v) * body.model.config.stiffness_damping;
    }
    force / body.model.mass[node]
}
