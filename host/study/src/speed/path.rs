//! The paths: the solvers of a step, behind one interface.
//!
//! A new path needs a variant of [`Method`] with its stepper and its tight version, and an entry in [`ALL`].

use crate::StudyError;
use physics::{
    Body, Budget, HandlePose, Integrator, IntegratorOptions, NewtonOptions, Phase, Precision,
    Preconditioner, Refresher, StepperOptions, TimeScheme,
};
use std::thread;

/// The solver of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Method {
    /// [`Body::step`]: one linearization, its matrix assembled, conjugate gradients with block Jacobi.
    Assembled(Budget),
    /// [`physics::Stepper`]: one linearization, nothing assembled, conjugate gradients on a frozen factor.
    Frozen {
        /// The factor.
        preconditioner: Preconditioner,
        /// Whether the solver works in single precision.
        single: bool,
        /// The solver stops when the residual is below this fraction of the applied forces,
        tolerance: f64,
        /// or after this number of iterations.
        max_iterations: usize,
    },
    /// [`Integrator`]: Newton's method, every matrix factorized.
    Newton {
        /// The discretization of time.
        scheme: TimeScheme,
        /// The solver stops when the residual is below this fraction of the balanced forces.
        tolerance: f64,
    },
}

/// A method with a name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    /// The path's name, in files and tables.
    pub(super) name: &'static str,
    pub(super) method: Method,
    /// Whether the error of the solver is far below the threshold of any hand or test.
    pub(super) strict: bool,
}

/// The report of one step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    /// Iterations of the solver: of conjugate gradients, or of Newton's method.
    pub(super) iterations: usize,
    /// Residual at the end, in the definition of the method.
    pub(super) residual: f64,
}

/// The steps of the body for which the value was made.
pub(super) trait Steps {
    /// Takes a step of `h` seconds.
    ///
    /// # Errors
    /// [`StudyError`].
    fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
    ) -> Result<Outcome, StudyError>;

    /// Work between two steps of `h` seconds whose time does not count.
    ///
    /// # Errors
    /// [`StudyError`].
    fn between(&mut self, _h: f64) -> Result<(), StudyError> {
        Ok(())
    }
}

impl<F: FnMut(&mut Body, f64, &[HandlePose]) -> Result<Outcome, StudyError>> Steps for F {
    fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
    ) -> Result<Outcome, StudyError> {
        self(body, h, targets)
    }
}

/// Conjugate gradients to `tolerance`, with any number of iterations.
pub(super) const fn to(tolerance: f64) -> Method {
    Method::Assembled(Budget {
        tolerance,
        absolute_tolerance: 0.0,
        max_iterations: 100_000,
    })
}

/// A fixed number of iterations of conjugate gradients, with any residual.
pub(super) const fn iterations(max_iterations: usize) -> Method {
    Method::Assembled(Budget {
        tolerance: 0.0,
        absolute_tolerance: 0.0,
        max_iterations,
    })
}

/// The frozen step, in double precision to `tolerance`.
pub(super) const fn frozen(tolerance: f64) -> Method {
    Method::Frozen {
        preconditioner: Preconditioner::Complete,
        single: false,
        tolerance,
        max_iterations: 1000,
    }
}

/// The frozen step, in single precision to `tolerance`, with at most `max_iterations` iterations.
pub(super) const fn single(tolerance: f64, max_iterations: usize) -> Method {
    Method::Frozen {
        preconditioner: Preconditioner::Complete,
        single: true,
        tolerance,
        max_iterations,
    }
}

/// Newton's method on implicit Euler, to nine digits of the balanced forces. Rounding allows no more digits for thin
/// sheets.
pub(super) const NEWTON: Method = Method::Newton {
    scheme: TimeScheme::ImplicitEuler,
    tolerance: 1e-9,
};

/// The paths that are compared. Newton's method comes first: it is the reference for the steps of the others.
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

/// The path for bodies too large for a complete factor; [`ALL`] is for small bodies.
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

/// The phases of a step that read the arrays of a stepper.
const PHASES: [Phase; 3] = [Phase::Linearize, Phase::Product, Phase::Precondition];

