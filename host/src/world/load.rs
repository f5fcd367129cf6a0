//! Converts the loads of a body to forces on its vertices.

use super::selection;
use crate::scene::{LoadedScene, SceneError};
use physics::Vec3;
use physics::body::load::{Spread, spread_on_sheet, spread_on_solid, spread_on_thread};
use physics::mesh::Mesh;

/// The sum of the scene's loads on one body, a force for each vertex (N).
pub(super) fn build(
    loaded: &LoadedScene,
    index: usize,
    mesh: &Mesh,
) -> Result<Vec<Vec3>, SceneError> {
    let mut forces = vec![Vec3::zeros(); mesh.positions().len()];
    for (number, load) in loaded.scene.bodies[index].loads.iter().enumerate() {
        let field = format!("body[{index}].load[{number}]");
        let group = load.group.as_deref();
        let vertices = selection::vertices(loaded, &field, group, load.in_box, mesh)?;
        let Spread { fractions, area } = match mesh {
            Mesh::Thread(mesh) => spread_on_thread(mesh, &vertices),
            Mesh::Sheet(mesh) => spread_on_sheet(mesh, &vertices),
            Mesh::Solid(mesh) => spread_on_solid(mesh, &vertices),
        };
        // The consistency of the scene was checked: a load has either a traction or a force.
        let total = match load.traction {
            Some(traction) => {
                if area == 0.0 {
                    let field = format!("{field}.traction");
                    let found = "a part of the mesh without a whole face";
                    let allowed = "a part with an area, or `force` in its place";
                    return Err(loaded.source.error(&field, found, allowed));
                }
                Vec3::from(traction) * area
            }
            None => Vec3::from(load.force.unwrap_or_default()),
        };
        for (force, fraction) in forces.iter_mut().zip(&fractions) {
            *force += total * *fraction;
        }
    }
    Ok(forces)
}
