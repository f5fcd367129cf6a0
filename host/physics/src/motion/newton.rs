//! Newton's method for one implicit equation of motion, or for equilibrium.
//!
//! Each scheme requires positions `x'` with `v' = (x' - a) / g` that satisfy
//!
//! ```text
//! M (x' - p) / g^2 + C v' = f(x') + load,      C = alpha M + beta K(x')
//! ```
//!
//! with an anchor `a`, a prediction `p` and a time `g` that the scheme chooses. Equilibrium leaves out the left side.
//! Each iteration solves with the tangent by sparse Cholesky and searches along the result for a decrease of the
//! incremental potential (Nocedal and Wright, "Numerical optimization", 2006, algorithm 3.1; the potential is that of
//! Radovitzky and Ortiz, 1999). The matrix of the damping is constant during one search. The exact tangent gives
//! quadratic convergence. If the exact tangent is not positive definite, the clipped tangent replaces it, so that
//! every direction descends.
//!
//! Below some residual only rounding is left (`rounding`). There the method continues as long as a step halves the
//! residual. The last direction then gives the motion that is still open, that is, undetermined. An equilibrium of
//! which more than a hundredth is open has not been solved: [`StepError::Rounding`]. A single stage of a motion may be
//! smaller than rounding resolves; the motion is checked as a whole (`Integrator::check_digits`).

use crate::Vec3;
use crate::body::Body;
use crate::body::rounding::{Lost, Rounding};
use crate::error::{CondenseError, StepError};
use crate::linear::cholesky::Cholesky;
use crate::linear::sparse_cholesky::FactorCode;
use crate::material::Tangent;

/// Fraction of the predicted decrease that a step must achieve (Armijo).
const ARMIJO: f64 = 1e-4;
/// A residual that is rounding and at most this fraction of the forces that balance is not worth another step.
const FINE: f64 = 1e-6;
/// Fraction of the motion that rounding may leave open: two of its digits must be right.
const MOST_OPEN: f64 = 0.01;
/// Mass added to a static matrix, as a fraction of the mean diagonal. It keeps parts without support in place, if
/// the matrix would otherwise be singular. The residual does not contain this mass.
pub(super) const STATIC_SHIFT: f64 = 1e-11;

/// The limits of Newton's method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NewtonOptions {
    /// Residual to reach, as a fraction of the forces that balance.
    pub tolerance: f64,
    /// Most iterations.
    pub max_iterations: usize,
}

impl Default for NewtonOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-9,
            max_iterations: 50,
        }
    }
}

/// The report of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NewtonReport {
    /// Newton iterations of the solve.
    pub iterations: usize,
    /// Iterations in which the exact tangent was not positive definite.
    pub clipped: usize,
    /// Sum of the halvings in all line searches.
    pub halvings: usize,
    /// Norm of the residual at the end (N).
    pub residual: f64,
    /// Norm of the forces that balance (N).
    pub reference: f64,
    /// Whether the tolerance was met, or the remaining residual is only rounding.
    pub converged: bool,
    /// Whether the residual is above the tolerance but only rounding.
    pub rounded: bool,
    /// After a solve that rounding stopped: the largest motion of a node that was still open, or that its coordinates
    /// cannot resolve (m).
    pub open: f64,
    /// Whether nothing loads or moves the body, and the residual is only rounding.
    pub negligible: bool,
}

impl NewtonReport {
    /// The residual as a fraction of the forces that balance; 0 if it is negligible, because the
    /// forces then may be only rounding themselves.
    pub fn relative_residual(&self) -> f64 {
        if self.negligible {
            0.0
        } else {
            self.residual / self.reference.max(f64::MIN_POSITIVE)
        }
    }
}

/// Where the guided axes go in a solve.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Guide<'a> {
    /// They move by this fraction of their remaining displacement.
    By(f64),
    /// They move to these positions, by node (m).
    To(&'a [Vec3]),
}

/// The equation of one stage of an integrator, by node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StageEquation<'a> {
    /// `a` (m).
    pub(crate) anchor: &'a [Vec3],
    /// `p` (m).
    pub(crate) predicted: &'a [Vec3],
    /// `g` (s).
    pub(crate) g: f64,
}

/// The memory of Newton's method for one topology.
#[derive(Debug)]
pub(crate) struct Newton {
    pub(crate) options: NewtonOptions,
    pub(super) cholesky: Cholesky,
    /// `A u - ...` by node.
    residual: Vec<Vec3>,
    /// Velocity in the damping term, by node (m/s).
    velocity: Vec<Vec3>,
    pub(super) step: Vec<Vec3>,
    start: Vec<Vec3>,
    /// The direction by free place.
    pub(super) flat: Vec<f64>,
    pub(super) rounding: Rounding,
    /// Norm of the right-hand side of the last direction (N).
    asked: f64,
}

