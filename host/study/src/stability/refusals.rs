//! Invalid requests: each is refused with an error, the state is preserved bit for bit, and the next step works.

use super::specimen::{Isotropic, Kind, rest_poses};
use super::trial::{Method, Trial};
use super::{Job, Outcome, Plan};
use crate::StudyError;
use physics::{
    BodyConfig, Equilibrium, EquilibriumOptions, HandlePose, IntegratorOptions, NewtonOptions, Vec3,
};

/// The step (s).
const STEP: f64 = 1e-3;

/// A request to a body that moves between two handles.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Request {
    /// A step of this length (s).
    Length(f64),
    /// Fewer poses than handles.
    Targets,
    /// A handle at this distance (m).
    Far(f64),
    /// A jerk for which Newton's method gets one iteration and no halving.
    OneIteration,
    /// A handle that moves through the other handle. No element may be inverted.
    Through,
    /// Velocities whose energy is not finite (m/s).
    Speed(f64),
    /// Forces whose squares are not finite (N).
    Force(f64),
    /// Positions, velocities and forces that are not numbers.
    Arrays,
    /// Equilibrium under a load that is not a number.
    Load,
    /// Equilibrium of a free body under gravity.
    Unheld,
}

impl Request {
    fn name(self) -> String {
        match self {
            Self::Length(h) => format!("a step of {h} s"),
            Self::Targets => "one pose for two handles".to_owned(),
            Self::Far(distance) => format!("a handle {distance:e} m away"),
            Self::OneIteration => "a jerk with one Newton iteration".to_owned(),
            Self::Through => "through the other handle, none inside out".to_owned(),
            Self::Speed(speed) => format!("vertices at {speed:e} m/s"),
            Self::Force(force) => format!("forces of {force:e} N"),
            Self::Arrays => "arrays with what is not a number".to_owned(),
            Self::Load => "equilibrium under a load that is not a number".to_owned(),
            Self::Unheld => "equilibrium of a falling body".to_owned(),
        }
    }

    /// Whether the request makes sense for `kind` and `method`.
    fn is_for(self, kind: Kind, method: Method) -> bool {
        let solid = Kind::solids().any(|solid| solid == kind);
        match self {
            Self::OneIteration => !method.is_linearized() && !kind.is_quadratic_in_energy(),
            Self::Through => solid && !method.is_linearized(),
            // These requests do not depend on the time step, so one method suffices.
            Self::Arrays | Self::Load | Self::Unheld => method == Method::ImplicitEuler,
            _ => true,
        }
    }
}

pub(super) fn plan() -> Plan {
    let requests = [
        Request::Length(0.0),
        Request::Length(-1e-3),
        Request::Length(f64::NAN),
        Request::Length(f64::INFINITY),
        Request::Targets,
        Request::Far(f64::NAN),
        Request::Far(f64::INFINITY),
        Request::Far(1e200),
        Request::Far(1e306),
        Request::OneIteration,
        Request::Through,
        Request::Speed(1e200),
        Request::Force(1e300),
        Request::Arrays,
        Request::Load,
        Request::Unheld,
    ];
    let mut jobs = Vec::new();
    for (kind, method) in Kind::all() {
        for request in requests {
            if request.is_for(kind, method) {
                jobs.push(Job::new(request.name(), (kind, method), 10, move || {
                    ask(kind, method, request)
                }));
            }
        }
    }
    Plan {
        name: "refusals",
        stress: "what cannot be done is asked of a body in motion",
        figure: "requests that were granted",
        unit: "",
        jobs,
    }
}

fn ask(kind: Kind, method: Method, request: Request) -> Result<Outcome, StudyError> {
    let shape = kind.mesh(2)?;
    let handles = match request {
        Request::Unheld => Vec::new(),
        _ => vec![shape.end(-1.0), shape.end(1.0)],
    };
    let config = BodyConfig {
        stiffness_damping: 0.001,
        ..BodyConfig::default()
    };
    let mut body = kind.build(&shape, |_| Isotropic::new(1e5, 0.3), config, &handles)?;
    body.set_velocities(&shape.kick(0.1))?;
    let rest = rest_poses(&handles);
    let moved = |by: Vec3| -> Vec<HandlePose> {
        let mut poses = rest.clone();
        if let Some(pose) = poses.get_mut(1) {
            pose.position += by;
        }
        poses
    };
    let near = moved(Vec3::new(1e-3, 0.0, 2e-3));
    let options = match request {
        Request::OneIteration => IntegratorOptions {
            newton: NewtonOptions {
                max_iterations: 1,
                ..NewtonOptions::default()
            },
            max_halvings: 0,
            ..method.options()
        },
        Request::Through => IntegratorOptions {
            refuse_inversion: true,
            ..method.options()
        },
        _ => method.options(),
    };
    // A state with forces on the hands, which a refusal must preserve.
    let mut before = Trial::new(body, method)?;
    before.run(STEP, 3, &near);
    let mut trial = Trial::with_options(before.body, method, options)?;
    let vertices = shape.positions().len();
    let granted = match request {
        Request::Length(h) => trial.step(h, &near),
        Request::Targets => trial.step(STEP, &near[..1]),
        Request::Far(distance) => trial.step(STEP, &moved(Vec3::y() * distance)),
        Request::OneIteration => trial.step(STEP, &moved(Vec3::new(-0.7, 0.5, 0.3))),
        Request::Through => trial.step(STEP, &moved(Vec3::x() * -2.0)),
        Request::Speed(speed) => {
            let kept: Vec<Vec3> = trial.body.velocities().collect();
            trial.body.set_velocities(&shape.kick(speed))?;
            let granted = trial.step(STEP, &near);
            trial.body.set_velocities(&kept)?;
            granted
        }
        Request::Force(force) => {
            trial.body.set_external_forces(&shape.kick(force))?;
            let granted = trial.step(STEP, &near);
            trial
                .body
                .set_external_forces(&vec![Vec3::zeros(); vertices])?;
            granted
        }
        Request::Arrays => {
            let mut bad = vec![Vec3::zeros(); vertices];
            bad[vertices - 1].y = f64::NAN;
            let granted = [
                trial.ask(|body| body.set_positions(&bad)),
                trial.ask(|body| body.set_velocities(&bad)),
                trial.ask(|body| body.set_external_forces(&bad)),
                trial.ask(|body| body.set_positions(&bad[..vertices - 1])),
            ];
            granted.contains(&true)
        }
        Request::Load | Request::Unheld => {
            let mut equilibrium = Equilibrium::new(&trial.body, EquilibriumOptions::default())?;
            let load = if request == Request::Load {
                f64::NAN
            } else {
                1.0
            };
            trial.ask(|body| equilibrium.solve(body, &near, load))
        }
    };
    let asked = trial.account.clone();
    // The options of the method are the defaults again.
    let mut after = Trial::new(trial.body, method)?;
    let continues = after.run(STEP, 3, &near);
    let reason =
        (!continues).then(|| format!("the steps after it fail: {:?}", after.account.error));
    Ok(Outcome {
        figure: f64::from(u8::from(granted)),
        limit: Some(0.0),
        account: asked,
        reason,
        ..Outcome::default()
    })
}
