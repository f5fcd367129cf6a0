//! Warnings about hands and supports that would press a solid flat.
//!
//! A solid that is pressed by most of its height is outside of every law's measurements, and a few millimetres
//! further its elements invert. Such a motion is mostly one in another unit, or in the axes of another device.

use super::selection;
use crate::scene::LoadedScene;
use crate::scene::plausible::Warning;
use physics::Vec3;
use physics::mesh::Mesh;

/// The largest part of the height that a press usually takes.
const MOST: f64 = 0.7;

/// The warnings of the body number `index`.
pub(super) fn warnings(loaded: &LoadedScene, index: usize, mesh: &Mesh) -> Vec<Warning> {
    let Mesh::Solid(_) = mesh else {
        return Vec::new();
    };
    let body = &loaded.scene.bodies[index];
    let points = |field: &str, group: Option<&str>, in_box| -> Vec<Vec3> {
        let found = selection::vertices(loaded, field, group, in_box, mesh);
        let found = found.unwrap_or_default().into_iter();
        found.map(|v| mesh.positions()[v as usize]).collect()
    };
    let mut still = Vec::new();
    // The motions: the field that gives it, the moved vertices, and where they go (m).
    let mut motions = Vec::new();
    for (number, support) in body.supports.iter().enumerate() {
        let field = format!("body[{index}].support[{number}]");
        let held = points(&field, support.group.as_deref(), support.in_box);
        let to = Vec3::from(support.displacement);
        if to != Vec3::zeros() {
            motions.push((format!("{field}.displacement"), held, to));
        } else if support.axes == [true; 3] && support.rotation.is_none() {
            still.extend(held);
        }
    }
    for (number, handle) in body.handles.iter().enumerate() {
        let device = loaded.scene.device_of(handle);
        let spec = &loaded.scene.devices[device];
        let Some(hand) = &spec.hand else { continue };
        let turn = spec.mounting.turn();
        let rows = hand
            .waypoints
            .iter()
            .enumerate()
            .map(|(row, [_, x, y, z])| {
                let to = turn * Vec3::new(*x, *y, *z) * spec.motion_scale;
                (row, to)
            });
        let farthest = rows.max_by(|a, b| a.1.norm().total_cmp(&b.1.norm()));
        if let Some((row, to)) = farthest.filter(|(_, to)| *to != Vec3::zeros()) {
            let held = points(
                &format!("body[{index}].handle[{number}]"),
                handle.group.as_deref(),
                handle.in_box,
            );
            motions.push((format!("device[{device}].hand.waypoints[{row}]"), held, to));
        }
    }
    let each = motions.iter();
    each.filter_map(|(field, held, to)| {
        let height = height(held, &still, &to.normalize())?;
        (to.norm() > MOST * height).then(|| Warning {
            location: loaded.source.location(field),
            found: format!(
                "a motion of {:.4} m towards supports that are {height:.4} m ahead",
                to.norm()
            ),
            usual: format!("up to {MOST} of that distance"),
            advice: "is the value in metres? the body would be pressed nearly flat, and its elements may invert"
                .to_owned(),
        })
    })
    .collect()
}

/// The distance along the unit vector `along` from the foremost of the `held` points to the nearest of the points that
/// stand `still`; `None` unless all of these lie ahead.
fn height(held: &[Vec3], still: &[Vec3], along: &Vec3) -> Option<f64> {
    let front = held.iter().map(|p| p.dot(along)).reduce(f64::max)?;
    let back = still.iter().map(|p| p.dot(along)).reduce(f64::min)?;
    (back > front).then_some(back - front)
}