/// Factors of a stage in the matrix.
#[derive(Clone, Copy, Debug)]
struct Factors {
    mass: f64,
    stiffness: f64,
}

impl Newton {
    pub(crate) fn new(body: &Body, options: NewtonOptions) -> Result<Self, CondenseError> {
        let count = body.state.x.len();
        Ok(Self {
            options,
            cholesky: Cholesky::new(&body.assembly.stiffness, 1, FactorCode::default())?,
            residual: vec![Vec3::zeros(); count],
            velocity: vec![Vec3::zeros(); count],
            step: vec![Vec3::zeros(); count],
            start: vec![Vec3::zeros(); count],
            flat: vec![0.0; 3 * body.assembly.places.free()],
            rounding: Rounding::new(body),
            asked: 0.0,
        })
    }

    /// Moves the free nodes of `body` to the solution of the stage, and the nodes of handles to `held`, which is in the
    /// order of the held places. `guide` tells where the guided axes go. Forces and stiffness are assembled at the end.
    ///
    /// # Errors
    ///
    /// [`StepError::Diverged`], [`StepError::Rounding`] and [`StepError::Matrix`]; the positions are undefined then.
    pub(crate) fn solve(
        &mut self,
        body: &mut Body,
        stage: Option<StageEquation<'_>>,
        held: &[Vec3],
        guide: Guide<'_>,
    ) -> Result<NewtonReport, StepError> {
        let exact = stage.is_none() || body.model.config.stiffness_damping == 0.0;
        let factors = stage.map_or(
            Factors {
                mass: 0.0,
                stiffness: 1.0,
            },
            |stage| Factors {
                mass: 1.0 / (stage.g * stage.g) + body.model.config.mass_damping / stage.g,
                stiffness: 1.0 + body.model.config.stiffness_damping / stage.g,
            },
        );
        self.step.fill(Vec3::zeros());
        let (supports, x) = (&body.constraints.supports, &body.state.x);
        match guide {
            Guide::By(fraction) => supports.prescribe(x, fraction, &mut self.step),
            Guide::To(places) => supports.prescribe_to(x, places, &mut self.step),
        }
        for (node, goal) in body.constraints.held_nodes().zip(held) {
            self.step[node] = goal - body.state.x[node];
        }
        let mut prescribed = self.step.iter().any(|u| *u != Vec3::zeros());
        let loaded = body.model.load_factor != 0.0
            && body.model.external.iter().any(|f| *f != Vec3::zeros());
        // The norm of the first right-hand side, which contains the prescribed motion (N); 0 without one.
        let mut asked = 0.0;
        let quiet = !prescribed && !loaded;
        let tangent = if exact {
            Tangent::Exact
        } else {
            Tangent::Clipped
        };
        let mut report = NewtonReport::default();
        let mut last = f64::INFINITY;
        body.assemble_with(tangent);
        loop {
            self.balance(body, stage);
            self.judge(body, stage, &mut report);
            // Held nodes have no residual; the reference contains their forces.
            if !(report.residual.is_finite() && report.reference.is_finite()) {
                return Err(StepError::Diverged {
                    iterations: report.iterations,
                });
            }
            let met = report.residual <= self.options.tolerance * report.reference;
            let floor = self
                .rounding
                .of_forces(body, factors.mass, factors.stiffness);
            report.rounded = !met && report.residual <= floor;
            report.negligible = report.rounded && quiet;
            if !prescribed {
                let fine = report.residual <= FINE * report.reference.max(asked);
                report.converged = met || (report.rounded && (quiet || fine));
                if !report.converged && report.rounded && report.residual > 0.5 * last {
                    return self.end_at_rounding(body, stage, tangent, last, report);
                }
            }
            if report.converged || report.iterations >= self.options.max_iterations {
                return Ok(report);
            }
            last = if report.rounded && !prescribed {
                report.residual
            } else {
                f64::INFINITY
            };
            report.iterations += 1;
            self.direction(body, factors, exact, prescribed, stage, &mut report)?;
            self.start.copy_from_slice(&body.state.x);
            if prescribed {
                asked = self.asked;
                for (x, u) in body.state.x.iter_mut().zip(&self.step) {
                    *x += u;
                }
                prescribed = false;
            } else if !self.search(body, factors, stage, &mut report) {
                // The search found no decrease above the rounding error, so the solve ends here.
                body.state.x.copy_from_slice(&self.start);
                if report.rounded {
                    body.assemble_with(tangent);
                    return self.end_at_rounding(body, stage, tangent, f64::INFINITY, report);
                }
                body.assemble_with(Tangent::Clipped);
                return Ok(report);
            }
            body.assemble_with(tangent);
        }
    }

