//! Section `energy`: where the work of the hands goes while a sheet is torn from border to border.
//!
//! Each term has its own formula, summed over all steps ([`physics::motion::stepper::Ledger`]). Kinetic, elastic and
//! potential energy are taken from the body at the start and at the end, and the energy of the tear is the toughness times
//! the torn area, not what the pairs of vertices took. What the sum lacks is therefore an error.

use super::patterns::Pattern;
use super::pull::Pull;
use super::specimen::CLOTH;
use crate::{Level, StudyError};
use physics::tear::TearLaw;
use serde::Serialize;

/// The account of one tear.
#[derive(Clone, Debug, Serialize)]
pub struct Account {
    /// How the triangles lie.
    pub pattern: String,
    /// Number of triangles before the tear.
    pub triangles: usize,
    /// Torn area (m^2).
    pub area: f64,
    /// Work of hands and supports (J).
    pub supplied: f64,
    /// Increase of kinetic and elastic energy and of the energy of the weight, from the states at the start and at the
    /// end (J).
    pub stored: f64,
    /// Loss by damping (J).
    pub damping: f64,
    /// The toughness times the torn area (J).
    pub due: f64,
    /// The part of it that pairs of vertices have still to take at the end (J).
    pub pending: f64,
    /// The part of it that pairs did not take, because the tip moved on inside edges (J).
    pub slackened: f64,
    /// What the pairs took (J).
    pub released: f64,
    /// Increase of the energy by edits, a source (J).
    pub edits: f64,
    /// Loss by implicit Euler, of kinetic and of elastic energy (J).
    pub integrator: f64,
    /// Loss by the linearization of the elastic forces (J).
    pub linearization: f64,
    /// Work of the guard that shortens steps (J).
    pub guard: f64,
    /// Work of the solver's residual (J).
    pub solver: f64,
}

impl Account {
    /// What the account lacks if the pairs' own work takes the place of the energy of the tear, as a fraction of the
    /// supplied energy: rounding.
    pub fn rounding(&self) -> f64 {
        self.missing() + (self.due - self.pending - self.slackened - self.released) / self.supplied
    }

    /// What the account lacks, as a fraction of the supplied energy.
    pub fn missing(&self) -> f64 {
        let sources = self.supplied + self.edits + self.guard + self.solver;
        let sinks =
            self.stored + self.damping + self.due - self.pending - self.slackened + self.integrator;
        (sources - sinks - self.linearization) / self.supplied
    }
}

/// The accounts of all patterns; at the quick level, of one.
///
/// # Errors
/// [`StudyError`].
pub fn run(level: Level, progress: &dyn Fn(f64)) -> Result<Vec<Account>, StudyError> {
    let patterns = level.take(&Pattern::ALL, 1);
    let mut accounts = Vec::new();
    for (number, &pattern) in patterns.iter().enumerate() {
        accounts.push(account(pattern, level.choose(700, 1400))?);
        progress((number + 1) as f64 / patterns.len() as f64);
    }
    Ok(accounts)
}

fn account(pattern: Pattern, triangles: usize) -> Result<Account, StudyError> {
    let pull = Pull {
        stuff: CLOTH,
        pattern,
        triangles,
        law: TearLaw::Toughness,
        gravity: 9.81,
        snapping: 0.3,
        length: f64::INFINITY,
        longest: 5.0,
    };
    let torn = pull.run()?;
    let stored = torn.samples.last().map_or(0.0, |sample| sample.stored);
    let ledger = &torn.ledger;
    Ok(Account {
        pattern: pattern.name(),
        triangles: torn.triangles[0],
        area: torn.report.area,
        supplied: ledger.supplied,
        stored,
        damping: ledger.mass_damping + ledger.stiffness_damping,
        due: torn.report.due,
        pending: torn.pending,
        slackened: torn.report.slackened,
        released: ledger.release,
        edits: torn.report.edits,
        integrator: ledger.euler_kinetic + ledger.euler_elastic,
        linearization: ledger.linearization,
        guard: ledger.guard,
        solver: ledger.solver,
    })
}
