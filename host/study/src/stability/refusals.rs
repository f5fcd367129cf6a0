//! What cannot be done is refused by name, the state is kept bit for bit, and the next step works.

use super::specimen::{Kind, Stuff, rest_poses};
use super::trial::{Method, Trial};
use super::{Job, Outcome, Plan};
use crate::StudyError;
use physics::{
    BodyConfig, Equilibrium, EquilibriumOptions, HandlePose, IntegratorOptions, NewtonOptions, Vec3,
};

/// The step (s).
const STEP: f64 = 1e-3;

/// What is asked of a body that is in motion between two handles.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Request {
    /// A step of this length (s).
    Length(f64),
    /// Fewer poses than there are handles.
    Targets,
    /// A handle at this distance (m).
    Far(f64),
    /// A jerk for which Newton's method gets one iteration and no halving.
    Hasty,
    /// Through the other handle without turning anything inside out.
    Through,
    /// Velocities that no energy can hold (m/s).
    Speed(f64),
    /// Forces beyond all numbers once they are squared (N).
    Force(f64),
    /// Positions, velocities and forces that are not numbers.
    Arrays,
    /// Equilibrium under a load that is not a number.
    Load,
    /// Equilibrium of a body that nothing holds, under gravity.
    Unheld,
}

impl Request {
    fn name(self) -> String {
        match self {
            Self::Length(h) => format!("a step of {h} s"),
            Self::Targets => "one pose for two handles".to_owned(),
            Self::Far(distance) => format!("a handle {distance:e} m away"),
            Self::Hasty => "a jerk with one Newton iteration".to_owned(),
            Self::Through => "through the other handle, none inside out".to_owned(),
            Self::Speed(speed) => format!("vertices at {speed:e} m/s"),
            Self::Force(force) => format!("forces of {force:e} N"),
            Self::Arrays => "arrays with what is not a number".to_owned(),
            Self::Load => "equilibrium under a load that is not a number".to_owned(),
            Self::Unheld => "equilibrium of a falling body".to_owned(),
        }
    }

    /// Whether it makes sense.
    fn is_for(self, kind: Kind, method: Method) -> bool {
        let solid = Kind::solids().any(|solid| solid == kind);
        match self {
            Self::Hasty => !method.is_linearized() && !kind.is_quadratic_in_energy(),
            Self::Through => solid && !method.is_linearized(),
            // Not a matter of time steps: once for each kind.
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
        Request::Hasty,
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
    let mut body = kind.build(&shape, |_| Stuff::new(1e5, 0.3), config, &handles)?;
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
        Request::Hasty => IntegratorOptions {
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
    // Something to keep: a state with forces on the hands.
    let mut before = Trial::new(body, method)?;
    before.run(STEP, 3, &near);
    let mut trial = Trial::with_options(before.body, method, options)?;
    let vertices = shape.positions().len();
    let granted = match request {
        Request::Length(h) => trial.step(h, &near),
        Request::Targets => trial.step(STEP, &near[..1]),
        Request::Far(distance) => trial.step(STEP, &moved(Vec3::y() * distance)),
        Request::Hasty => trial.step(STEP, &moved(Vec3::new(-0.7, 0.5, 0.3))),
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
    // With the usual patience.
    let mut after = Trial::new(trial.body, method)?;
    let goes_on = after.run(STEP, 3, &near);
    let reason = (!goes_on).then(|| format!("it does not go on: {:?}", after.account.error));
    Ok(Outcome {
        figure: f64::from(u8::from(granted)),
        limit: Some(0.0),
        account: asked,
        reason,
        ..Outcome::default()
    })
}
