//! Builds a solid from the sections of a file: converts Gmsh's order of nodes to VTK's, drops unused nodes, fills
//! groups.

use super::assemble::{Places, nodes_of, places};
use super::elements::of_dimension;
use super::groups::groups;
use super::sections::Sections;
use super::{GmshError, fields};
use crate::soup_solid::{SolidFault, SolidSoup};
use physics::mesh::check::Location;
use physics::mesh::{Cells, TetMesh};

/// The solid of all tetrahedra, all of one order.
pub(super) fn mesh(sections: &Sections) -> Result<TetMesh, GmshError> {
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
    let positions = sections.nodes.iter().map(|node| node.position).collect();
    let soup = SolidSoup { positions, cells };
    let refused = |SolidFault { source, location }| {
        let at = match location {
            Location::Vertex(node) => sections.nodes.get(node as usize).map(|node| node.at),
            Location::Cell(cell) => of_dimension(&sections.blocks, 3)
                .nth(cell as usize)
                .map(|element| element.at),
            Location::Mesh => None,
        };
        GmshError::Solid {
            place: at.map_or(sections.end(), |at| sections.place(at)),
            source,
        }
    };
    let (mut mesh, vertices) = soup.into_mesh().map_err(refused)?;
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
