//! The paths: each way in which a step can be solved, under one call.
//!
//! A new one is a variant of [`Method`], its stepper and its tight version, and an entry in [`ALL`].

use super::SpeedError;
use physics::fem::{
    Body, Budget, HandlePose, Integrator, IntegratorOptions, NewtonOptions, Scheme,
};

/// How a step is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    /// [`Body::step`]: one linearization, its matrix assembled, conjugate gradients with block Jacobi.
    Assembled(Budget),
    /// [`Integrator`]: Newton's method, every matrix factorized.
    Newton {
        /// How time is discretized.
        scheme: Scheme,
        /// Where the residual is this share of the forces that balance, it stops.
        tolerance: f64,
    },
}

/// A method with a name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    /// For programs and people.
    pub(super) name: &'static str,
    pub(super) method: Method,
    /// Whether what the solver leaves over is far below what any hand or test could tell.
    pub(super) strict: bool,
}

/// What one step says of itself.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    /// Iterations of the solver: of conjugate gradients, or of Newton's method.
    pub(super) iterations: usize,
    /// Residual at the end, as the method measures it.
    pub(super) residual: f64,
}

/// Takes one step of a body that it was made for.
pub(super) type Stepper =
    Box<dyn FnMut(&mut Body, f64, &[HandlePose]) -> Result<Outcome, SpeedError>>;

/// Conjugate gradients down to `tolerance`, however many iterations that takes.
pub(super) const fn to(tolerance: f64) -> Method {
    Method::Assembled(Budget {
        tolerance,
        absolute_tolerance: 0.0,
        max_iterations: 100_000,
    })
}

/// So many iterations of conjugate gradients, whatever is left over.
pub(super) const fn iterations(max_iterations: usize) -> Method {
    Method::Assembled(Budget {
        tolerance: 0.0,
        absolute_tolerance: 0.0,
        max_iterations,
    })
}

/// Newton's method on implicit Euler, to nine digits of the forces that balance: rounding leaves no more of
/// thin sheets' forces.
pub(super) const NEWTON: Method = Method::Newton {
    scheme: Scheme::ImplicitEuler,
    tolerance: 1e-9,
};

/// The paths that are compared, Newton's method first: the others' steps are held against its.
pub(super) const ALL: [Path; 4] = [
    Path {
        name: "newton 1e-9",
        method: NEWTON,
        strict: true,
    },
    Path {
        name: "assembled 1e-6",
        method: to(1e-6),
        strict: true,
    },
    Path {
        name: "assembled 1e-3",
        method: to(1e-3),
        strict: false,
    },
    Path {
        name: "assembled 25 it",
        method: iterations(25),
        strict: false,
    },
];

impl Method {
    /// The same equation, solved as far as double precision lets it: what errors of the solver are against.
    pub(super) fn tight(self) -> Self {
        match self {
            Self::Assembled(_) => to(1e-12),
            // Quadratic convergence has left less than this of the error already.
            Self::Newton { .. } => self,
        }
    }

    /// Makes it ready for `body`, which may be given a budget.
    ///
    /// # Errors
    /// [`SpeedError`], from what the method needs.
    pub(super) fn stepper(self, body: &mut Body) -> Result<Stepper, SpeedError> {
        Ok(match self {
            Self::Assembled(budget) => {
                body.set_budget(budget)?;
                Box::new(|body, h, targets| {
                    let report = body.step(h, targets)?;
                    Ok(Outcome {
                        iterations: report.iterations,
                        residual: report.relative_residual(),
                    })
                })
            }
            Self::Newton { scheme, tolerance } => {
                let options = IntegratorOptions {
                    scheme,
                    newton: NewtonOptions {
                        tolerance,
                        ..NewtonOptions::default()
                    },
                    ..IntegratorOptions::default()
                };
                let mut integrator = Integrator::new(body, options)?;
                Box::new(move |body, h, targets| {
                    let report = integrator.step(body, h, targets)?;
                    Ok(Outcome {
                        iterations: report.iterations,
                        residual: report.relative_residual,
                    })
                })
            }
        })
    }
}
