//! Conjugate gradients for the step, preconditioned by the 3 x 3 diagonal blocks.
//!
//! Preconditioned conjugate gradients (Saad, "Iterative methods for sparse linear systems", algorithm 9.1). The step
//! matrix is never formed: a product combines mass and stiffness while it reads them.

use super::step_matrix::StepMatrix;
use crate::{Mat3, Vec3};

/// The conditions that end the iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// Stop when the residual is below this fraction of the initial residual.
    pub tolerance: f64,
    /// Stop when the residual is below this (N).
    pub absolute_tolerance: f64,
    /// Stop after this many iterations, converged or not.
    pub max_iterations: usize,
}

/// The report of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolveReport {
    /// Iterations spent.
    pub iterations: usize,
    /// Norm of the residual at the initial guess (N): the velocity of the previous step.
    pub initial_residual: f64,
    /// Norm of the residual at the end (N), by the recurrence.
    pub final_residual: f64,
    /// Whether a tolerance was met within the budget.
    pub converged: bool,
    /// Fraction of the motion that the guard withheld, because the full motion would have created energy. It is
    /// usually 0.
    pub held_back: f64,
}

impl SolveReport {
    /// The ratio of the residual at the end to the initial residual, or 0 if the guess was exact.
    pub fn relative_residual(&self) -> f64 {
        if self.initial_residual > 0.0 {
            self.final_residual / self.initial_residual
        } else {
            0.0
        }
    }
}

/// The vectors of the iteration, kept from step to step.
#[derive(Clone, Debug)]
pub(crate) struct Pcg {
    /// Residual. The caller sets it to the residual of the guess.
    pub(crate) residual: Vec<Vec3>,
    direction: Vec<Vec3>,
    image: Vec<Vec3>,
    inverse: Vec<Mat3>,
}

impl Pcg {
    pub(crate) fn new(free: usize) -> Self {
        Self {
            residual: vec![Vec3::zeros(); free],
            direction: vec![Vec3::zeros(); free],
            image: vec![Vec3::zeros(); free],
            inverse: vec![Mat3::zeros(); free],
        }
    }

    /// Memory of the vectors (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.residual.as_slice())
            + size_of_val(self.direction.as_slice())
            + size_of_val(self.image.as_slice())
            + size_of_val(self.inverse.as_slice())
    }

    /// Improves `u`, whose residual is `self.residual`, until `budget` stops the iteration.
    pub(crate) fn solve(
        &mut self,
        matrix: &StepMatrix<'_>,
        u: &mut [Vec3],
        budget: &Budget,
    ) -> SolveReport {
        let mut rr = 0.0;
        let mut rz = 0.0;
        for row in 0..self.residual.len() {
            let mut block = matrix.stiffness.diagonal(row) * matrix.stiffness_factor;
            for i in 0..3 {
                block[(i, i)] += matrix.mass_factor * matrix.mass[row];
            }
            if let Some(mask) = matrix.mask {
                self.residual[row].component_mul_assign(&mask[row]);
                uncouple(&mut block, &mask[row]);
            }
            self.inverse[row] = block.try_inverse().unwrap_or_else(Mat3::identity);
            let r = self.residual[row];
            let z = self.inverse[row] * r;
            self.direction[row] = z;
            rr += r.norm_squared();
            rz += r.dot(&z);
        }
        let initial = libm::sqrt(rr);
        let goal = (budget.tolerance * initial).max(budget.absolute_tolerance);
        let mut report = SolveReport {
            iterations: 0,
            initial_residual: initial,
            final_residual: initial,
            converged: initial <= goal,
            held_back: 0.0,
        };
        while !report.converged && report.iterations < budget.max_iterations {
            let curvature = matrix.product(&self.direction, &mut self.image);
            // The matrix is positive definite. Another curvature results from underflow or from a diverged state,
            // and the next line would divide by it.
            if !(curvature > 0.0 && curvature.is_finite()) {
                break;
            }
            let alpha = rz / curvature;
            let mut rz_new = 0.0;
            rr = 0.0;
            for row in 0..self.residual.len() {
                u[row] += self.direction[row] * alpha;
                let r = self.residual[row] - self.image[row] * alpha;
                let z = self.inverse[row] * r;
                self.residual[row] = r;
                self.image[row] = z;
                rr += r.norm_squared();
                rz_new += r.dot(&z);
            }
            let beta = rz_new / rz;
            rz = rz_new;
            for (p, z) in self.direction.iter_mut().zip(&self.image) {
                *p = z + *p * beta;
            }
            report.iterations += 1;
            report.final_residual = libm::sqrt(rr);
            report.converged = report.final_residual <= goal;
        }
        report
    }
}

/// Uncouples the guided axes of a diagonal block. A guided axis has no residual, so the search direction is zero there.
fn uncouple(block: &mut Mat3, mask: &Vec3) {
    for axis in 0..3 {
        if mask[axis] == 0.0 {
            block.row_mut(axis).fill(0.0);
            block.column_mut(axis).fill(0.0);
            block[(axis, axis)] = 1.0;
        }
    }
}
