//! A body that is stepped and watched.

use super::Kind;
use crate::StudyError;
use physics::{
    Body, HandlePose, Integrator, IntegratorOptions, Scheme, Stepper, StepperOptions, Vec3,
};
use serde::Serialize;
use std::fmt::Display;

/// How a body is stepped.
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

/// What rounding may add to an energy, as a share: a velocity is a difference of positions over the step, so in
/// a body of 1 m at 3e-4 m/s a step of 1e-4 s leaves 1e-16 / (1e-4 * 3e-4) = 3e-9 of it unknown, ten times that
/// where TR-BDF2 extrapolates; Newton's method leaves 1e-9 of the forces; and all that adds up over the steps.
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

    /// About how long a step takes beside the others'.
    pub(super) fn cost(self) -> f64 {
        match self {
            Self::ImplicitEuler => 1.0,
            Self::TrBdf2 => 2.0,
            Self::Linearized | Self::Frozen => 0.5,
        }
    }

    /// How far the energy may get above the start's, as a share of it.
    pub(super) fn allowed_excess(self, kind: Kind) -> f64 {
        if self.never_gains(kind) {
            ROUNDING
        } else {
            // L-stable means something for linear bodies only; the bound for others.
            0.01
        }
    }

    /// Whether the energy may not even rise again after it has fallen. Implicit Euler promises that for convex
    /// energies, and holds it for others as long as a step is taken on one side of a dent.
    pub(super) fn never_gains(self, kind: Kind) -> bool {
        self == Self::ImplicitEuler || (self == Self::TrBdf2 && kind.is_quadratic_in_energy())
    }

    /// Whether it takes one linearization a step.
    pub(super) fn is_linearized(self) -> bool {
        matches!(self, Self::Linearized | Self::Frozen)
    }

    pub(super) fn options(self) -> IntegratorOptions {
        let scheme = if self == Self::TrBdf2 {
            Scheme::TrBdf2
        } else {
            Scheme::ImplicitEuler
        };
        IntegratorOptions {
            scheme,
            ..IntegratorOptions::default()
        }
    }
}

/// What is counted over a case.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Account {
    /// Steps asked for.
    pub steps: usize,
    /// Steps that were refused with an error.
    pub refused: usize,
    /// Substeps of all steps taken; as many as these where none was halved.
    pub substeps: usize,
    /// Substeps of TR-BDF2 taken by implicit Euler, and linearized steps of which a part was held back: what
    /// keeps them from making energy.
    pub damped: usize,
    /// The worst residual of any step taken, as a share of the forces that balance.
    pub residual: f64,
    /// The first error.
    pub error: Option<String>,
    /// What no step may do: a number that is not finite, or a refused step that moved the body.
    pub broken: Option<String>,
}

/// How a step went, as [`Account`] counts it.
#[derive(Default)]
struct Taken {
    substeps: usize,
    damped: usize,
    residual: f64,
}

/// What steps a body.
#[derive(Debug)]
enum Stepped {
    Assembled,
    Frozen(Box<Stepper<f64>>),
    Solved(Box<Integrator>),
}

/// A body, how it is stepped, and what it has done.
#[derive(Debug)]
pub(super) struct Trial {
    pub(super) body: Body,
    stepped: Stepped,
    before: Vec<u64>,
    after: Vec<u64>,
    pub(super) account: Account,
    energy: Energy,
}

/// What an energy has been (J).
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
        // An energy that is not a number is beyond all bounds.
        let energy = if energy.is_nan() {
            f64::INFINITY
        } else {
            energy
        };
        self.rise = self.rise.max(energy - self.least);
        self.highest = self.highest.max(energy);
        self.least = self.least.min(energy);
    }

    /// How far it has been above the start.
    pub(super) fn excess(&self) -> f64 {
        self.highest - self.start
    }

    /// How far it has been above the least that it was before.
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

    /// One step; whether it was taken.
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

    /// Anything that is asked of the body; whether it was granted.
    pub(super) fn ask<T, E: Display>(
        &mut self,
        what: impl FnOnce(&mut Body) -> Result<T, E>,
    ) -> bool {
        self.watch(|body, _| what(body).map(|_| Taken::default()))
    }

    /// Watches what says how it went, or gives an error.
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
                    self.breaks("it was refused, and the state was not kept");
                }
            }
        }
        self.energy.add(self.body.total_energy());
        granted
    }

    /// `steps` steps with handles at `targets`, or up to the first that is refused: the next would be the same.
    /// Whether all were taken.
    pub(super) fn run(&mut self, h: f64, steps: usize, targets: &[HandlePose]) -> bool {
        (0..steps).all(|_| self.step(h, targets))
    }

    fn breaks(&mut self, what: &str) {
        let step = self.account.steps;
        self.account
            .broken
            .get_or_insert_with(|| format!("{what} (step {step})"));
    }

    /// What is wrong where every step should have been taken.
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

    /// Forgets what the energy has been.
    pub(super) fn restart(&mut self) {
        self.energy = Energy::new(self.body.total_energy());
    }

    /// What the energy has been since the start.
    pub(super) fn energy(&self) -> Energy {
        self.energy
    }
}

/// All that a step changes, bit for bit: positions, velocities, and what handles and supports report.
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
