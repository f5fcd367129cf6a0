//! The numerical stress suite: bodies under the extremes of hands, meshes and scenes.
//!
//! Every family applies one stress (time steps, stiffness, slivers, inversion, jerks, ...) to every law, element and
//! scheme for which the stress makes sense. A case is a body that is stepped and observed. No number may become
//! infinite or not a number. No energy may be created. A step that cannot be taken gives a typed error, after which the
//! state equals the last good one, bit for bit. Each case has a verdict and one figure; smaller figures are better.
//!
//! The energy is the sum of kinetic energy, elastic energy and the potential of the loads. It may never exceed its
//! initial value. Under implicit Euler, and for linear bodies, it may never rise again once it has fallen. TR-BDF2 and
//! the linearized step do not guarantee this for nonlinear bodies. Some energy may return between steps: a
//! hundredth is allowed.

mod contrasts;
mod free;
mod jerks;
mod materials;
mod realtime;
mod refusals;
mod rest;
mod slivers;
mod specimen;
mod starts;
mod tables;
#[cfg(test)]
mod tests;
mod trial;

use crate::{Level, StudyError};
use serde::Serialize;
use specimen::Kind;
pub use trial::Account;
use trial::Method;

/// The verdict on a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The case fulfils every requirement.
    Pass,
    /// The figure has no limit, and the case fulfils all other requirements.
    Reported,
    /// The case fails; [`Case::reason`] states why.
    Fail,
}

/// One body under one stress.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    /// The name of the stress.
    pub name: String,
    /// The elements.
    pub body: &'static str,
    /// The law of the elements.
    pub law: &'static str,
    /// The scheme that stepped the body.
    pub scheme: &'static str,
    /// The verdict.
    pub verdict: Verdict,
    /// The figure of the case, in the unit of the family.
    pub figure: f64,
    /// The largest figure that passes, in the unit of the family; none if the figure has no limit.
    pub limit: Option<f64>,
    /// The counts over the case.
    pub account: Account,
    /// The reason of the failure.
    pub reason: Option<String>,
    /// For starts: elastic energy at the end, as a fraction of the initial energy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left: Option<f64>,
    /// For starts: fraction of the cells that are not inverted, over time (s).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub recovery: Vec<(f64, f64)>,
}

/// All cases under one stress.
#[derive(Clone, Debug, Serialize)]
pub struct Family {
    /// The name of the family.
    pub name: &'static str,
    /// The stress on the bodies.
    pub stress: &'static str,
    /// The definition of the figure of a case.
    pub figure: &'static str,
    /// The unit of the figure; empty for a fraction.
    pub unit: &'static str,
    /// The cases.
    pub cases: Vec<Case>,
}

impl Case {
    /// For starts: whether no cell is inverted and the remaining energy is negligible.
    pub fn recovered(&self) -> bool {
        self.figure == 0.0 && self.left.is_some_and(|left| left < starts::RECOVERED)
    }
}

impl Family {
    /// The case with the worst figure.
    pub fn worst(&self) -> Option<&Case> {
        // A figure that is not a number is worse than any number.
        let rank = |case: &Case| {
            if case.figure.is_nan() {
                f64::INFINITY
            } else {
                case.figure
            }
        };
        self.cases.iter().max_by(|a, b| rank(a).total_cmp(&rank(b)))
    }

    /// Number of cases with this verdict.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.cases
            .iter()
            .filter(|case| case.verdict == verdict)
            .count()
    }
}

/// The results of the suite.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// `palpate.stability/1`.
    pub schema: &'static str,
    /// The extent of the suite.
    pub level: Level,
    /// The families.
    pub families: Vec<Family>,
}

impl Report {
    /// The cases that fail, each with its family.
    pub fn failures(&self) -> impl Iterator<Item = (&Family, &Case)> {
        self.families.iter().flat_map(|family| {
            let failed = |case: &&Case| case.verdict == Verdict::Fail;
            family
                .cases
                .iter()
                .filter(failed)
                .map(move |case| (family, case))
        })
    }
}

