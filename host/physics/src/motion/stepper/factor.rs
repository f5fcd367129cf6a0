//! The factor that preconditions the steps of a stepper: when it has aged, and how a new one takes over.

use super::{Stepper, StepperReport};
use crate::body::Body;
use crate::element::precision::Precision;
use crate::error::CondenseError;
use crate::linear::precondition::{self, Preconditioner, Solves};
use crate::motion::refresh::Refresher;

/// A complete factor has aged if an iteration leaves more than this fraction of the residual. A fresh factor leaves a
/// thousandth. The number of iterations alone would show this too late, because a good guess needs few of them with any
/// factor. When a hand stops, the guess is of no use, and an old factor needs twice as many iterations as a fresh
/// factor.
const SLOW: f64 = 0.03;

/// The factor, and the refresher that makes the next one.
#[derive(Debug)]
pub(super) struct Factor<T> {
    /// The refresher; absent while it is lent.
    pub(super) refresher: Option<Box<Refresher<T>>>,
    /// The factor that preconditions the steps.
    pub(super) solves: Solves,
    /// Factors of mass and stiffness in the matrix that was factorized.
    pub(super) factors: Option<(f64, f64)>,
    /// Whether a new factor would pay.
    pub(super) stale: bool,
    /// Iterations of the first step on an incomplete factor; 0 before it.
    usual: usize,
}

impl<T: Precision> Factor<T> {
    /// No factor yet, with the refresher that makes the first one.
    pub(super) fn of(refresher: Refresher<T>) -> Self {
        Self {
            solves: refresher.like_made(),
            refresher: Some(Box::new(refresher)),
            factors: None,
            stale: true,
            usual: 0,
        }
    }

    /// Notes a step. A new factor pays if the step took more iterations than `patience`, or reduced the residual slowly.
    pub(super) fn observe(&mut self, report: &StepperReport, patience: usize) {
        let iterations = report.iterations;
        self.stale |= match self.solves {
            Solves::Complete(_) => iterations > patience || report.rate > SLOW,
            // A new incomplete factor needs many iterations, too, so only the increase counts.
            Solves::Incomplete(_) => {
                if self.usual == 0 {
                    self.usual = iterations;
                }
                iterations > self.usual + self.usual / 4 + patience
            }
        };
    }

    /// Notes that the factor is new.
    pub(super) fn renewed(&mut self) {
        self.stale = false;
        self.usual = 0;
    }
}

/// Memory of the complete factor of `body`'s step matrix (bytes), as counted by [`precondition::complete_bytes`].
pub fn complete_bytes(body: &Body) -> usize {
    let rest = body.assembly.places.gather(&body.model.rest);
    precondition::complete_bytes(&body.assembly.stiffness, &rest)
}

/// Factors of mass and stiffness in the matrix of a step of `h` seconds.
pub(super) fn factors(body: &Body, h: f64) -> (f64, f64) {
    (
        1.0 / (h * h) + body.model.config.mass_damping / h,
        1.0 + body.model.config.stiffness_damping / h,
    )
}

impl<T: Precision> Stepper<T> {
    /// Whether there is a factor.
    pub(crate) fn is_ready(&self) -> bool {
        self.factor.factors.is_some()
    }

    /// Makes a new factor of the present matrix, if the refresher is not lent. Otherwise the old factor stays.
    pub(crate) fn refresh(&mut self, factors: (f64, f64)) -> Result<(), CondenseError> {
        if self.has_grown() {
            return Ok(());
        }
        if let Some(refresher) = &mut self.factor.refresher {
            let (d, places) = (&self.elements.d, &self.places);
            refresher.load((d, places.free, places.held), factors);
            refresher.load_contacts(&self.contacts, &places.of);
            refresher.work()?;
            let is_first = self.factor.factors.is_none();
            self.factor.factors = refresher.exchange(&mut self.factor.solves);
            if is_first {
                refresher.widen(&mut self.factor.solves);
            }
            self.factor.renewed();
            if let Some(growth) = &mut self.growth {
                growth.take_state(&self.elements.d);
            }
            self.pairs.forget_responses();
        }
        Ok(())
    }

    /// Lends the refresher if a new factor would pay. The caller runs [`work`](Refresher::work) on any thread and then
    /// [gives the refresher back](Self::give_back). With [`StepperOptions::refresh`](super::StepperOptions::refresh) off, no step replaces an aged
    /// factor.
    #[inline(never)]
    pub fn lend(&mut self) -> Option<Box<Refresher<T>>> {
        if !self.factor.stale || self.has_grown() {
            return None;
        }
        let factors = self.factor.factors?;
        let mut refresher = self.factor.refresher.take()?;
        let (d, places) = (&self.elements.d, &self.places);
        refresher.load((d, places.free, places.held), factors);
        refresher.load_contacts(&self.contacts, &places.of);
        Some(refresher)
    }

    /// Takes the refresher back, with the factor that it has made. Both are discarded if they belong to another epoch.
    pub fn give_back(&mut self, mut refresher: Box<Refresher<T>>) {
        if refresher.epoch != self.epoch {
            return;
        }
        if let Some(factors) = refresher.exchange(&mut self.factor.solves) {
            self.factor.factors = Some(factors);
            self.factor.renewed();
            if let Some(growth) = &mut self.growth {
                growth.take_loaded(refresher.state(), self.places.free, self.places.held);
            }
            self.pairs.forget_responses();
        }
        self.factor.refresher = Some(refresher);
    }

    /// The preconditioner of the steps.
    pub fn preconditioner(&self) -> Preconditioner {
        match self.factor.solves {
            Solves::Complete(_) => Preconditioner::Complete,
            Solves::Incomplete(_) => Preconditioner::Incomplete,
        }
    }
}
