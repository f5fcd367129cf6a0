//! Equilibrium of bodies that touch each other, themselves and obstacles.
//!
//! Loads and displacements grow in load steps, as those of a body alone. Each iteration of Newton's method finds the rows of the
//! contacts at the present positions, and solves all bodies with them ([`motion::touching`](crate::motion::touching)): the
//! multiplier of a row converges to the force that leaves no gap, or to the largest one, so the penetration at the end is only that of the tolerance.
//! The displacement is shortened if something would cross; before that, the rows are found again for the motion that crossed.
//!
//! A body that only contacts hold has no stiffness of its own against a rigid motion. A part of the mass in the matrix, which is
//! not in the residual, bounds its motion in an iteration (Levenberg and Marquardt's method; Nocedal and Wright, "Numerical
//! optimization", 2006, chapter 10). The part falls from iteration to iteration, and grows if a motion is too long.
//!
//! The tangent leaves out that the normals and the feet of contacts follow the bodies (`pace`).
//!
//! Friction follows the way of the iterations: a contact that slipped in one iteration is anchored at its new place in the next.

use super::lent::{Lent, Vectors};
use super::pace::Pace;
use super::{Equilibrium, EquilibriumOptions, EquilibriumReport, in_load_steps, judge, part};
use crate::Vec3;
use crate::body::Body;
use crate::body::handle::HandlePose;
use crate::error::{CondenseError, StepError};
use crate::material::Tangent;
use crate::motion::contacts::{Contacts, Still};
use crate::motion::joint_equation::JointEquation;
use crate::motion::newton::{NewtonReport, STATIC_SHIFT, stiffness_per_mass};

/// A residual of at most this fraction of the forces that does not fall any more is rounding: more rows than motions hold a face
/// on another one, and their gaps agree only to some digits.
const FINE: f64 = 1e-6;
/// How often the multipliers are carried on in an iteration.
const UPDATES: usize = 2;
/// The longest free motion of an iteration, as a fraction of the size of the largest body.
const LONGEST: f64 = 0.05;
/// How often the rows are found again for a motion that would cross something.
const AGAIN: usize = 3;
/// The least part of the mass of a body that only contacts hold, as a fraction of its mean diagonal: conjugate gradients lose
/// digits below it.
const LEAST: f64 = 1e-6;
/// By how much the part of the mass grows if a motion is too long, and falls otherwise.
const GROWTH: f64 = 10.0;
/// The most growths in an iteration.
const MOST_GROWTHS: usize = 10;
/// The bodies are solved to this fraction of the tolerance, or of the residual of the iteration, whatever is more.
const FINER: f64 = 0.1;
const REDUCED: f64 = 1e-3;

/// Where a body goes in a search.
#[derive(Clone, Copy, Debug)]
pub struct Goal<'a> {
    /// The poses of its handles.
    pub targets: &'a [HandlePose],
    /// The fraction of its loads.
    pub load_factor: f64,
    /// The forces on its vertices (N), in addition to gravity; `None` if they do not change.
    pub forces: Option<&'a [Vec3]>,
}

/// Brings bodies that touch to equilibrium, repeatedly.
#[derive(Debug)]
pub struct ContactEquilibrium {
    options: EquilibriumOptions,
    contacts: Contacts,
    each: Vec<Equilibrium>,
    vectors: Vec<Vectors>,
    /// The part of the mass in the matrices, as a fraction of the mean diagonal of each.
    shift: f64,
    pace: Pace,
    report: EquilibriumReport,
}

impl ContactEquilibrium {
    /// Allocates the memory for bodies, whose `contacts` are [complete](Contacts::complete).
    ///
    /// # Errors
    /// [`CondenseError::Symbolic`].
    pub fn new(
        bodies: &[&Body],
        mut contacts: Contacts,
        options: EquilibriumOptions,
    ) -> Result<Self, CondenseError> {
        contacts.face();
        let each = bodies.iter().map(|body| Equilibrium::new(body, options));
        Ok(Self {
            options,
            contacts,
            each: each.collect::<Result<_, _>>()?,
            vectors: bodies.iter().map(|body| Vectors::new(body)).collect(),
            shift: STATIC_SHIFT,
            pace: Pace::default(),
            report: EquilibriumReport::default(),
        })
    }

    /// The report of the last search. After an error, the report tells how far the search came.
    pub fn report(&self) -> &EquilibriumReport {
        &self.report
    }

