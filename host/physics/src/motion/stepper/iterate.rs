//! The solver of a stepper: conjugate gradients, preconditioned by a frozen factor.

use super::guess::Sums;
use super::learned::Learned;
use super::places::Places;
use super::{RUN, Stepper, StepperReport, total};
use crate::element::precision::Precision;
use crate::lanes::{Node, to_vec};
use crate::linear::vectors;
use crate::team;

/// What conjugate gradients solve for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Solved {
    /// The motion of a step.
    Step,
    /// A shape of the condensation, whose matrix has less mass.
    Shape,
}

/// The limits at which conjugate gradients stop.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    pub(crate) of: Solved,
    /// Whether the preconditioner uses what earlier solves learned.
    pub(crate) uses_learned: bool,
    /// The iterations stop at this residual (N).
    pub(crate) goal: f64,
    /// An initial residual up to this value (N) needs no iteration.
    pub(crate) start: f64,
    pub(crate) max_iterations: usize,
}

/// The vectors of conjugate gradients, by place.
#[derive(Debug)]
pub(crate) struct Vectors<T> {
    /// Mass in the matrix of the present solve (kg/s^2).
    pub(super) inertia: Vec<T>,
    /// Displacement over the step (m).
    pub(crate) u: Vec<Node<T>>,
    pub(crate) residual: Vec<Node<T>>,
    /// The preconditioned residual, the direction, and its product with the matrix.
    pub(super) z: Vec<Node<f32>>,
    pub(super) p: Vec<Node<T>>,
    pub(super) q: Vec<Node<T>>,
    /// Displacement and residual where a pass of contact began; empty for a body that touches nothing.
    pub(super) marked: [Vec<Node<T>>; 2],
    /// Room for the partial sums of runs, and for those of the guess.
    pub(super) sums: Vec<f64>,
    pub(super) fits: Vec<Sums>,
    /// What the last solves tell the preconditioner: those of the steps, and those of the shapes. Without room for pairs
    /// nothing is learned.
    pub(super) learned: [Learned; 2],
}

impl<T: Precision> Vectors<T> {
    pub(super) fn new(places: &Places<T>) -> Self {
        let count = places.node.len();
        let zeros = vec![[T::ZERO; 4]; count];
        Self {
            inertia: vec![T::ZERO; count],
            u: zeros.clone(),
            residual: zeros.clone(),
            z: vec![[0.0; 4]; places.held],
            p: zeros.clone(),
            q: zeros,
            marked: Default::default(),
            sums: vec![0.0; 2 * count.div_ceil(RUN)],
            fits: vec![Sums::default(); count.div_ceil(RUN)],
            learned: Default::default(),
        }
    }
}

impl<T: Precision> Stepper<T> {
    /// Conjugate gradients from `u` and `residual` (Saad, "Iterative methods for sparse linear systems", algorithm
    /// 9.1). Held places have no direction. Their residual is updated in each iteration; it is minus the force of the
    /// hand.
    pub(crate) fn iterate(
        &mut self,
        (mass_factor, stiffness_factor): (f64, f64),
        limits: Limits,
        out_of_time: &mut dyn FnMut() -> bool,
    ) -> StepperReport {
        let free = self.places.free;
        self.weigh(mass_factor);
        let mut report = StepperReport {
            residual: self.norm(),
            ..StepperReport::default()
        };
        let first = report.residual;
        report.converged = report.residual <= limits.start;
        let mut rz = 1.0;
        self.cg.learned[limits.of as usize].begin(limits.uses_learned);
        while !report.converged && report.iterations < limits.max_iterations {
            let rz_new = self.precondition(limits.of);
            // The preconditioner is positive definite. Any other product is rounding, or a state that has diverged.
            if !(rz_new > 0.0 && rz_new.is_finite()) {
                self.cg.p.fill([T::ZERO; 4]);
                break;
            }
            let beta = if report.iterations == 0 {
                0.0
            } else {
                rz_new / rz
            };
            rz = rz_new;
            self.direct(beta, stiffness_factor);
            let curvature = self.curvature();
            // The matrix is positive definite. Any other curvature is underflow, or a state that has diverged.
            if !(curvature > 0.0 && curvature.is_finite()) {
                // The next solve multiplies this direction by zero, and zero times a value that is not a number is not
                // a number.
                self.cg.p.fill([T::ZERO; 4]);
                break;
            }
            let learned = &mut self.cg.learned[limits.of as usize];
            learned.learn(&self.cg.p[..free], &self.cg.q[..free], curvature);
            report.iterations += 1;
            report.residual = self.advance(rz / curvature);
            report.converged = report.residual <= limits.goal;
            if out_of_time() {
                break;
            }
        }
        report.converged |= report.residual <= limits.goal;
        if report.iterations > 0 {
            report.rate = libm::pow(report.residual / first, 1.0 / report.iterations as f64);
        }
        report
    }

