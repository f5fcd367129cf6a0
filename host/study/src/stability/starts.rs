//! Bodies that start inverted, scrambled or crumpled.

use super::specimen::{Isotropic, Kind, Random, Shape, quiet, rest_poses};
use super::trial::{Method, Trial};
use super::{Job, Outcome, Plan};
use crate::{Level, StudyError};
use physics::{BodyConfig, SolidLaw, Vec3};

/// The step (s).
const STEP: f64 = 0.02;
/// Fraction of the initial elastic energy below which a body counts as recovered.
pub(super) const RECOVERED: f64 = 1e-6;

/// The initial positions of the vertices.
#[derive(Clone, Copy)]
enum Start {
    /// Mirrored along an axis.
    Mirrored(usize),
    /// Mirrored along x, then each vertex moved by up to a hundredth of the length of the body.
    Shaken,
    /// Each vertex at a random place in the box, by a seed.
    Scrambled(u64),
}

impl Start {
    fn name(self) -> String {
        match self {
            Self::Mirrored(axis) => format!("mirrored along {}", ["x", "y", "z"][axis]),
            Self::Shaken => "mirrored along x and shaken".to_owned(),
            Self::Scrambled(seed) => format!("seed {seed}"),
        }
    }

    fn positions(self, rest: &[Vec3]) -> Vec<Vec3> {
        match self {
            Self::Mirrored(axis) => {
                let mirrored = |x: &Vec3| {
                    let mut x = *x;
                    x[axis] = -x[axis];
                    x
                };
                rest.iter().map(mirrored).collect()
            }
            Self::Shaken => {
                let mut random = Random(5);
                let mirrored = Self::Mirrored(0).positions(rest);
                mirrored
                    .iter()
                    .map(|x| x + random.vector() * 0.01)
                    .collect()
            }
            Self::Scrambled(seed) => {
                let mut random = Random(seed);
                rest.iter().map(|_| random.vector() * 0.5).collect()
            }
        }
    }
}

/// Every cell is inverted.
pub(super) fn inverted(level: Level) -> Plan {
    let starts = level.choose(
        vec![Start::Shaken],
        vec![Start::Mirrored(0), Start::Mirrored(2), Start::Shaken],
    );
    Plan {
        name: "inverted starts",
        stress: "solids that start mirrored, free or held at one end; h 20 ms, damped, 12 s",
        figure: "fraction of elements still inverted",
        unit: "",
        jobs: solids(level, &starts),
    }
}

/// Every vertex is at a random place.
pub(super) fn scrambled(level: Level) -> Plan {
    let seeds = level.choose(1, 10);
    let starts: Vec<Start> = (1..=seeds).map(Start::Scrambled).collect();
    Plan {
        name: "scrambled starts",
        stress: "solids whose vertices start anywhere in their box, free or held at one end; h 20 ms, damped, 12 s",
        figure: "fraction of elements still inverted",
        unit: "",
        jobs: solids(level, &starts),
    }
}

fn solids(level: Level, starts: &[Start]) -> Vec<Job> {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::solids().flat_map(Kind::with_methods) {
        for poisson in level.choose(vec![0.3], vec![0.3, 0.45]) {
            for held in level.choose(vec![true], vec![false, true]) {
                for &start in starts {
                    let steps = level.choose(200, 600);
                    let name = format!(
                        "{}, {}, nu {poisson}",
                        start.name(),
                        if held { "held" } else { "free" }
                    );
                    jobs.push(Job::new(name, (kind, method), 5 * steps, move || {
                        recover(kind, method, start, held, poisson, steps)
                    }));
                }
            }
        }
    }
    jobs
}

fn damped() -> BodyConfig {
    BodyConfig {
        mass_damping: 6.0,
        stiffness_damping: 0.01,
        ..quiet()
    }
}

