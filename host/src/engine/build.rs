//! Builds the bodies of the host's loop from the bodies of a scene.

use super::body::HostBody;
use super::hands::Hands;
use super::plan::{BodyPlan, in_words};
use super::projected::Projected;
use super::publisher::{Publisher, Publishing};
use super::recipe::Recipe;
use super::stats::Tally;
use super::stepping::Stepping;
use super::tears::BodyTears;
use super::virtual_coupling::VirtualCoupling;
use crate::scene::spec::Scene;
use crate::scene::{LoadedScene, SceneError};
use crate::world::{World, grasps};
use physics::FactorCode;
use rt_core::{MAX_DEVICES, Pose};

/// Options of a run that concern its bodies.
#[derive(Clone, Copy, Debug, Default)]
pub struct BuildOptions {
    /// The code that makes factors.
    pub code: FactorCode,
    /// Whether the run is under the real clock: factors are then made on threads, and the budget of a step applies.
    pub real: bool,
}

/// Gives each body of a world its solver and the paths of its handles. Most of the time goes into the first factors.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be built.
pub fn bodies(world: &World<'_>, how: BuildOptions) -> Result<Vec<HostBody>, SceneError> {
    let projected = Projected::new(world);
    (0..world.bodies.len())
        .map(|index| body(world, index, how, projected.clone()))
        .collect()
}

/// Checks the parts of a scene that only a run needs: devices and supports at rest. A body without handles is
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
    Ok(())
}

/// Number of physics steps from one publication to the next.
pub(crate) fn steps_per_publication(scene: &Scene) -> u64 {
    (scene.host.step_rate / scene.host.publish_rate)
        .round()
        .max(1.0) as u64
}

fn body(
    world: &World<'_>,
    index: usize,
    how: BuildOptions,
    projected: Projected,
) -> Result<HostBody, SceneError> {
    let loaded = world.loaded;
    let scene = &loaded.scene;
    let spec = &scene.bodies[index];
    let mut body = world.start(index).clone();
    let tears = BodyTears::new(world, index, &mut body)?;
    let plan = BodyPlan::new(world, index);
    let recipe = Recipe::new(scene, &plan, how);
    let mut solver = recipe.make(&body).map_err(|e| {
        let allowed = "a body whose matrix can be factorized";
        let field = format!("body[{index}]");
        loaded.source.error(&field, format!("{e}"), allowed)
    })?;
    if let Some(tears) = &tears {
        solver.begin_tears(&body, tears.tearing.journal().len());
    }
    let grasps = grasps(scene, spec);
    let devices: Vec<u8> = grasps.iter().map(|grasp| grasp.device as u8).collect();
    let places = world.bodies[index].handles.iter();
    let places = places.map(|handle| Pose::at(handle.origin));
    let hands = devices.iter().copied().zip(places);
    let hands = Hands::new(hands, scene.host.smoothing, plan.step);
    let publishing = Publishing {
        period: plan.period,
        horizon: plan.horizon,
        energy: plan.publishes_energy,
        projected,
        coupling: plan.links.map(VirtualCoupling::new),
        renderable: plan.renderable,
    };
    let publisher = Publisher::new(&body, &devices, publishing);
    let stepping = Stepping {
        body,
        solver,
        recipe,
        tears,
        step: plan.step,
        response: plan.response,
        sound: true,
        tally: Tally::default(),
    };
    let solver = in_words(plan.choice.solver, scene.host.tolerance);
    let solved = format!("{solver} ({})", plan.choice.why);
    Ok(HostBody::new(
        (plan.name, solved),
        hands,
        stepping,
        publisher,
    ))
}