    /// Ends a solve in which only rounding is left. Of the present positions and those before the last step, where the
    /// residual was `last` (N), the better positions are kept.
    fn end_at_rounding(
        &mut self,
        body: &mut Body,
        stage: Option<StageEquation<'_>>,
        tangent: Tangent,
        last: f64,
        mut report: NewtonReport,
    ) -> Result<NewtonReport, StepError> {
        if last < report.residual {
            body.state.x.copy_from_slice(&self.start);
            body.assemble_with(tangent);
            self.balance(body, stage);
            self.judge(body, stage, &mut report);
        }
        let free = body.assembly.places.free_nodes();
        let open = free.map(|node| self.step[node].amax());
        // Coordinates are known only up to the spacing of numbers of their size.
        let place = body.state.x.iter().map(Vec3::amax).fold(0.0, f64::max);
        report.open = open.fold(0.5 * f64::EPSILON * place, f64::max);
        if stage.is_none() {
            check_digits(body, report.open, body.moved())?;
        }
        report.converged = true;
        Ok(report)
    }

    /// The residual of the last solve, by node (N). On held nodes and guided axes the residual is the force of hand or
    /// support, without the node's inertia.
    pub(crate) fn residual(&self) -> &[Vec3] {
        &self.residual
    }

    /// Computes the residual at the present positions, by node (N). On held nodes the residual is the force of the
    /// hand.
    pub(super) fn balance(&mut self, body: &Body, stage: Option<StageEquation<'_>>) {
        let damping = body.model.config.stiffness_damping;
        if let Some(stage) = stage {
            for (node, velocity) in self.velocity.iter_mut().enumerate() {
                *velocity = (body.state.x[node] - stage.anchor[node]) / stage.g;
            }
        }
        for node in 0..body.state.x.len() {
            let mut r =
                -body.assembly.internal[node] - body.model.external[node] * body.model.load_factor;
            if let Some(stage) = stage {
                let acceleration =
                    (body.state.x[node] - stage.predicted[node]) / (stage.g * stage.g);
                let drag = self.velocity[node] * body.model.config.mass_damping;
                r += (acceleration + drag) * body.model.mass[node];
                if damping > 0.0 {
                    r += body.assembly.row_product(node, &self.velocity) * damping;
                }
            }
            self.residual[node] = r;
        }
    }

    /// Writes the norms of residual and reference forces into `report`.
    fn judge(&self, body: &Body, stage: Option<StageEquation<'_>>, report: &mut NewtonReport) {
        let free = body.assembly.places.free();
        let mask = body.constraints.supports.mask();
        let (mut residual, mut reference) = (0.0, 0.0);
        for (place, &node) in body.assembly.places.nodes().iter().enumerate() {
            let node = node as usize;
            let external = body.model.external[node] * body.model.load_factor;
            reference += body.assembly.internal[node].norm_squared() + external.norm_squared();
            if place >= free {
                continue;
            }
            let r = self.residual[node];
            residual += mask
                .map_or(r, |mask| r.component_mul(&mask[node]))
                .norm_squared();
            if let Some(stage) = stage {
                let moved = (body.state.x[node] - stage.predicted[node]) / (stage.g * stage.g);
                reference += (moved * body.model.mass[node]).norm_squared();
            }
        }
        report.residual = libm::sqrt(residual);
        report.reference = libm::sqrt(reference);
    }

    /// Computes Newton's direction in `step`, which contains the prescribed parts on entry.
    fn direction(
        &mut self,
        body: &mut Body,
        factors: Factors,
        exact: bool,
        prescribed: bool,
        stage: Option<StageEquation<'_>>,
        report: &mut NewtonReport,
    ) -> Result<(), StepError> {
        if exact && !self.factorize(body, factors, stage)? {
            report.clipped += 1;
            body.assemble_with(Tangent::Clipped);
            self.factorize_clipped(body, factors, stage)?;
        } else if !exact {
            self.factorize_clipped(body, factors, stage)?;
        }
        let mask = body.constraints.supports.mask();
        if !prescribed {
            self.step.fill(Vec3::zeros());
        }
        for (place, node) in body.assembly.places.free_nodes().enumerate() {
            let mut rhs = -self.residual[node];
            if prescribed {
                rhs -= body.assembly.row_product(node, &self.step) * factors.stiffness;
            }
            if let Some(mask) = mask {
                rhs.component_mul_assign(&mask[node]);
            }
            self.flat[3 * place..3 * place + 3].copy_from_slice(rhs.as_slice());
        }
        self.asked = libm::sqrt(self.flat.iter().map(|f| f * f).sum());
        self.cholesky.solve(&mut self.flat);
        let free = body.assembly.places.free_nodes();
        for (node, flat) in free.zip(self.flat.chunks_exact(3)) {
            self.step[node] += Vec3::new(flat[0], flat[1], flat[2]);
        }
        if self.flat.iter().all(|value| value.is_finite()) {
            Ok(())
        } else {
            Err(StepError::Diverged {
                iterations: report.iterations,
            })
        }
    }