fn recover(
    kind: Kind,
    method: Method,
    start: Start,
    held: bool,
    poisson: f64,
    steps: usize,
) -> Result<Outcome, StudyError> {
    let shape = kind.mesh(2)?;
    let handles = if held {
        vec![shape.end(-1.0)]
    } else {
        Vec::new()
    };
    let targets = rest_poses(&handles);
    let mut body = kind.build(&shape, |_| Isotropic::new(1e4, poisson), damped(), &handles)?;
    let mut x = start.positions(shape.positions());
    for &vertex in handles.iter().flat_map(|handle| &handle.vertices) {
        x[vertex as usize] = shape.positions()[vertex as usize];
    }
    body.set_positions(&x)?;
    let cells = body.element_count() as f64;
    let right = |trial: &Trial| 1.0 - trial.body.inverted_count() as f64 / cells;
    let mut trial = Trial::new(body, method)?;
    let first = trial.body.total_energy();
    let mut recovery = vec![(0.0, right(&trial))];
    for step in 1..=steps {
        // A refused step leaves the state, so the next step would be refused, too.
        if trial.account.refused == 0 {
            trial.step(STEP, &targets);
        }
        if step.is_multiple_of(5) {
            recovery.push((STEP * step as f64, right(&trial)));
        }
    }
    let left = trial.body.elastic_energy() / first;
    let inverted = trial.body.inverted_count();
    let recovered = inverted == 0 && left < RECOVERED;
    // Smith et al. guarantee that no cell stays inverted. A body can still settle in another equilibrium if cells
    // bend (quadratic), hardly change their volume, or wind twice around a vertex (scrambled).
    let must_recover = kind == Kind::Linear(SolidLaw::StableNeoHookean)
        && poisson <= 0.3
        && !matches!(start, Start::Scrambled(_));
    let excess = trial.energy().excess() / first;
    let reason = {
        if excess > method.allowed_excess(kind) {
            Some(format!(
                "the energy exceeds its initial value by the fraction {excess:.3e}"
            ))
        } else if kind.recovers() && trial.account.refused > 0 {
            trial.unexpected()
        } else if (kind.recovers() && inverted > 0) || (must_recover && !recovered) {
            Some(format!(
                "the body does not recover: {inverted} cells are inverted, {left:.3e} of the energy remains"
            ))
        } else {
            None
        }
    };
    Ok(Outcome {
        figure: 1.0 - right(&trial),
        limit: kind.recovers().then_some(0.0),
        account: trial.account,
        reason,
        recovery,
        left: Some(left),
    })
}

/// Sheets have no inside. Their vertices start at random places in a box.
pub(super) fn crumpled(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::sheets().flat_map(Kind::with_methods) {
        for held in [false, true] {
            for seed in 1..=level.choose(1, 10) {
                let steps = level.choose(200, 600);
                let name = format!("seed {seed}, {}", if held { "held" } else { "free" });
                jobs.push(Job::new(name, (kind, method), steps, move || {
                    crumple(kind, method, Start::Scrambled(seed), held, steps)
                }));
            }
        }
    }
    Plan {
        name: "crumpled sheets",
        stress: "sheets whose vertices start anywhere in a box, free or held at one end; h 20 ms, damped, 12 s",
        figure: "energy gained, as a fraction of the initial energy",
        unit: "",
        jobs,
    }
}

fn crumple(
    kind: Kind,
    method: Method,
    start: Start,
    held: bool,
    steps: usize,
) -> Result<Outcome, StudyError> {
    let shape: Shape = kind.mesh(2)?;
    let handles = if held {
        vec![shape.end(-1.0)]
    } else {
        Vec::new()
    };
    let targets = rest_poses(&handles);
    let mut body = kind.build(&shape, |_| Isotropic::new(1e4, 0.3), damped(), &handles)?;
    let mut x = start.positions(shape.positions());
    for &vertex in handles.iter().flat_map(|handle| &handle.vertices) {
        x[vertex as usize] = shape.positions()[vertex as usize];
    }
    body.set_positions(&x)?;
    let mut trial = Trial::new(body, method)?;
    let first = trial.body.total_energy();
    trial.run(STEP, steps, &targets);
    Ok(Outcome {
        figure: trial.energy().excess() / first,
        limit: Some(method.allowed_excess(kind)),
        reason: trial.unexpected(),
        account: trial.account,
        ..Outcome::default()
    })
}
