//! The numerical stress suite: bodies under what a hand, a mesh or a scene may do to them.
//!
//! Every family takes one stress to its end (time steps, stiffness, slivers, inside out, jerked, ...) with every
//! law, element and scheme for which it makes sense. A case is a body that is stepped and watched: no number
//! that is not finite, no energy from nowhere, and a step that cannot be taken is a typed error after which the
//! state is the last good one, bit for bit. Beside its verdict each case has one figure, the smaller the better.
//!
//! Energy is kinetic, elastic and of the loads together. It may never get above what there was at the start, and
//! under implicit Euler, and for linear bodies, never rise again once it has fallen. TR-BDF2 and the linearized
//! step make no such promise for bodies that are not linear (they hide some energy between steps and give it
//! back): a hundredth is allowed.

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
#[cfg(test)]
mod tests;
mod trial;

use crate::{Level, StudyError};
use serde::Serialize;
use specimen::Kind;
pub use trial::Account;
use trial::Method;

/// What came of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It holds what is asked of it.
    Pass,
    /// Nothing is asked of its figure, and all else holds.
    Reported,
    /// It does not; [`Case::reason`] says why.
    Fail,
}

/// One body under one stress.
#[derive(Clone, Debug, Serialize)]
pub struct Case {
    /// The stress, in words.
    pub name: String,
    /// The elements.
    pub body: &'static str,
    /// Their law.
    pub law: &'static str,
    /// How the body was stepped.
    pub scheme: &'static str,
    /// What came of it.
    pub verdict: Verdict,
    /// The family's figure.
    pub figure: f64,
    /// The largest that passes, if any is asked for.
    pub limit: Option<f64>,
    /// What was counted on the way.
    pub account: Account,
    /// Why it fails.
    pub reason: Option<String>,
    /// Starts: elastic energy at the end, as a share of the start's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left: Option<f64>,
    /// Starts: share of the cells that are the right way round, over time (s).
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub recovery: Vec<(f64, f64)>,
}

/// All cases under one stress.
#[derive(Clone, Debug, Serialize)]
pub struct Family {
    /// Its name.
    pub name: &'static str,
    /// What is done to the bodies.
    pub stress: &'static str,
    /// What the figure of a case is.
    pub figure: &'static str,
    /// The figure's unit; empty for a share.
    pub unit: &'static str,
    /// The cases.
    pub cases: Vec<Case>,
}

impl Case {
    /// Starts: whether every cell is the right way round again and no energy to speak of is left.
    pub fn recovered(&self) -> bool {
        self.figure == 0.0 && self.left.is_some_and(|left| left < starts::RECOVERED)
    }
}

impl Family {
    /// The case with the worst figure.
    pub fn worst(&self) -> Option<&Case> {
        // A figure that is not a number is worse than any.
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

/// What the suite found.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// `palpate.stability/1`.
    pub schema: &'static str,
    /// How much was done.
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

/// What a case found.
#[derive(Debug, Default)]
struct Outcome {
    figure: f64,
    limit: Option<f64>,
    account: Account,
    /// Why it fails, besides its figure.
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
                    "its figure is {:.3e}, at most {limit:e} is allowed",
                    self.figure
                );
                (Verdict::Fail, Some(reason))
            }
            (None, None) => (Verdict::Fail, Some("its figure is not finite".to_owned())),
        }
    }
}

/// A case to be run.
struct Job {
    name: String,
    kind: Kind,
    method: Method,
    /// About how long it takes beside others.
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
            reason: Some(format!("it cannot begin: {error}")),
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

/// A family before it is run.
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

/// Runs the suite, or one family of it by name. `progress` is given the share done.
pub fn run(level: Level, only: Option<&str>, mut progress: impl FnMut(f64)) -> Report {
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