    /// The contacts, as the last search left them.
    pub fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// Brings all bodies to equilibrium, as [`Equilibrium::solve`] and [`Equilibrium::solve_loaded`] do with one.
    ///
    /// # Errors
    /// [`StepError`]; the bodies then stay in the equilibrium of the last load step that succeeded.
    pub fn solve(
        &mut self,
        bodies: &mut [&mut Body],
        goals: &[Goal<'_>],
    ) -> Result<EquilibriumReport, StepError> {
        self.report = EquilibriumReport::default();
        let mut factors = Vec::with_capacity(bodies.len());
        for ((body, goal), own) in bodies.iter_mut().zip(goals).zip(&mut self.each) {
            body.check_step(1.0, goal.targets)?;
            own.follow(body)?;
            if !goal.load_factor.is_finite() {
                let found = goal.load_factor;
                return Err(StepError::Load { found });
            }
            own.report = EquilibriumReport::default();
            factors.push([body.model.load_factor, goal.load_factor]);
            if let Some(forces) = goal.forces {
                own.load_towards(body, forces)?;
            }
        }
        let result = self.advance(bodies, goals, &factors);
        self.end(bodies, goals, &factors, result.is_err());
        result.map(|()| self.report)
    }

    fn advance(
        &mut self,
        bodies: &mut [&mut Body],
        goals: &[Goal<'_>],
        factors: &[[f64; 2]],
    ) -> Result<(), StepError> {
        let options = self.options;
        in_load_steps(&options, &mut |[done, next]| {
            let mut inverted = 0;
            let each = bodies.iter_mut().zip(goals).zip(factors);
            for (own, ((body, goal), factors)) in self.each.iter_mut().zip(each) {
                inverted += own.begin(body, goal.targets, *factors, next);
            }
            let kept = self.contacts.kept();
            let outcome = self.balance(bodies, part([done, next]));
            let now = bodies.iter().map(|body| body.inverted_count()).sum();
            match judge(&options, outcome, inverted, now) {
                Ok(newton) => {
                    self.report.add(next, newton);
                    Ok(())
                }
                Err(error) => {
                    self.report.refused += 1;
                    self.contacts.go_back_to(kept);
                    for (own, body) in self.each.iter().zip(&mut *bodies) {
                        body.state.x.copy_from_slice(&own.last);
                    }
                    Err(error)
                }
            }
        })
    }

    /// Ends a search with the reports on hands and supports, which the forces of contacts load, too.
    fn end(
        &mut self,
        bodies: &mut [&mut Body],
        goals: &[Goal<'_>],
        factors: &[[f64; 2]],
        failed: bool,
    ) {
        for ((own, body), factors) in self.each.iter_mut().zip(&mut *bodies).zip(factors) {
            own.report = self.report;
            if failed {
                own.go_back(body, *factors);
            }
            own.loads = [Vec::new(), Vec::new()];
        }
        if failed && self.report.reached > 0.0 {
            self.find(bodies, longest(bodies, 0.0));
            self.contacts.end_still();
        }
        for (number, (own, body)) in self.each.iter_mut().zip(&mut *bodies).enumerate() {
            let contacts = &self.contacts;
            own.end(body, goals[number].targets, |body| {
                contacts.each_force(&mut |at, force| {
                    if at.body == number {
                        body.assembly.internal[at.node as usize] += force;
                    }
                });
            });
        }
    }

    /// Finds the rows of the present displacements, before an iteration in which no node moves by more than `longest` (m).
    fn find(&mut self, bodies: &[&mut Body], longest: f64) {
        let each = bodies.iter().zip(&self.vectors);
        let still: Vec<Still<'_>> = each
            .map(|(body, vectors)| Still {
                body,
                u: &vectors.u,
                stiffness: &vectors.stiffness,
            })
            .collect();
        // Two bodies may move against each other.
        self.contacts.begin_still(&still, 2.0 * longest);
    }

    /// Newton's method for a load step that covers `fraction` of the remaining way.
    fn balance(
        &mut self,
        bodies: &mut [&mut Body],
        fraction: f64,
    ) -> Result<NewtonReport, StepError> {
        let mut report = NewtonReport::default();
        let mut prescribed = self.prescribe(bodies, fraction);
        let loads = |body: &&mut Body| {
            let model = &body.model;
            model.load_factor != 0.0 && model.external.iter().any(|f| *f != Vec3::zeros())
        };
        let quiet = prescribed == 0.0 && !bodies.iter().any(loads);
        let mut last = f64::INFINITY;
        self.pace = Pace::default();
        loop {
            for ((body, own), vectors) in
                bodies.iter_mut().zip(&mut self.each).zip(&mut self.vectors)
            {
                body.assemble_with(Tangent::Exact);
                own.newton.balance(body, None);
                vectors.weigh(body);
            }
            self.find(bodies, longest(bodies, prescribed));
            self.judge(bodies, &mut report);
            if !(report.residual.is_finite() && report.reference.is_finite()) {
                return Err(StepError::Diverged {
                    iterations: report.iterations,
                });
            }
            let met = report.residual <= self.options.newton.tolerance * report.reference;
            let floors = bodies.iter().zip(&self.each);
            let floor: f64 = floors
                .map(|(body, own)| own.newton.rounding.of_forces(body, 0.0, 1.0))
                .sum();
            let stands = report.residual > 0.5 * last && report.residual <= FINE * report.reference;
            report.rounded = !met && (report.residual <= floor || stands);
            report.negligible = !met && report.residual <= floor && quiet;
            report.converged = prescribed == 0.0 && (met || report.rounded);
            last = report.residual;
            if report.converged || report.iterations == self.options.newton.max_iterations {
                return Ok(report);
            }
            report.iterations += 1;
            self.iterate(bodies, prescribed, &mut report)?;
            prescribed = 0.0;
        }
    }

    /// Sets the displacements to those that hands and supports prescribe. Returns the longest of them (m).
    fn prescribe(&mut self, bodies: &[&mut Body], fraction: f64) -> f64 {
        let mut longest = 0.0_f64;
        for ((body, own), vectors) in bodies.iter().zip(&self.each).zip(&mut self.vectors) {
            let (supports, u) = (&body.constraints.supports, &mut vectors.u);
            u.fill(Vec3::zeros());
            supports.prescribe(&body.state.x, fraction, u);
            for (node, goal) in body.constraints.held_nodes().zip(&own.held) {
                u[node] = goal - body.state.x[node];
            }
            longest = u.iter().map(Vec3::norm).fold(longest, f64::max);
        }
        longest
    }

    /// Writes the norms of residual and reference forces into `report`: those of all bodies with their contacts.
    fn judge(&self, bodies: &[&mut Body], report: &mut NewtonReport) {
        let mut touch: Vec<Vec<Vec3>> = bodies
            .iter()
            .map(|body| vec![Vec3::zeros(); body.state.x.len()])
            .collect();
        self.contacts
            .each_force(&mut |at, force| touch[at.body][at.node as usize] += force);
        let (mut residual, mut reference) = (0.0, 0.0);
        for ((body, own), touch) in bodies.iter().zip(&self.each).zip(&touch) {
            let mask = body.constraints.supports.mask();
            for (node, touch) in touch.iter().enumerate() {
                let external = body.model.external[node] * body.model.load_factor;
                reference += body.assembly.internal[node].norm_squared()
                    + external.norm_squared()
                    + touch.norm_squared();
                if body.assembly.places.of(node) < body.assembly.places.free() {
                    let r = own.newton.residual()[node] - touch;
                    residual += mask
                        .map_or(r, |mask| r.component_mul(&mask[node]))
                        .norm_squared();
                }
            }
        }
        report.residual = libm::sqrt(residual);
        report.reference = libm::sqrt(reference);
    }

    /// One iteration from the present positions, with the rows that have been found there.
    fn iterate(
        &mut self,
        bodies: &mut [&mut Body],
        prescribed: f64,
        report: &mut NewtonReport,
    ) -> Result<(), StepError> {
        let start: Vec<Vec<Vec3>> = self.vectors.iter().map(|own| own.u.clone()).collect();
        let longest = longest(bodies, prescribed);
        for _ in 0..MOST_GROWTHS {
            let shifts = self.factorize(bodies, report)?;
            let least = FINER * self.options.newton.tolerance * report.reference;
            let left = if prescribed > 0.0 {
                0.0
            } else {
                report.residual
            };
            for again in 0..=AGAIN {
                if again > 0 {
                    // The prediction is the motion that crossed.
                    self.find(bodies, longest);
                    for (own, start) in self.vectors.iter_mut().zip(&start) {
                        own.u.copy_from_slice(start);
                    }
                }
                self.solve_linear(bodies, &shifts, (least, left));
                // Rows that are missing do not make a motion longer.
                if self.moved() > longest {
                    break;
                }
                let displacements: Vec<&[Vec3]> = self.vectors.iter().map(|own| &*own.u).collect();
                if self.contacts.shorten_still(&displacements) == 0 {
                    break;
                }
            }
            let moved = self.moved();
            if !moved.is_finite() {
                return Err(StepError::Diverged {
                    iterations: report.iterations,
                });
            }
            if moved <= longest {
                let part = if self.shift > STATIC_SHIFT || prescribed > 0.0 {
                    self.pace = Pace::default();
                    1.0
                } else {
                    let all = self.vectors.iter().flat_map(|own| &own.u);
                    self.pace.next(all.copied().collect())
                };
                self.take(bodies, part);
                self.shift = (self.shift / GROWTH).max(STATIC_SHIFT);
                return Ok(());
            }
            self.shift = self.shift.max(LEAST) * GROWTH;
            for (own, start) in self.vectors.iter_mut().zip(&start) {
                own.u.copy_from_slice(start);
            }
            self.find(bodies, longest);
        }
        Err(StepError::Diverged {
            iterations: report.iterations,
        })
    }

    /// The longest displacement of a node (m).
    fn moved(&self) -> f64 {
        let each = self.vectors.iter().flat_map(|own| &own.u);
        each.map(Vec3::norm).fold(0.0, |most: f64, own| {
            if most.is_nan() || most >= own {
                most
            } else {
                own
            }
        })
    }

    /// Factorizes the matrices of the bodies, each with its contacts with obstacles, and with all contacts if nothing else holds
    /// it. Returns the part of the mass in each (1/s^2).
    fn factorize(
        &mut self,
        bodies: &mut [&mut Body],
        report: &mut NewtonReport,
    ) -> Result<Vec<f64>, StepError> {
        let mut shifts = Vec::with_capacity(bodies.len());
        let contacts = &self.contacts;
        for (number, (body, own)) in bodies.iter_mut().zip(&mut self.each).enumerate() {
            let held = is_held(body);
            let least = if held { STATIC_SHIFT } else { LEAST };
            let mut shift = self.shift.max(least) * stiffness_per_mass(body);
            let mut factorize = |body: &Body, shift: f64| {
                let assembly = &body.assembly;
                let mut matrix = assembly.stiffness.clone();
                contacts.stiffen(number, !held, assembly.places.of_nodes(), &mut matrix);
                let (cholesky, mass) = (&mut own.newton.cholesky, &assembly.mass);
                cholesky.factorize(&matrix, mass, shift, 1.0, assembly.mask())
            };
            let mut found = factorize(body, shift);
            if matches!(found, Err(CondenseError::NotPositiveDefinite { .. })) {
                report.clipped += 1;
                body.assemble_with(Tangent::Clipped);
                found = factorize(body, shift);
            }
            for _ in 0..MOST_GROWTHS {
                if found.is_ok() {
                    break;
                }
                shift *= GROWTH;
                found = factorize(body, shift);
            }
            found.map_err(StepError::Matrix)?;
            shifts.push(shift);
        }
        Ok(shifts)
    }

    /// Solves the linear equations of the bodies with the rows, to a residual of at least `least` or a part of `left` (N); if
    /// nothing is left, of that of the prescribed motion.
    fn solve_linear(&mut self, bodies: &[&mut Body], shifts: &[f64], (least, left): (f64, f64)) {
        let each = bodies.iter().zip(&mut self.each).zip(&mut self.vectors);
        let mut lent: Vec<Option<Lent<'_>>> = each
            .zip(shifts)
            .map(|(((body, own), vectors), shift)| {
                let mut lent = Lent {
                    body,
                    newton: &mut own.newton,
                    vectors,
                    shift: *shift,
                    goal: 0.0,
                };
                lent.begin();
                Some(lent)
            })
            .collect();
        let moved: f64 = lent
            .iter_mut()
            .flatten()
            .map(|lent| lent.residual().powi(2))
            .sum();
        let left = if left > 0.0 { left } else { moved.sqrt() };
        for lent in lent.iter_mut().flatten() {
            lent.goal = least.max(REDUCED * left);
        }
        self.contacts.solve_still(&mut lent, UPDATES);
    }

    /// Moves the bodies by a `part` of their displacements, as far as nothing crosses, and keeps the forces of the contacts.
    fn take(&mut self, bodies: &mut [&mut Body], part: f64) {
        let each = bodies.iter_mut().zip(&mut self.vectors);
        for (number, (body, vectors)) in each.enumerate() {
            let fractions = self.contacts.fractions(number);
            for (node, (x, u)) in body.state.x.iter_mut().zip(&vectors.u).enumerate() {
                *x += u * (part * fractions.get(node).copied().unwrap_or(1.0));
            }
            vectors.u.fill(Vec3::zeros());
        }
        self.contacts.end_still();
    }
}

/// The longest motion of a node in an iteration (m), if the longest prescribed one has this length (m).
fn longest(bodies: &[&mut Body], prescribed: f64) -> f64 {
    let size = bodies.iter().map(|body| body.size()).fold(0.0, f64::max);
    LONGEST * size + 2.0 * prescribed
}

/// Whether handles and supports hold a body along every axis.
fn is_held(body: &Body) -> bool {
    let guided = body
        .constraints
        .supports
        .mask()
        .is_some_and(|mask| (0..3).all(|axis| mask.iter().any(|free| free[axis] == 0.0)));
    guided || body.constraints.held_nodes().next().is_some()
}
