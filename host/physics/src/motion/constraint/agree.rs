//! The forces of laws that agree with the openings.
//!
//! The openings of all laws follow from the forces by their responses, and the forces from the openings by the laws. This
//! is a small nonlinear system with one unknown a law. It has a solution for any stiffness of a law. A law that falls
//! faster than the body unloads has several solutions. The first one is taken that a growing opening meets.

use super::law::Law;

/// Sweeps over the laws.
const SWEEPS: usize = 30;
/// Most steps of Newton's method, and the change of a force that ends them, relative to the force.
const MOST_NEWTON: usize = 20;
const ENOUGH: f64 = 1e-12;

/// The system, for a fixed number of laws at most.
#[derive(Debug, Default)]
pub(super) struct Agreement {
    most: usize,
    /// The response of each opening to each force (m/N), by rows of `most`.
    responses: Vec<f64>,
    /// Openings under the present forces of the laws (m).
    pub(super) openings: Vec<f64>,
    /// The forces that agree (N).
    pub(super) forces: Vec<f64>,
    /// Openings with these forces (m), their changes, and the equations of the changes, by rows of `most`.
    found: Vec<f64>,
    shifts: Vec<f64>,
    equations: Vec<f64>,
}

impl Agreement {
    /// Room for `most` laws.
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            responses: vec![0.0; most * most],
            openings: vec![0.0; most],
            forces: vec![0.0; most],
            found: vec![0.0; most],
            shifts: vec![0.0; most],
            equations: vec![0.0; most * most],
        }
    }

    /// Sets by how much the opening of the law `row` falls with the force of the law `column` (m/N).
    pub(super) fn set_response(&mut self, row: usize, column: usize, response: f64) {
        self.responses[row * self.most + column] = response;
    }

    /// Solves for the forces, in `forces`. Returns the largest change of a force (N). The change is
    /// NaN if a force is NaN.
    ///
    /// With `stays`, the openings are those of a solution that is nearly exact. The forces then stay on its branch of the
    /// laws, if they can: otherwise two solutions in turn could be the first.
    pub(super) fn solve(&mut self, laws: &[impl Law], stays: bool) -> f64 {
        for (force, law) in self.forces.iter_mut().zip(laws) {
            *force = law.force();
        }
        let mut is_exact = false;
        if stays {
            let count = laws.len();
            self.found[..count].copy_from_slice(&self.openings[..count]);
            is_exact = self.newton(laws);
        }
        if !is_exact && !self.sweep(laws) {
            self.newton(laws);
        }
        let changes = laws.iter().zip(&self.forces);
        let changes = changes.map(|(law, force)| (force - law.force()).abs());
        // A change that is not a number is the largest.
        changes.fold(
            0.0,
            |most, change| if change <= most { most } else { change },
        )
    }

    /// Gauss and Seidel's method, as for contacts: each law in turn takes the first solution for itself. Returns whether
    /// the last sweep changed nothing.
    fn sweep(&mut self, laws: &[impl Law]) -> bool {
        for _ in 0..SWEEPS {
            let mut changed = 0.0_f64;
            for (row, law) in laws.iter().enumerate() {
                let responses = &self.responses[row * self.most..][..laws.len()];
                let mut free = self.openings[row];
                for (other, response) in responses.iter().enumerate() {
                    if other != row {
                        free -= response * (self.forces[other] - laws[other].force());
                    }
                }
                free += responses[row] * law.force();
                let opening = law.meet(free, responses[row]);
                let force = law.value(opening);
                changed = changed.max((force - self.forces[row]).abs());
                self.forces[row] = force;
                self.found[row] = opening;
            }
            if changed == 0.0 {
                return true;
            }
        }
        false
    }

    /// Newton's method from the openings in `found`. Two laws beside each other respond nearly alike, and thousands of
    /// sweeps would be needed then. The forces stay as they are if the method does not converge; returns whether it
    /// does.
    fn newton(&mut self, laws: &[impl Law]) -> bool {
        let most = self.most;
        for _ in 0..MOST_NEWTON {
            for row in 0..laws.len() {
                let mut off = self.found[row] - self.openings[row];
                for (column, law) in laws.iter().enumerate() {
                    let (response, opening) =
                        (self.responses[row * most + column], self.found[column]);
                    off += response * (law.value(opening) - law.force());
                    let own = if row == column { 1.0 } else { 0.0 };
                    self.equations[row * most + column] = own + response * law.tangent(opening);
                }
                self.shifts[row] = -off;
            }
            eliminate(&mut self.equations, most, &mut self.shifts[..laws.len()]);
            let mut is_done = true;
            let found = self.found.iter_mut().zip(&self.shifts);
            for (law, (found, shift)) in laws.iter().zip(found) {
                let before = law.value(*found);
                *found += shift;
                let after = law.value(*found);
                // The comparison is false for a value that is not a number.
                is_done &= (after - before).abs() <= ENOUGH * law.scale().max(after.abs());
            }
            if is_done {
                let found = laws.iter().zip(&self.found);
                for (force, (law, found)) in self.forces.iter_mut().zip(found) {
                    *force = law.value(*found);
                }
                return true;
            }
        }
        false
    }
}

/// Solves a dense system in place, with rows of `stride` numbers, by Gaussian elimination with row exchanges (Golub and
/// Van Loan, "Matrix computations", section 3.4). A singular matrix gives values that are not finite.
fn eliminate(matrix: &mut [f64], stride: usize, values: &mut [f64]) {
    let count = values.len();
    for step in 0..count {
        let size = |row: usize, matrix: &[f64]| matrix[row * stride + step].abs();
        let best = (step..count).fold(step, |best, row| {
            if size(row, matrix) > size(best, matrix) {
                row
            } else {
                best
            }
        });
        if best != step {
            for column in 0..count {
                matrix.swap(step * stride + column, best * stride + column);
            }
            values.swap(step, best);
        }
        for row in step + 1..count {
            let factor = matrix[row * stride + step] / matrix[step * stride + step];
            for column in step..count {
                matrix[row * stride + column] -= factor * matrix[step * stride + column];
            }
            values[row] -= factor * values[step];
        }
    }
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count)
            .map(|at| matrix[row * stride + at] * values[at])
            .sum();
        values[row] = (values[row] - known) / matrix[row * stride + row];
    }
}
