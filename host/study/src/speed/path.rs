//! The paths: each way in which a step can be solved, under one call.
//!
//! A new one is a variant of [`Method`], its stepper and its tight version, and an entry in [`ALL`].

use crate::StudyError;
use physics::{
    Body, Budget, HandlePose, Integrator, IntegratorOptions, NewtonOptions, Preconditioner, Real,
    Refresher, Scheme, StepperOptions,
};
use std::thread;

/// How a step is solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    /// [`Body::step`]: one linearization, its matrix assembled, conjugate gradients with block Jacobi.
    Assembled(Budget),
    /// [`physics::Stepper`]: one linearization, nothing assembled, conjugate gradients on a frozen factor.
    Frozen {
        /// Which factor.
        preconditioner: Preconditioner,
        /// Whether in single precision.
        single: bool,
        /// Where the residual is this share of the forces that act, it stops.
        tolerance: f64,
        /// Or after so many iterations.
        max_iterations: usize,
    },
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
    Box<dyn FnMut(&mut Body, f64, &[HandlePose]) -> Result<Outcome, StudyError>>;

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

/// Nothing assembled, in double precision down to `tolerance`.
pub(super) const fn frozen(tolerance: f64) -> Method {
    Method::Frozen {
        preconditioner: Preconditioner::Complete,
        single: false,
        tolerance,
        max_iterations: 1000,
    }
}

/// Nothing assembled, in single precision down to `tolerance`, at most so many iterations.
pub(super) const fn single(tolerance: f64, max_iterations: usize) -> Method {
    Method::Frozen {
        preconditioner: Preconditioner::Complete,
        single: true,
        tolerance,
        max_iterations,
    }
}

/// Newton's method on implicit Euler, to nine digits of the forces that balance: rounding leaves no more of
/// thin sheets' forces.
pub(super) const NEWTON: Method = Method::Newton {
    scheme: Scheme::ImplicitEuler,
    tolerance: 1e-9,
};

/// The paths that are compared, Newton's method first: the others' steps are held against its.
pub(super) const ALL: [Path; 8] = [
    Path {
        name: "newton 1e-9",
        method: NEWTON,
        strict: true,
    },
    Path {
        name: "frozen 1e-9",
        method: frozen(1e-9),
        strict: true,
    },
    Path {
        name: "frozen 1e-6",
        method: frozen(1e-6),
        strict: true,
    },
    Path {
        name: "single 1e-3",
        method: single(1e-3, 1000),
        strict: false,
    },
    Path {
        name: "single 1 it",
        method: single(0.0, 1),
        strict: false,
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

/// For bodies too large for a complete factor: [`ALL`] is of small ones.
pub(super) const INCOMPLETE: Path = Path {
    name: "incomplete 1e-6",
    method: Method::Frozen {
        preconditioner: Preconditioner::Incomplete,
        single: false,
        tolerance: 1e-6,
        max_iterations: 1000,
    },
    strict: true,
};

/// Factors are made on another thread, whose time is not the step's, and taken a fixed number of steps later: about
/// ten milliseconds, so that errors repeat.
fn frozen_stepper<T: Real>(
    body: &Body,
    h: f64,
    options: StepperOptions,
) -> Result<Stepper, StudyError> {
    let mut stepper = physics::Stepper::<T>::new(body, options)?;
    stepper.prepare(body, h)?;
    let mut lent: Option<(u32, Box<Refresher<T>>)> = None;
    Ok(Box::new(move |body, h, targets| {
        match lent.take() {
            Some((0 | 1, refresher)) => stepper.give_back(refresher),
            Some((steps, refresher)) => lent = Some((steps - 1, refresher)),
            None => {}
        }
        let report = stepper.step(body, h, targets, || false)?;
        if let Some(mut refresher) = stepper.lend() {
            thread::scope(|scope| scope.spawn(|| refresher.work()).join()).ok();
            lent = Some(((0.01 / h).ceil() as u32, refresher));
        }
        Ok(Outcome {
            iterations: report.iterations,
            residual: report.residual / report.reference.max(f64::MIN_POSITIVE),
        })
    }))
}

impl Method {
    /// The same equation, solved as far as double precision lets it: what errors of the solver are against.
    pub(super) fn tight(self) -> Self {
        match self {
            Self::Assembled(_) => to(1e-12),
            Self::Frozen { .. } => frozen(1e-13),
            // Quadratic convergence has left less than this of the error already.
            Self::Newton { .. } => self,
        }
    }

    /// Makes it ready for steps of `h` seconds of `body`, which may be given a budget.
    ///
    /// # Errors
    /// [`StudyError`], from what the method needs.
    pub(super) fn stepper(self, body: &mut Body, h: f64) -> Result<Stepper, StudyError> {
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
            Self::Frozen {
                preconditioner,
                single,
                tolerance,
                max_iterations,
            } => {
                let options = StepperOptions {
                    preconditioner,
                    tolerance,
                    max_iterations,
                    // What is measured is stepping.
                    sleep_speed: 0.0,
                    // Another thread's work: see `lend`.
                    refresh: false,
                    ..StepperOptions::default()
                };
                if single {
                    frozen_stepper::<f32>(body, h, options)?
                } else {
                    frozen_stepper::<f64>(body, h, options)?
                }
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
