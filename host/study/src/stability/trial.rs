//! A body that is stepped and observed.

use super::Kind;
use crate::StudyError;
use physics::{
    Body, HandlePose, Integrator, IntegratorOptions, Stepper, StepperOptions, TimeScheme, Vec3,
};
use serde::Serialize;
use std::fmt::Display;

/// The scheme that steps a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// Implicit Euler, solved to its tolerance.
    ImplicitEuler,
    /// TR-BDF2, solved to its tolerance.
    TrBdf2,
    /// Implicit Euler with one linearization, assembled.
    Linearized,
    /// The same on a frozen factor: the realtime step.
    Frozen,
}

/// Rounding error of an energy, as a fraction. A velocity is a difference of positions over the step, so in a body of 1
/// m at 3e-4 m/s a step of 1e-4 s leaves a relative error of 1e-16 / (1e-4 * 3e-4) = 3e-9 in the velocity. The error is
/// ten times as large if TR-BDF2 extrapolates. Newton's method leaves 1e-9 of the forces. These errors accumulate
/// over the steps.
pub(super) const ROUNDING: f64 = 1e-6;

impl Method {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::ImplicitEuler => "implicit Euler",
            Self::TrBdf2 => "TR-BDF2",
            Self::Linearized => "linearized step",
            Self::Frozen => "frozen step",
        }
    }

    /// Approximate time of a step, relative to the other methods.
    pub(super) fn cost(self) -> f64 {
        match self {
            Self::ImplicitEuler => 1.0,
            Self::TrBdf2 => 2.0,
            Self::Linearized | Self::Frozen => 0.5,
        }
    }

    /// Largest allowed excess of the energy over its initial value, as a fraction of that value.
    pub(super) fn allowed_excess(self, kind: Kind) -> f64 {
        if self.never_gains(kind) {
            ROUNDING
        } else {
            // L-stability is defined for linear bodies only; other bodies have a bound of their own.
            0.01
        }
    }

    /// Whether the energy may not rise again after it has fallen. Implicit Euler guarantees this for convex energies.
    /// For other energies it holds as long as a step stays on one side of a barrier.
    pub(super) fn never_gains(self, kind: Kind) -> bool {
        self == Self::ImplicitEuler || (self == Self::TrBdf2 && kind.is_quadratic_in_energy())
    }

    /// Whether the method uses one linearization a step.
    pub(super) fn is_linearized(self) -> bool {
        matches!(self, Self::Linearized | Self::Frozen)
    }

    pub(super) fn options(self) -> IntegratorOptions {
        let scheme = if self == Self::TrBdf2 {
            TimeScheme::TrBdf2
        } else {
            TimeScheme::ImplicitEuler
        };
        IntegratorOptions {
            scheme,
            ..IntegratorOptions::default()
        }
    }
}

/// The counts over a case.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Account {
    /// Steps that were requested.
    pub steps: usize,
    /// Steps that were refused with an error.
    pub refused: usize,
    /// Substeps of all steps that were taken; equal to their number if none was halved.
    pub substeps: usize,
    /// Substeps of TR-BDF2 that were taken by implicit Euler, and linearized steps of which a part was held back. Both
    /// prevent a gain of energy.
    pub damped: usize,
    /// The largest residual of a step that was taken, as a fraction of the balanced forces.
    pub residual: f64,
    /// The first error.
    pub error: Option<String>,
    /// A violation that no step may cause: a number that is not finite, or a refused step that moved the body.
    pub broken: Option<String>,
}

/// The report of a step, for [`Account`].
#[derive(Default)]
struct Taken {
    substeps: usize,
    damped: usize,
    residual: f64,
}

/// The solver that steps a body.
#[derive(Debug)]
enum Stepped {
    Assembled,
    Frozen(Box<Stepper<f64>>),
    Solved(Box<Integrator>),
}

/// A body, its solver, and the record of its steps.
#[derive(Debug)]
pub(super) struct Trial {
    pub(super) body: Body,
    stepped: Stepped,
    before: Vec<u64>,
    after: Vec<u64>,
    pub(super) account: Account,
    energy: Energy,
}

/// The history of an energy (J).
#[derive(Clone, Copy, Debug)]
pub(super) struct Energy {
    start: f64,
    highest: f64,
    least: f64,
    rise: f64,
}

impl Energy {
    pub(super) fn new(start: f64) -> Self {
        Self {
            start,
            highest: start,
            least: start,
            rise: 0.0,
        }
    }

    pub(super) fn add(&mut self, energy: f64) {
        // An energy that is not a number exceeds every bound.
        let energy = if energy.is_nan() {
            f64::INFINITY
        } else {
            energy
        };
        self.rise = self.rise.max(energy - self.least);
        self.highest = self.highest.max(energy);
        self.least = self.least.min(energy);
    }

    /// Largest excess over the initial value (J).
    pub(super) fn excess(&self) -> f64 {
        self.highest - self.start
    }

    /// Largest rise over an earlier minimum (J).
    pub(super) fn rise(&self) -> f64 {
        self.rise
    }
}

