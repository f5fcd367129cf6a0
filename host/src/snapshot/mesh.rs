//! The mesh of a body whose connectivity may have changed, for its new surface.

use crate::record::Surface;
use physics::mesh::tet::TetMesh;
use physics::mesh::{Cells, LineMesh, Mesh, TriMesh};
use physics::{Body, Vec3};

/// The elements of `body` at its present positions. Without groups and fields; `None` for a body without elements.
pub(crate) fn mesh_of(body: &Body) -> Option<Mesh> {
    let positions: Vec<Vec3> = body.positions().collect();
    let corners = body
        .elements()
        .iter()
        .find_map(|set| (set.count() > 0).then(|| set.nodes(0).len()))?;
    Some(match corners {
        2 => Mesh::Thread(LineMesh {
            positions,
            lines: elements(body),
            ..LineMesh::default()
        }),
        3 => Mesh::Sheet(TriMesh {
            positions,
            triangles: elements(body),
            ..TriMesh::default()
        }),
        4 => solid(positions, Cells::Linear(elements(body))),
        10 => solid(positions, Cells::Quadratic(elements(body))),
        _ => return None,
    })
}

fn solid(positions: Vec<Vec3>, cells: Cells) -> Mesh {
    Mesh::Solid(TetMesh {
        positions,
        cells,
        vertex_groups: Vec::new(),
        cell_groups: Vec::new(),
        cell_fields: Vec::new(),
    })
}

/// The vertices of the elements that have `N` of them.
fn elements<const N: usize>(body: &Body) -> Vec<[u32; N]> {
    let sets = body.elements().iter();
    sets.flat_map(|set| (0..set.count()).filter_map(|e| set.nodes(e).try_into().ok()))
        .collect()
}

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
                let mesh = mesh_of(&built.body).ok_or("a body without elements")?;
                let after = after_change(&before, 7, &mesh);
                let expected = Surface { epoch: 7, ..before };
                assert_eq!(after, expected, "{name}");
            }
        }
        Ok(())
    }
}
