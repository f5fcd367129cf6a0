//! The mesh of a body, whose connectivity may have changed since it was built.

use super::Body;
use crate::Vec3;
use crate::mesh::tet::TetMesh;
use crate::mesh::{Cells, LineMesh, Mesh, TriMesh};

impl Body {
    /// The elements of the body at its present positions. Without groups and fields; `None` for a body without elements.
    pub fn mesh(&self) -> Option<Mesh> {
        let positions: Vec<Vec3> = self.positions().collect();
        let corners = self
            .elements()
            .iter()
            .find_map(|set| (set.count() > 0).then(|| set.nodes(0).len()))?;
        Some(match corners {
            2 => Mesh::Thread(LineMesh {
                positions,
                lines: elements(self),
                ..LineMesh::default()
            }),
            3 => Mesh::Sheet(TriMesh {
                positions,
                triangles: elements(self),
                ..TriMesh::default()
            }),
            4 => solid(positions, Cells::Linear(elements(self))),
            10 => solid(positions, Cells::Quadratic(elements(self))),
            _ => return None,
        })
    }
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
