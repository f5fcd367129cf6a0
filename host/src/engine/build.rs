//! Builds the bodies of the host's loop from the bodies of a scene.

use super::body::{HostBody, HostBodyParts};
use super::borne::Borne;
use super::path::HandlePath;
use super::plan::{BodyPlan, in_words};
use super::recipe::Recipe;
use super::tears::BodyTears;
use super::virtual_coupling::VirtualCoupling;
use crate::bodies::{self, Built};
use crate::scene::spec::Scene;
use crate::scene::{LoadedScene, SceneError};
use crate::stage::Stage;
use physics::FactorCode;
use rt_core::{MAX_DEVICES, Pose};

/// Options of a run that concern its bodies.
#[derive(Clone, Copy, Debug, Default)]
pub struct How {
    /// The code that makes factors.
    pub code: FactorCode,
    /// Whether the run is under the real clock: factors are then made on threads, and the budget of a step applies.
    pub real: bool,
}

/// Builds every body of a scene, at rest, with its solver.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be built.
pub fn bodies(loaded: &LoadedScene, how: How) -> Result<Vec<HostBody>, SceneError> {
    with_solvers(loaded, how, settled(loaded)?)
}

/// Builds every body of a scene and lets it settle, which takes the longest time of a large body's preparation.
///
/// # Errors
/// As [`bodies()`].
pub fn settled(loaded: &LoadedScene) -> Result<Vec<Built>, SceneError> {
    check(loaded)?;
    let each = (0..loaded.scene.bodies.len()).map(|index| {
        Stage::Building.begin();
        bodies::build_settled(loaded, index)
    });
    each.collect()
}

/// Gives each settled body of a scene its solver and the paths of its handles.
///
/// # Errors
/// As [`bodies()`].
pub fn with_solvers(
    loaded: &LoadedScene,
    how: How,
    settled: Vec<Built>,
) -> Result<Vec<HostBody>, SceneError> {
    let borne = Borne::new(loaded)?;
    let each = settled.into_iter().enumerate();
    each.map(|(index, built)| body(loaded, index, how, built, borne.clone()))
        .collect()
}

/// Checks the parts of a scene that only a run needs: devices and their mounts, and supports at rest. A body without handles is
/// allowed: it moves, and no device feels it.
///
/// # Errors
/// [`SceneError`], naming the file, line and field.
pub fn check(loaded: &LoadedScene) -> Result<(), SceneError> {
    let scene = &loaded.scene;
    if scene.devices.is_empty() {
        let allowed = format!("1 to {MAX_DEVICES} devices (`palpate solve` needs no device)");
        return Err(loaded.source.error("device", "no device", allowed));
    }
    for (index, body) in scene.bodies.iter().enumerate() {
        for (number, support) in body.supports.iter().enumerate() {
            let field = format!("body[{index}].support[{number}]");
            let moved = support.displacement != [0.0; 3];
            if moved || support.rotation.is_some() {
                let allowed = "a support at rest: only `palpate solve` moves supports";
                return Err(loaded.source.error(&field, "a support that moves", allowed));
            }
        }
    }
    for device in 0..scene.devices.len() {
        if bodies::is_mounted(loaded, device) || loaded.models[device].axes.is_some() {
            bodies::mount(loaded, device)?;
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

fn body(
    loaded: &LoadedScene,
    index: usize,
    how: How,
    mut built: Built,
    borne: Borne,
) -> Result<HostBody, SceneError> {
    let scene = &loaded.scene;
    let spec = &scene.bodies[index];
    let tears = BodyTears::new(loaded, index, &mut built)?;
    let plan = BodyPlan::new(loaded, index, &built);
    let recipe = Recipe::new(scene, &plan, how);
    Stage::Factorizing.begin();
    let mut solver = recipe.make(&built.body).map_err(|e| {
        let allowed = "a body whose matrix can be factorized";
        let field = format!("body[{index}]");
        loaded.source.error(&field, format!("{e}"), allowed)
    })?;
    if let Some(tears) = &tears {
        solver.begin_tears(&built.body, &tears.tearing);
    }
    let devices: Vec<u8> = bodies::tools(scene, spec)
        .iter()
        .map(|tool| tool.device as u8)
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
        recipe,
        smoothing: scene.host.smoothing,
        paths,
        devices,
        borne,
        step: plan.step,
        period: plan.period,
        horizon: plan.horizon,
        response: plan.response,
        publishes_energy: plan.publishes_energy,
        coupling: plan.links.map(VirtualCoupling::new),
        renderable: plan.renderable,
        tears,
    }))
}
