//! From a scene's bodies to bodies in the host loop.

use super::body::{HostBody, HostBodyParts};
use super::path::HandlePath;
use super::plan;
use crate::bodies::{self, Built};
use crate::scene::spec::{self, Scene};
use crate::scene::{LoadedScene, SceneError};
use physics::fem::Condenser;
use physics::fem::cholesky::Kernels;
use rt_core::{MAX_DEVICES, MAX_HANDLES, Pose};

/// Builds every body of a scene, at rest, with `kernels` for its linear algebra.
///
/// # Errors
/// [`SceneError`], naming the file, line and field that cannot be built.
pub fn bodies(loaded: &LoadedScene, kernels: Kernels) -> Result<Vec<HostBody>, SceneError> {
    check(loaded)?;
    (0..loaded.scene.bodies.len())
        .map(|index| body(loaded, index, kernels))
        .collect()
}

/// What a run needs of a scene beside what every scene has: hands, and bodies that they hold.
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
pub fn steps_per_publication(scene: &Scene) -> u64 {
    (scene.host.step_rate / scene.host.publish_rate)
        .round()
        .max(1.0) as u64
}

fn body(loaded: &LoadedScene, index: usize, kernels: Kernels) -> Result<HostBody, SceneError> {
    let scene = &loaded.scene;
    let spec = &scene.bodies[index];
    let Built { body, handles, .. } = bodies::build(loaded, index)?;
    let condenser = if plan::condenses(scene) {
        let refuse = |e| {
            let allowed = "a body that can be condensed";
            loaded
                .source
                .error(&format!("body[{index}]"), format!("{e}"), allowed)
        };
        Some(Condenser::with_kernels(&body, kernels).map_err(refuse)?)
    } else {
        None
    };
    let devices: Vec<u8> = spec.handles.iter().map(|h| device_of(scene, h)).collect();
    let paths = handles
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
        name: spec.name.clone(),
        body,
        condenser,
        paths,
        devices,
        step: 1.0 / scene.host.step_rate,
        period: 1.0 / scene.host.publish_rate,
    }))
}

/// The scene's consistency was checked when it was read: the device exists.
fn device_of(scene: &Scene, handle: &spec::Handle) -> u8 {
    scene
        .devices
        .iter()
        .position(|device| device.name == handle.device)
        .unwrap_or(0) as u8
}