impl Trial {
    pub(super) fn new(body: Body, method: Method) -> Result<Self, StudyError> {
        let options = method.options();
        Self::with_options(body, method, options)
    }

    pub(super) fn with_options(
        body: Body,
        method: Method,
        options: IntegratorOptions,
    ) -> Result<Self, StudyError> {
        let stepped = match method {
            Method::Linearized => Stepped::Assembled,
            Method::Frozen => {
                let options = StepperOptions::default();
                Stepped::Frozen(Box::new(Stepper::new(&body, options)?))
            }
            _ => Stepped::Solved(Box::new(Integrator::new(&body, options)?)),
        };
        let energy = Energy::new(body.total_energy());
        Ok(Self {
            body,
            stepped,
            before: Vec::new(),
            after: Vec::new(),
            account: Account::default(),
            energy,
        })
    }

    /// Takes one step. Returns whether the step was taken.
    pub(super) fn step(&mut self, h: f64, targets: &[HandlePose]) -> bool {
        self.watch(|body, stepped| match stepped {
            Stepped::Solved(integrator) => integrator.step(body, h, targets).map(|report| Taken {
                substeps: report.substeps,
                damped: report.damped,
                residual: report.relative_residual,
            }),
            Stepped::Assembled => body.step(h, targets).map(|report| Taken {
                substeps: 1,
                damped: usize::from(report.held_back > 0.0),
                residual: report.relative_residual(),
            }),
            Stepped::Frozen(stepper) => {
                stepper
                    .step(body, h, targets, || false)
                    .map(|report| Taken {
                        substeps: 1,
                        damped: usize::from(report.held_back > 0.0),
                        residual: report.residual / report.reference.max(f64::MIN_POSITIVE),
                    })
            }
        })
    }

    /// Makes any request to the body. Returns whether it was granted.
    pub(super) fn ask<T, E: Display>(
        &mut self,
        request: impl FnOnce(&mut Body) -> Result<T, E>,
    ) -> bool {
        self.watch(|body, _| request(body).map(|_| Taken::default()))
    }

    /// Observes an action, and records its report or its error.
    fn watch<E: Display>(
        &mut self,
        act: impl FnOnce(&mut Body, &mut Stepped) -> Result<Taken, E>,
    ) -> bool {
        state(&self.body, &mut self.before);
        self.account.steps += 1;
        let result = act(&mut self.body, &mut self.stepped);
        state(&self.body, &mut self.after);
        if !self
            .after
            .iter()
            .all(|bits| f64::from_bits(*bits).is_finite())
        {
            self.breaks("a number that is not finite");
        }
        let granted = result.is_ok();
        match result {
            Ok(taken) => {
                self.account.substeps += taken.substeps;
                self.account.damped += taken.damped;
                self.account.residual = self.account.residual.max(taken.residual);
            }
            Err(error) => {
                self.account.refused += 1;
                self.account.error.get_or_insert_with(|| error.to_string());
                if self.before != self.after {
                    self.breaks("the request was refused, and the state was not kept");
                }
            }
        }
        self.energy.add(self.body.total_energy());
        granted
    }

    /// Takes `steps` steps with handles at `targets`, until a step is refused: the next step would be refused, too.
    /// Returns whether all steps were taken.
    pub(super) fn run(&mut self, h: f64, steps: usize, targets: &[HandlePose]) -> bool {
        (0..steps).all(|_| self.step(h, targets))
    }

    fn breaks(&mut self, violation: &str) {
        let step = self.account.steps;
        self.account
            .broken
            .get_or_insert_with(|| format!("{violation} (step {step})"));
    }

    /// The failure of a case in which every step should have been taken.
    pub(super) fn unexpected(&self) -> Option<String> {
        let Account {
            steps,
            refused,
            error,
            ..
        } = &self.account;
        let error = error.as_deref().unwrap_or_default();
        (*refused > 0)
            .then(|| format!("{refused} of {steps} steps were refused, the first: {error}"))
    }

    /// Restarts the history of the energy.
    pub(super) fn restart(&mut self) {
        self.energy = Energy::new(self.body.total_energy());
    }

    /// The history of the energy since the start.
    pub(super) fn energy(&self) -> Energy {
        self.energy
    }
}

/// The complete state that a step changes, bit for bit: positions, velocities, and the reports of handles and supports.
fn state(body: &Body, bits: &mut Vec<u64>) {
    bits.clear();
    let mut put = |v: &Vec3| bits.extend(v.iter().map(|c| c.to_bits()));
    body.positions()
        .chain(body.velocities())
        .for_each(|v| put(&v));
    for report in (0..body.handle_count()).filter_map(|handle| body.handle_report(handle)) {
        put(&report.pose.position);
        put(&report.pose.rotation.scaled_axis());
        put(&report.linear_velocity);
        put(&report.angular_velocity);
        for wrench in [report.wrench_on_hand, report.reaction, report.inertia] {
            put(&wrench.force);
            put(&wrench.moment);
        }
    }
    for support in 0..body.support_count() {
        body.support_reaction(support).iter().for_each(&mut put);
    }
}
