//! The mesh of a body whose connectivity may have changed, for its new surface.

use crate::record::Surface;
use physics::mesh::Mesh;

/// The surface of a body of this `mesh` from the topology epoch on. The positions at rest stay those of `before` if
/// the body has as many vertices; otherwise they are those of the mesh.
pub(crate) fn after_change(before: &Surface, epoch: u32, mesh: &Mesh) -> Surface {
    let mut surface = Surface::of_mesh(before.body as usize, u64::from(epoch), mesh);
    if surface.rest.len() == before.rest.len() {
        surface.rest.clone_from(&before.rest);
    }
    surface
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::world::World;
    use std::path::Path;

    #[test]
    fn a_body_that_did_not_change_keeps_its_surface() -> Result<(), Box<dyn std::error::Error>> {
        let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        for name in ["cloth.toml", "press.toml", "thread.toml"] {
            let loaded = Scene::load(&scenes.join(name))?;
            for (index, built) in World::new(&loaded)?.bodies.iter().enumerate() {
                let before = Surface::of_mesh(index, built.body.epoch(), &built.mesh);
                let mesh = built.body.mesh().ok_or("a body without elements")?;
                let after = after_change(&before, 7, &mesh);
                let expected = Surface { epoch: 7, ..before };
                assert_eq!(after, expected, "{name}");
            }
        }
        Ok(())
    }
}