/// The result of a case.
#[derive(Debug, Default)]
struct Outcome {
    figure: f64,
    limit: Option<f64>,
    account: Account,
    /// The reason of a failure, except for the figure.
    reason: Option<String>,
    left: Option<f64>,
    recovery: Vec<(f64, f64)>,
}

impl Outcome {
    fn verdict(&self) -> (Verdict, Option<String>) {
        let reason = self.account.broken.clone().or_else(|| self.reason.clone());
        match (reason, self.limit) {
            (Some(reason), _) => (Verdict::Fail, Some(reason)),
            (None, None) if self.figure.is_finite() => (Verdict::Reported, None),
            (None, Some(limit)) if self.figure <= limit => (Verdict::Pass, None),
            (None, Some(limit)) => {
                let reason = format!(
                    "the figure is {:.3e}, at most {limit:e} is allowed",
                    self.figure
                );
                (Verdict::Fail, Some(reason))
            }
            (None, None) => (Verdict::Fail, Some("the figure is not finite".to_owned())),
        }
    }
}

/// A case that has not run yet.
struct Job {
    name: String,
    kind: Kind,
    method: Method,
    /// Approximate running time, relative to other cases.
    weight: f64,
    run: Box<dyn FnOnce() -> Result<Outcome, StudyError>>,
}

impl Job {
    fn new(
        name: String,
        (kind, method): (Kind, Method),
        steps: usize,
        run: impl FnOnce() -> Result<Outcome, StudyError> + 'static,
    ) -> Self {
        let weight = steps as f64 * kind.cost() * method.cost();
        Self {
            name,
            kind,
            method,
            weight,
            run: Box::new(run),
        }
    }

    fn run(self) -> Case {
        let outcome = (self.run)().unwrap_or_else(|error| Outcome {
            figure: f64::NAN,
            reason: Some(format!("the case cannot start: {error}")),
            ..Outcome::default()
        });
        let (verdict, reason) = outcome.verdict();
        Case {
            name: self.name,
            body: self.kind.body(),
            law: self.kind.law(),
            scheme: self.method.name(),
            verdict,
            figure: outcome.figure,
            limit: outcome.limit,
            account: outcome.account,
            reason,
            left: outcome.left,
            recovery: outcome.recovery,
        }
    }
}

/// A family that has not run yet.
struct Plan {
    name: &'static str,
    stress: &'static str,
    figure: &'static str,
    unit: &'static str,
    jobs: Vec<Job>,
}

/// Names of the families.
pub fn names() -> Vec<&'static str> {
    plans(Level::Quick).iter().map(|plan| plan.name).collect()
}

fn plans(level: Level) -> Vec<Plan> {
    vec![
        materials::light(level),
        materials::hard(level),
        materials::long(level),
        contrasts::plan(level),
        slivers::plan(level),
        realtime::plan(level),
        starts::inverted(level),
        starts::scrambled(level),
        starts::crumpled(level),
        jerks::plan(level),
        rest::loaded(level),
        rest::turned(level),
        free::fall(level),
        free::pendulum(level),
        refusals::plan(),
    ]
}

/// Runs the suite, or the family named `only`. `progress` receives the fraction done.
pub fn run(level: Level, only: Option<&str>, progress: &mut dyn FnMut(f64)) -> Report {
    let mut plans = plans(level);
    plans.retain(|plan| only.is_none_or(|name| name == plan.name));
    let jobs = plans.iter().flat_map(|plan| &plan.jobs);
    let whole: f64 = jobs.map(|job| job.weight).sum();
    let mut done = 0.0;
    let mut families = Vec::with_capacity(plans.len());
    for plan in plans {
        let mut cases = Vec::with_capacity(plan.jobs.len());
        for job in plan.jobs {
            done += job.weight;
            cases.push(job.run());
            progress(done / whole);
        }
        families.push(Family {
            name: plan.name,
            stress: plan.stress,
            figure: plan.figure,
            unit: plan.unit,
            cases,
        });
    }
    Report {
        schema: "palpate.stability/1",
        level,
        families,
    }
}