/// A frozen stepper. Another thread makes the factors, and its time does not count. The stepper takes a factor after a
/// fixed number of steps, about ten milliseconds and the steps that read the factor ahead, so that errors are
/// reproducible.
struct Frozen<T> {
    stepper: physics::Stepper<T>,
    /// The number of steps before the one that takes the new factor, and the refresher with this factor.
    lent: Option<(usize, Box<Refresher<T>>)>,
    /// Number of parts in which a factor is read ahead.
    parts: usize,
}

impl<T: Precision> Frozen<T> {
    fn new(body: &Body, h: f64, options: StepperOptions) -> Result<Self, StudyError> {
        let mut stepper = physics::Stepper::<T>::new(body, options)?;
        stepper.prepare(body, h)?;
        let mut frozen = Self {
            stepper,
            lent: None,
            parts: Refresher::<T>::parts(h),
        };
        frozen.warm()?;
        Ok(frozen)
    }

    /// Repeats the phases of a step, but not with a new factor. This study waits for each factor, and a host does not.
    /// During a wait of ten milliseconds, other users of the machine take the caches. The next step may then take twice
    /// as long, whatever the program does (the example `motion_tails` of the physics).
    fn warm(&mut self) -> Result<(), StudyError> {
        for _ in 0..2 {
            for phase in PHASES {
                self.stepper.repeat(phase)?;
            }
        }
        Ok(())
    }
}

impl<T: Precision> Steps for Frozen<T> {
    fn step(
        &mut self,
        body: &mut Body,
        h: f64,
        targets: &[HandlePose],
    ) -> Result<Outcome, StudyError> {
        if let Some((_, refresher)) = self.lent.take_if(|(steps, _)| *steps == 0) {
            self.stepper.give_back(refresher);
        }
        let report = self.stepper.step(body, h, targets, || false)?;
        if let Some((steps, refresher)) = &mut self.lent {
            if *steps <= self.parts {
                refresher.read_ahead(self.parts);
            }
            *steps -= 1;
        }
        Ok(Outcome {
            iterations: report.iterations,
            residual: report.residual / report.reference.max(f64::MIN_POSITIVE),
        })
    }

    fn between(&mut self, h: f64) -> Result<(), StudyError> {
        if let Some(mut refresher) = self.stepper.lend() {
            // If the system gives no thread, this one does the work, and its time counts.
            let began = thread::scope(|scope| {
                let other = thread::Builder::new();
                other.spawn_scoped(scope, || refresher.work()).is_ok()
            });
            if !began {
                // A failure shows when the refresher is given back, as it does after a thread.
                let _ = refresher.work();
            }
            let steps = (0.01 / h).ceil() as usize;
            self.lent = Some((steps.saturating_sub(1) + self.parts, refresher));
            self.warm()?;
        }
        Ok(())
    }
}

impl Method {
    /// The same equation, solved as far as double precision permits: the reference for errors of the solver.
    pub(super) fn tight(self) -> Self {
        match self {
            Self::Assembled(_) => to(1e-12),
            Self::Frozen { .. } => frozen(1e-13),
            // Quadratic convergence has already reduced the error below this.
            Self::Newton { .. } => self,
        }
    }

    /// Prepares the method for steps of `h` seconds of `body`. The method may set the budget of `body`.
    ///
    /// # Errors
    /// [`StudyError`] if the method cannot be prepared.
    pub(super) fn stepper(self, body: &mut Body, h: f64) -> Result<Box<dyn Steps>, StudyError> {
        Ok(match self {
            Self::Assembled(budget) => {
                body.set_budget(budget)?;
                Box::new(|body: &mut Body, h: f64, targets: &[HandlePose]| {
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
                    // The measurement is of stepping, not of sleep.
                    sleep_speed: 0.0,
                    // Another thread does this work: see `lend`.
                    refresh: false,
                    ..StepperOptions::default()
                };
                if single {
                    Box::new(Frozen::<f32>::new(body, h, options)?)
                } else {
                    Box::new(Frozen::<f64>::new(body, h, options)?)
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
                Box::new(move |body: &mut Body, h: f64, targets: &[HandlePose]| {
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