    /// The next direction `p`: `z` and `beta` times the direction before. Its product with the matrix is in `q`.
    pub(super) fn direct(&mut self, beta: f64, stiffness_factor: f64) {
        let (team, free) = (&*self.team, self.places.free);
        let Vectors {
            z, inertia, p, q, ..
        } = &mut self.cg;
        let places = (&z[..free], &**inertia, &mut p[..free], &mut q[..free]);
        team::each_of(team, places, RUN, &|(z, inertia, p, q)| {
            vectors::turn(z, T::of(beta), inertia, p, q);
        });
        q[free..].fill([T::ZERO; 4]);
        self.elements.product(team, T::of(stiffness_factor), p, q);
        self.pairs.add_springs(&self.places.of, p, q);
    }

    /// The product of the direction `p` with `q`.
    pub(super) fn curvature(&mut self) -> f64 {
        let (cg, free) = (&mut self.cg, self.places.free);
        let places = (&cg.p[..free], &cg.q[..free]);
        let curvature = team::runs(&*self.team, places, RUN, &mut cg.sums, &|(p, q)| {
            vectors::dot(p, q)
        });
        total(curvature)
    }

    /// Moves by `alpha` times the direction. Returns the norm of the residual on free axes (N).
    pub(super) fn advance(&mut self, alpha: f64) -> f64 {
        let (cg, free) = (&mut self.cg, self.places.free);
        let alpha = T::of(alpha);
        // Held places have a residual but no direction.
        let (free_residual, held_residual) = cg.residual.split_at_mut(free);
        let (free_q, held_q) = cg.q.split_at(free);
        let places = (&cg.p[..free], free_q, &mut cg.u[..free], free_residual);
        let square = team::runs(&*self.team, places, RUN, &mut cg.sums, &|(
            p,
            q,
            u,
            residual,
        )| {
            vectors::advance(alpha, p, q, u, residual)
        });
        let square = total(square);
        for (r, q) in held_residual.iter_mut().zip(held_q) {
            for i in 0..4 {
                r[i] -= alpha * q[i];
            }
        }
        if self.places.mask.is_empty() {
            square.sqrt()
        } else {
            self.norm()
        }
    }

    /// Computes the mass in the matrix.
    pub(super) fn weigh(&mut self, mass_factor: f64) {
        for (inertia, mass) in self.cg.inertia.iter_mut().zip(&self.places.mass) {
            *inertia = T::of(mass_factor * mass);
        }
    }

    /// Computes `z` from the residual, without guided axes. Returns the product of the two vectors.
    pub(crate) fn precondition(&mut self, of: Solved) -> f64 {
        let free = self.places.free;
        let cg = &mut self.cg;
        let places = (&mut cg.z[..free], &*cg.residual);
        team::each_of(&*self.team, places, RUN, &|(z, residual)| {
            vectors::round(residual, z);
        });
        cg.learned[of as usize].before(&mut cg.z[..free]);
        self.solve_factor();
        let cg = &mut self.cg;
        self.pairs.hold(&self.places.of, &mut cg.z[..free]);
        cg.learned[of as usize].after(&mut cg.z[..free]);
        let places = (&cg.z[..free], &*cg.residual);
        let products = team::runs(&*self.team, places, RUN, &mut cg.sums, &|(z, residual)| {
            vectors::dot_single(z, residual)
        });
        total(products)
    }

    /// Solves with the factor in place of the matrix, in `z`, without guided axes.
    pub(crate) fn solve_factor(&mut self) {
        let z = &mut self.cg.z[..self.places.free];
        vectors::filter(&self.places.mask, z);
        let (team, solves) = (&*self.team, &mut self.factor.solves);
        match &mut self.growth {
            Some(growth) if !growth.is_plain() => {
                growth.apply(z, &self.places.mask, |z| solves.solve(team, z));
            }
            _ => solves.solve(team, z),
        }
        vectors::filter(&self.places.mask, z);
    }

    /// Norm of the residual on free axes (N).
    pub(crate) fn norm(&mut self) -> f64 {
        let free = &self.cg.residual[..self.places.free];
        if self.places.mask.is_empty() {
            let squares = team::runs(&*self.team, free, RUN, &mut self.cg.sums, &|residual| {
                vectors::dot(residual, residual)
            });
            return total(squares).sqrt();
        }
        let mut sum = 0.0;
        for (r, mask) in free.iter().zip(&self.places.mask) {
            let r = to_vec(r).component_mul(&to_vec(mask));
            sum += r.norm_squared();
        }
        sum.sqrt()
    }
}
