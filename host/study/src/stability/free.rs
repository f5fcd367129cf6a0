//! Bodies that are free, or held by one vertex.

use super::specimen::{Isotropic, Kind, quiet, rest_poses};
use super::trial::{Method, Trial};
use super::{Job, Outcome, Plan};
use crate::{Level, StudyError};
use physics::{BodyConfig, Border, Freedom, HandleSpec, Vec3};

/// Free fall of a vibrating body: momentum is exact under both schemes.
pub(super) fn fall(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::all() {
        for h in level.ends(&[1e-4, 1e-3, 1e-2, 1e-1]) {
            let steps = level.choose(10, 200);
            jobs.push(Job::new(
                format!("h {h} s"),
                (kind, method),
                steps,
                move || falls(kind, method, h, steps),
            ));
        }
    }
    Plan {
        name: "free fall",
        stress: "free bodies fall while they vibrate; nothing holds them",
        figure: "error of the momentum, as a fraction of m g t and of the kick",
        unit: "",
        jobs,
    }
}

fn falls(kind: Kind, method: Method, h: f64, steps: usize) -> Result<Outcome, StudyError> {
    let shape = kind.mesh(2)?;
    let material = Isotropic::new(1e5, 0.45);
    let mut body = kind.build(&shape, |_| material, BodyConfig::default(), &[])?;
    let speed = 0.01 * material.sound();
    body.set_velocities(&shape.kick(speed))?;
    let mass = body.total_mass();
    let mut trial = Trial::new(body, method)?;
    let start = trial.body.momentum();
    let mut worst = 0.0_f64;
    for step in 1..=steps {
        trial.step(h, &[]);
        let weight = mass * 9.81 * h * step as f64;
        let expected = start - Vec3::z() * weight;
        let off = (trial.body.momentum() - expected).norm() / (weight + mass * speed);
        worst = worst.max(if off.is_nan() { f64::INFINITY } else { off });
    }
    // Each solve leaves 1e-9 of the balanced forces (the linearized step 1e-6 of those of its guess), partly with a
    // resultant. The error of the momentum is this force times the step, summed over the steps. The forces here are a
    // few times the force of the kick, m c^2 0.01 / L against m g.
    let limit = if method.is_linearized() { 1e-4 } else { 1e-6 };
    Ok(Outcome {
        figure: worst,
        limit: Some(limit),
        reason: trial.unexpected(),
        account: trial.account,
        ..Outcome::default()
    })
}

/// A body that hangs by one vertex and is released sideways.
pub(super) fn pendulum(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::all() {
        for h in level.ends(&[1e-3, 1e-2, 1e-1]) {
            let steps = level.choose(20, 500);
            jobs.push(Job::new(
                format!("h {h} s"),
                (kind, method),
                2 * steps,
                move || swings(kind, method, h, steps),
            ));
        }
    }
    Plan {
        name: "hung by one vertex",
        stress: "held by one vertex, let go under gravity, undamped",
        figure: "energy gained, as a fraction of m g L",
        unit: "",
        jobs,
    }
}

fn swings(kind: Kind, method: Method, h: f64, steps: usize) -> Result<Outcome, StudyError> {
    let shape = kind.mesh(2)?;
    let handles = [HandleSpec {
        vertices: vec![0],
        origin: shape.positions()[0],
        freedom: Freedom::Translation,
        border: Border::Hinged,
    }];
    let config = BodyConfig {
        gravity: Vec3::new(3.0, 2.0, -9.0),
        ..quiet()
    };
    let body = kind.build(&shape, |_| Isotropic::new(1e5, 0.45), config, &handles)?;
    let scale = body.total_mass() * config.gravity.norm();
    let mut trial = Trial::new(body, method)?;
    trial.run(h, steps, &rest_poses(&handles));
    Ok(Outcome {
        figure: trial.energy().excess() / scale,
        limit: Some(method.allowed_excess(kind)),
        reason: trial.unexpected(),
        account: trial.account,
        ..Outcome::default()
    })
}
