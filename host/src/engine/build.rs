//! Builds the bodies of the host's loop from the bodies of a scene.

use super::beside::Beside;
use super::body::{HostBody, HostBodyParts};
use super::path::HandlePath;
use super::plan::{BodyPlan, in_words};
use super::solver::{Assembled, Frozen, Solver};
use super::stats::StepFault;
use super::virtual_coupling::VirtualCoupling;
use crate::bodies;
use crate::scene::spec::{Scene, SolverName};
use crate::scene::{LoadedScene, SceneError};
use physics::{
    Body, Condenser, FactorCode, Preconditioner, Real, ShapeOptions, Stepper, StepperOptions,
};
use rt_core::{MAX_DEVICES, MAX_HANDLES, Pose};

/// Most iterations for a shape at a time on an incomplete factor. Large sheets take the most, some hundred. The limit
/// keeps a condensation from delaying the steps for a small gain in accuracy.
const INCOMPLETE_SHAPE_ITERATIONS: usize = 200;

/// Options of a run that concern its bodies.
#[derive(Clone, Copy, Debug, Default)]
pub struct How {
    /// The code that makes factors.
    pub code: FactorCode,
    /// Whether the run is under the real clock: factors are then made on threads, and the budget of a step applies.
    pub real: bool,
}

/// Builds every body of a scene, at rest.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be built.
pub fn bodies(loaded: &LoadedScene, how: How) -> Result<Vec<HostBody>, SceneError> {
    check(loaded)?;
    (0..loaded.scene.bodies.len())
        .map(|index| body(loaded, index, how))
        .collect()
}

/// Checks the parts of a scene that only a run needs: devices, handles on every body, and supports at rest.
///
/// # Errors
/// [`SceneError`], naming the file, line and field.
pub fn check(loaded: &LoadedScene) -> Result<(), SceneError> {
    let scene = &loaded.scene;
    let refuse = |field: &str, found: &str, allowed: &str| {
        let allowed = format!("{allowed} (`palpate solve` needs none)");
        Err(loaded.source.error(field, found, allowed))
    };
    if scene.devices.is_empty() {
        let allowed = format!("1 to {MAX_DEVICES} of them in a run");
        return refuse("device", "none", &allowed);
    }
    for (index, body) in scene.bodies.iter().enumerate() {
        if body.handles.is_empty() {
            let allowed = format!("1 to {MAX_HANDLES} handles in a run");
            return refuse(&format!("body[{index}]"), "no handle", &allowed);
        }
        for (number, support) in body.supports.iter().enumerate() {
            let field = format!("body[{index}].support[{number}]");
            let moved = support.displacement != [0.0; 3];
            if moved || support.rotation.is_some() {
                let allowed = "a support at rest: only `palpate solve` moves supports";
                return Err(loaded.source.error(&field, "one that moves", allowed));
            }
        }
    }
    Ok(())
}

/// Number of physics steps from one publication to the next.
pub(crate) fn steps_per_publication(scene: &Scene) -> u64 {
    (scene.host.step_rate / scene.host.publish_rate)
        .round()
        .max(1.0) as u64
}

fn body(loaded: &LoadedScene, index: usize, how: How) -> Result<HostBody, SceneError> {
    let scene = &loaded.scene;
    let spec = &scene.bodies[index];
    let built = bodies::build_settled(loaded, index)?;
    let plan = BodyPlan::new(loaded, index, &built);
    let solver = solver(scene, &built.body, &plan, how).map_err(|e| {
        let allowed = "a body whose matrix can be factorized";
        let field = format!("body[{index}]");
        loaded.source.error(&field, format!("{e}"), allowed)
    })?;
    let devices: Vec<u8> = spec
        .handles
        .iter()
        .map(|handle| scene.device_of(handle) as u8)
        .collect();
    let paths = built
        .handles
        .iter()
        .zip(&devices)
        .map(|(handle, device)| {
            HandlePath::new(
                usize::from(*device),
                scene.host.smoothing,
                Pose::at(handle.origin),
            )
        })
        .collect();
    Ok(HostBody::new(HostBodyParts {
        name: plan.name,
        solved: format!(
            "{} ({})",
            in_words(plan.choice.solver, scene.host.tolerance),
            plan.choice.why
        ),
        body: built.body,
        solver,
        paths,
        devices,
        step: plan.step,
        period: plan.period,
        horizon: plan.horizon,
        publishes_energy: plan.publishes_energy,
        coupling: plan.links.map(VirtualCoupling::new),
    }))
}

/// The solver that `plan` chooses for `body`.
fn solver(
    scene: &Scene,
    body: &Body,
    plan: &BodyPlan,
    how: How,
) -> Result<Box<dyn Solver>, StepFault> {
    let complete = Preconditioner::Complete;
    let incomplete = Preconditioner::Incomplete;
    Ok(match plan.choice.solver {
        SolverName::Auto | SolverName::Frozen => {
            Box::new(frozen::<f64>(scene, body, plan, complete, how)?)
        }
        SolverName::FrozenSingle => Box::new(frozen::<f32>(scene, body, plan, complete, how)?),
        SolverName::Incomplete => Box::new(frozen::<f64>(scene, body, plan, incomplete, how)?),
        SolverName::Assembled => {
            let condenser = plan.condenses.then(|| Condenser::with_code(body, how.code));
            Box::new(Assembled::new(condenser.transpose()?))
        }
    })
}

fn frozen<T: Real>(
    scene: &Scene,
    body: &Body,
    plan: &BodyPlan,
    preconditioner: Preconditioner,
    how: How,
) -> Result<Frozen<T>, StepFault> {
    let h = plan.step;
    let options = StepperOptions {
        tolerance: scene.host.tolerance,
        max_iterations: scene.host.max_iterations,
        preconditioner,
        code: how.code,
        refresh: false,
        ..StepperOptions::default()
    };
    let mut stepper = Stepper::new(body, options)?;
    // The first factor is made before the run, so that the first step takes no longer than the others.
    stepper.prepare(body, h)?;
    let beside = if how.real {
        Beside::thread(h)
    } else {
        Beside::at_a_step(h)
    };
    let shapes = plan.condenses.then(|| ShapeOptions {
        max_iterations: match preconditioner {
            Preconditioner::Complete => ShapeOptions::default().max_iterations,
            Preconditioner::Incomplete => INCOMPLETE_SHAPE_ITERATIONS,
        },
        ..ShapeOptions::default()
    });
    let budget = how.real.then_some(scene.host.budget).flatten();
    let budget_ns = budget.map(|budget| (budget * 1e9) as u64);
    Ok(Frozen::new(stepper, beside, shapes, budget_ns))
}
