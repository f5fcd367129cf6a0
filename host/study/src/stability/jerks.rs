//! A hand that moves by ten lengths of the body within one step.

use super::specimen::{Isotropic, Kind, quiet, rest_poses};
use super::trial::{Method, Trial};
use super::{Job, Outcome, Plan};
use crate::{Level, StudyError};
use physics::{BodyConfig, Vec3};

/// Almost ten lengths of the body, approximately along `(7, 3, -6)`.
const JERK: Vec3 = Vec3::new(7.0, 3.0, -6.5);

pub(super) fn plan(level: Level) -> Plan {
    let mut jobs = Vec::new();
    for (kind, method) in Kind::all() {
        for h in level.choose(vec![1e-2], vec![1e-3, 1e-2, 1e-1]) {
            for back in [true, false] {
                let steps = level.choose(30, 300);
                let motion = if back { "out and back" } else { "out for good" };
                let name = format!("{motion}, h {h} s");
                jobs.push(Job::new(name, (kind, method), 2 * steps, move || {
                    jerk(kind, method, h, back, steps)
                }));
            }
        }
    }
    Plan {
        name: "jerked handles",
        stress: "held at both ends, one end jerked by 10 body lengths within a step, and back in the next or not",
        figure: "energy gained after the hand came to rest, as a fraction of the work of the hand",
        unit: "",
        jobs,
    }
}

fn jerk(
    kind: Kind,
    method: Method,
    h: f64,
    back: bool,
    steps: usize,
) -> Result<Outcome, StudyError> {
    let shape = kind.mesh(2)?;
    let handles = [shape.end(-1.0), shape.end(1.0)];
    let config = BodyConfig {
        mass_damping: 2.0,
        stiffness_damping: 0.01,
        ..quiet()
    };
    let body = kind.build(&shape, |_| Isotropic::new(1e4, 0.45), config, &handles)?;
    let mut trial = Trial::new(body, method)?;
    let still = rest_poses(&handles);
    let mut out = still.clone();
    out[1].position += JERK;
    trial.step(h, &out);
    let supplied = trial.body.total_energy();
    let last = if back { &still } else { &out };
    // The hand also does the work of the step back.
    trial.step(h, last);
    trial.restart();
    let supplied = supplied.max(trial.body.total_energy());
    trial.run(h, steps, last);
    // Corotational laws are not smooth if an element is both stretched and crushed. An equilibrium may not exist
    // there.
    let must_be_taken = kind.law() != "corotational" || method.is_linearized();
    Ok(Outcome {
        figure: trial.energy().excess() / supplied,
        limit: Some(method.allowed_excess(kind)),
        reason: trial.unexpected().filter(|_| must_be_taken),
        account: trial.account,
        ..Outcome::default()
    })
}
