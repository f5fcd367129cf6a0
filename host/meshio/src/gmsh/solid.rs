//! Builds a solid from the sections of a file: converts Gmsh's order of nodes to VTK's, drops unused nodes, fills
//! groups.

use super::assemble::{Places, mesh_of, nodes_of, places};
use super::elements::of_dimension;
use super::fields;
use super::groups::groups;
use super::sections::Sections;
use crate::error::GmshError;
use physics::mesh::{Cells, TetMesh};

/// The solid of all tetrahedra, all of one order.
pub(super) fn mesh(sections: &Sections, merge: Option<f64>) -> Result<TetMesh, GmshError> {
    let places = places(sections)?;
    let mut tetrahedra = sections.blocks.iter().filter(|block| block.kind.dim == 3);
    let cells = if tetrahedra.all(|block| block.kind.nodes == 4) {
        Cells::Linear(cells(sections, &places)?)
    } else {
        let mut cells = cells(sections, &places)?;
        for cell in &mut cells {
            *cell = to_or_from_vtk(*cell);
        }
        Cells::Quadratic(cells)
    };
    let (mut mesh, vertices) = mesh_of(cells, sections, 3, merge)?;
    mesh.vertex_groups = groups(sections, 0..=2).of_vertices(&places, &vertices)?;
    mesh.cell_groups = groups(sections, 3..=3).of_cells(3);
    mesh.cell_fields = fields::per_cell(sections, 3)?;
    Ok(mesh)
}

/// The indices of each tetrahedron's nodes.
fn cells<const N: usize>(sections: &Sections, places: &Places) -> Result<Vec<[u32; N]>, GmshError> {
    of_dimension(&sections.blocks, 3)
        .map(|element| {
            // The numbers overflow only for a mesh that is refused for its size.
            let nodes = nodes_of::<N>(element, sections, places)?;
            Ok(nodes.map(|node| node as u32))
        })
        .collect()
}

/// Converts the nodes of a quadratic tetrahedron from Gmsh's order to VTK's, or back: the middles of the edges 13 and
/// 23 are swapped ("Node ordering" in the Gmsh reference manual).
pub(crate) fn to_or_from_vtk(mut nodes: [u32; 10]) -> [u32; 10] {
    nodes.swap(8, 9);
    nodes
}
