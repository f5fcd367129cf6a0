//! Builds a thread from the sections of a file: drops unused nodes, fills groups.

use super::assemble::{mesh_of, nodes_of, places};
use super::elements::of_dimension;
use super::fields;
use super::groups::groups;
use super::sections::Sections;
use crate::error::GmshError;
use physics::mesh::LineMesh;

/// The thread of all 2-node lines.
pub(super) fn mesh(sections: &Sections, merge: Option<f64>) -> Result<LineMesh, GmshError> {
    let places = places(sections)?;
    let lines = of_dimension(&sections.blocks, 1)
        .map(|element| {
            // Numbers run out only if the mesh is refused for its size.
            let nodes = nodes_of::<2>(element, sections, &places)?;
            Ok(nodes.map(|node| node as u32))
        })
        .collect::<Result<Vec<_>, GmshError>>()?;
    let (mut mesh, vertices) = mesh_of(lines, sections, 1, merge)?;
    let groups = groups(sections, 0..=3);
    mesh.vertex_groups = groups.of_vertices(&places, &vertices)?;
    mesh.line_groups = groups.of_cells(1);
    mesh.line_fields = fields::per_cell(sections, 1)?;
    Ok(mesh)
}
