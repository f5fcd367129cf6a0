//! The mountings of the devices in the scene, and the positions of their handles in their workspaces.

use crate::scene::plausible::{START, Warning};
use crate::scene::{LoadedScene, SceneError};
use nalgebra::UnitQuaternion;
use physics::Vec3;

/// The mounting of a device: a position \\( x \\) of the device, in its own axes and metres, is the position
/// `origin + rotation * motion_scale * x` of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mount {
    /// Where the device's own origin lies in the scene (m).
    pub origin: Vec3,
    /// From the device's axes to those of the scene.
    pub rotation: UnitQuaternion<f64>,
    /// Where what it holds is at rest (m, device axes and device metres); its origin, if it holds none.
    pub start: Vec3,
}

/// The mount of the device number `device`, which holds a `handle` at this place at rest (m), or nothing.
///
/// # Errors
/// [`SceneError`], naming the file, line and field, if the handle is not in the workspace that the scene gives the device,
/// or not on the axes of a device of one or two degrees of freedom.
pub(super) fn mount(
    loaded: &LoadedScene,
    device: usize,
    handle: Option<Vec3>,
) -> Result<Mount, SceneError> {
    let spec = &loaded.scene.devices[device];
    let rotation = spec.mounting.turn();
    let (origin, start) = match (spec.mounting.origin.map(Vec3::from), handle) {
        (None, handle) => (handle.unwrap_or_else(Vec3::zeros), Vec3::zeros()),
        (Some(origin), None) => (origin, Vec3::zeros()),
        (Some(origin), Some(handle)) => {
            let start = rotation.inverse() * (handle - origin) / spec.motion_scale;
            (origin, start)
        }
    };
    let start = on_axes(loaded, device, start)?;
    if let (Some([low, high]), Some(_)) = (spec.workspace, handle) {
        let inside = (0..3).all(|axis| (low[axis]..=high[axis]).contains(&start[axis]));
        if !inside {
            let field = format!("device[{device}].workspace");
            let [x, y, z] = start.into();
            let found = format!(
                "a box without the handle, which is at ({x:.4}, {y:.4}, {z:.4}) m of the device at rest"
            );
            let allowed =
                "a box around the handle: correct the box, or move the device by mounting.origin";
            return Err(loaded.source.error(&field, found, allowed));
        }
    }
    Ok(Mount {
        origin,
        rotation,
        start,
    })
}

/// The place at which a device meets its handle at rest (m, device axes): `start` itself, without the rest across the
/// axes of a device of one or two degrees of freedom. Such a rest of more than an encoder count is an error.
fn on_axes(loaded: &LoadedScene, device: usize, start: Vec3) -> Result<Vec3, SceneError> {
    let model = &loaded.models[device];
    let along = model.freedom().part(&start);
    let across = start - along;
    if across.norm() <= model.position_step {
        return Ok(along);
    }
    // Adding zero turns the sign of a rounded zero.
    let [x, y, z] = across.map(|x| (x * 1e6).round() * 1e-6 + 0.0).into();
    let found = format!(
        "a handle at rest that is off the axes of the device by ({x:.6}, {y:.6}, {z:.6}) m of the device"
    );
    let allowed = "an origin from which the axes of the device lead to the handle";
    let field = format!("device[{device}].mounting.origin");
    Err(loaded.source.error(&field, found, allowed))
}

/// Warnings about handles at rest that are far from the origins of their devices.
pub(super) fn warnings(loaded: &LoadedScene, mounts: &[Mount]) -> Vec<Warning> {
    let devices = loaded.scene.devices.iter().zip(&loaded.models).zip(mounts);
    let warnings = devices
        .enumerate()
        .filter_map(|(index, ((spec, model), mount))| {
            // A workspace that is given is checked when the device is mounted.
            if spec.mounting.origin.is_none() || spec.workspace.is_some() {
                return None;
            }
            let field = format!("device[{index}].mounting.origin");
            let what = " from the handle at rest to the origin of the device";
            let usual = START.up_to(model.workspace_radius);
            let judged = usual.judge(&loaded.source, &field, what, mount.start.norm());
            judged.ok().flatten()
        });
    warnings.collect()
}
