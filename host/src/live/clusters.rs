//! The clusters of the contact's hierarchy for viewers.
//!
//! The engine makes the hierarchy of a run by the same rule from the same meshes. A sheet that tears keeps the clusters of
//! its start here; a vertex that a tear made has none.

use crate::world::{Built, World};
use physics::contact::{Hierarchy, Skin, Surfaces};

/// By body and vertex: the cluster of the vertex, of several the last one; zero for a vertex inside a solid. Empty if nothing
/// touches.
pub(super) fn clusters(world: &World<'_>) -> Vec<Vec<u32>> {
    if !world.loaded.scene.has_contact() {
        return vec![Vec::new(); world.bodies.len()];
    }
    world.bodies.iter().map(of_body).collect()
}

fn of_body(built: &Built) -> Vec<u32> {
    let mut surfaces = Surfaces::default();
    // What a body may touch does not change its clusters.
    let skin = Skin {
        radius: 0.0,
        touches_itself: false,
        is_obstacle: false,
    };
    let x = built.mesh.positions();
    let mut found = vec![0; x.len()];
    // A mesh without a surface was refused when the world was built.
    if surfaces.add(&built.mesh, skin).is_ok() {
        let hierarchy = Hierarchy::new(&surfaces, x);
        for (number, cluster) in (0..).zip(0..hierarchy.clusters().len()) {
            for vertex in hierarchy.members(cluster) {
                found[*vertex as usize] = number;
            }
        }
    }
    found
}