    /// Factorizes the matrix. Returns whether the matrix is positive definite.
    fn factorize(
        &mut self,
        body: &Body,
        factors: Factors,
        stage: Option<StageEquation<'_>>,
    ) -> Result<bool, StepError> {
        let mass = if stage.is_some() {
            factors.mass
        } else {
            STATIC_SHIFT * stiffness_per_mass(body)
        };
        match self.cholesky.factorize(
            &body.assembly.stiffness,
            &body.assembly.mass,
            mass,
            factors.stiffness,
            body.assembly.mask(),
        ) {
            Ok(()) => Ok(true),
            Err(CondenseError::NotPositiveDefinite { .. }) => Ok(false),
            Err(error) => Err(StepError::Matrix(error)),
        }
    }

    /// Factorizes the clipped matrix, with as much added mass as rounding requires.
    fn factorize_clipped(
        &mut self,
        body: &Body,
        factors: Factors,
        stage: Option<StageEquation<'_>>,
    ) -> Result<(), StepError> {
        let unit = stiffness_per_mass(body) * factors.stiffness;
        let mut last = CondenseError::NotPositiveDefinite { pivot: 0 };
        for shift in [STATIC_SHIFT, 1e-9, 1e-7, 1e-5, 1e-3] {
            let extra = if stage.is_some() && shift == STATIC_SHIFT {
                0.0
            } else {
                shift * unit
            };
            match self.cholesky.factorize(
                &body.assembly.stiffness,
                &body.assembly.mass,
                factors.mass + extra,
                factors.stiffness,
                body.assembly.mask(),
            ) {
                Ok(()) => return Ok(()),
                Err(error) => last = error,
            }
        }
        Err(StepError::Matrix(last))
    }

    /// Moves along `step` until the potential decreases enough. Returns whether it does.
    fn search(
        &mut self,
        body: &mut Body,
        factors: Factors,
        stage: Option<StageEquation<'_>>,
        report: &mut NewtonReport,
    ) -> bool {
        let elastic = body.elastic_energy();
        let (mut slope, mut linear, mut quadratic) = (0.0, 0.0, 0.0);
        let mut lost = Lost::default();
        for (place, node) in body.assembly.places.free_nodes().enumerate() {
            let u = self.step[node];
            let position = self.rounding.of_position(body, place);
            let stiffness = body.assembly.stiffness.diagonal(place).amax();
            let matrix = stiffness * factors.stiffness + body.model.mass[node] * factors.mass;
            lost.elastic += stiffness * position * position;
            lost.elements += self.rounding.of_element(place, stiffness);
            lost.work += (self.residual[node] + body.assembly.internal[node]).norm() * position
                + matrix * position * u.norm();
            slope += self.residual[node].dot(&u);
            linear += (self.residual[node] + body.assembly.internal[node]).dot(&u);
            if stage.is_some() {
                quadratic += factors.mass * body.model.mass[node] * u.norm_squared();
                let damping = factors.stiffness - 1.0;
                if damping > 0.0 {
                    quadratic += damping * u.dot(&body.assembly.row_product(node, &self.step));
                }
            }
        }
        let slack = lost.of_energy(elastic);
        let mut fraction = 1.0;
        for _ in 0..40 {
            for node in body.assembly.places.free_nodes() {
                body.state.x[node] = self.start[node] + self.step[node] * fraction;
            }
            let change = body.elastic_energy() - elastic
                + fraction * linear
                + 0.5 * fraction * fraction * quadratic;
            if change <= ARMIJO * fraction * slope.min(0.0) + slack {
                return true;
            }
            fraction *= 0.5;
            report.halvings += 1;
        }
        false
    }
}

/// Refuses a solution if rounding leaves more than a hundredth of the motion `moved` (m) open; `open` is that part (m).
pub(crate) fn check_digits(body: &Body, open: f64, moved: f64) -> Result<(), StepError> {
    if open <= MOST_OPEN * moved {
        return Ok(());
    }
    Err(StepError::Rounding {
        open,
        moved,
        place: body.state.x.iter().map(Vec3::amax).fold(0.0, f64::max),
        size: body.size(),
    })
}

/// Mean diagonal of the stiffness over the mean mass (1/s^2).
pub(super) fn stiffness_per_mass(body: &Body) -> f64 {
    let free = body.assembly.places.free();
    let diagonal: f64 = (0..free)
        .map(|place| body.assembly.stiffness.diagonal(place).trace() / 3.0)
        .sum();
    let mass: f64 = body.assembly.mass[..free].iter().sum();
    if mass > 0.0 { diagonal / mass } else { 0.0 }
}
