//! A million steps of bodies at rest.

use super::specimen::{Isotropic, Kind, quiet, rest_poses};
use super::trial::{Method, Trial};
use super::{Job, Outcome, Plan};
use crate::{Level, StudyError};
use nalgebra::Rotation3;
use physics::{Body, BodyConfig, Equilibrium, EquilibriumOptions, Vec3};

/// The largest drift that passes (m, for a body of 1 m): the error of an equilibrium to 1e-9 of the forces, and the
/// rounding of positions of 1 m.
const DRIFT: f64 = 1e-9;

/// Bodies held at one end, under gravity, in equilibrium.
pub(super) fn loaded(level: Level) -> Plan {
    let steps = level.choose(500, 1_000_000);
    let jobs = Kind::all().map(|(kind, method)| {
        let name = format!("{steps} steps of 1 ms");
        Job::new(name, (kind, method), steps / 50, move || {
            sag(kind, method, steps)
        })
    });
    Plan {
        name: "rest under load",
        stress: "held at one end in equilibrium with gravity, undamped",
        figure: "drift",
        unit: "m",
        jobs: jobs.collect(),
    }
}

/// Free bodies, turned and far from the origin: rounding disturbs them, and no support holds them.
pub(super) fn turned(level: Level) -> Plan {
    let steps = level.choose(500, 1_000_000);
    let nonlinear = Kind::all().filter(|(kind, _)| !kind.is_quadratic_in_energy());
    let jobs = nonlinear.map(|(kind, method)| {
        let name = format!("{steps} steps of 1 ms");
        Job::new(name, (kind, method), steps / 50, move || {
            turn(kind, method, steps)
        })
    });
    Plan {
        name: "rest, free and turned",
        stress: "free, turned, 10 m from the origin, undamped",
        figure: "drift",
        unit: "m",
        jobs: jobs.collect(),
    }
}

fn material() -> Isotropic {
    Isotropic::new(1e6, 0.3)
}

fn sag(kind: Kind, method: Method, steps: usize) -> Result<Outcome, StudyError> {
    let shape = kind.mesh(1)?;
    let handles = [shape.end(-1.0)];
    let mut body = kind.build(&shape, |_| material(), BodyConfig::default(), &handles)?;
    let targets = rest_poses(&handles);
    // A thin sheet that is held at one end sags far, so its equilibrium takes many load steps.
    let options = EquilibriumOptions {
        load_steps: 8,
        ..EquilibriumOptions::default()
    };
    Equilibrium::new(&body, options)?.solve(&mut body, &targets, 1.0)?;
    watch(body, method, steps, &targets)
}

fn turn(kind: Kind, method: Method, steps: usize) -> Result<Outcome, StudyError> {
    let shape = kind.mesh(1)?;
    let mut body = kind.build(&shape, |_| material(), quiet(), &[])?;
    let turn = Rotation3::from_euler_angles(1.0, 2.0, -0.5);
    let place = |x: &Vec3| turn * x + Vec3::new(6.0, -8.0, 0.1);
    let x: Vec<Vec3> = shape.positions().iter().map(place).collect();
    body.set_positions(&x)?;
    watch(body, method, steps, &[])
}

fn watch(
    body: Body,
    method: Method,
    steps: usize,
    targets: &[physics::HandlePose],
) -> Result<Outcome, StudyError> {
    let start: Vec<Vec3> = body.positions().collect();
    let scale = body.total_mass() * 9.81;
    let mut trial = Trial::new(body, method)?;
    let first = trial.body.total_energy();
    let mut drift = 0.0_f64;
    for _ in 0..steps {
        trial.step(1e-3, targets);
        let off = trial
            .body
            .positions()
            .zip(&start)
            .map(|(x, start)| (x - start).norm());
        drift = off.fold(drift, f64::max);
    }
    let gained = trial.body.total_energy() - first;
    // The work of the weight over the drift that passes.
    let growth = (gained.is_nan() || gained > scale * DRIFT)
        .then(|| format!("the energy rises by {gained:.3e} J"));
    Ok(Outcome {
        figure: drift,
        limit: Some(DRIFT),
        reason: trial.unexpected().or(growth),
        account: trial.account,
        ..Outcome::default()
    })
}
