//! Builds a mesh from the sections of a file: converts node tags to indices and the order of nodes to VTK's, drops unused
//! nodes, fills groups.

use super::elements::of_dimension;
use super::groups::groups;
use super::sections::Sections;
use super::{elements::Element, fields};
use crate::error::{FilePosition, GmshError, InvalidMesh};
use crate::soup::{CellList, Fault, Soup};
use physics::mesh::check::Location;
use physics::mesh::{Cells, LineMesh, TetMesh, TriMesh};
use std::collections::BTreeMap;

/// Where each node tag stands in the list of nodes.
pub(super) type Places = BTreeMap<u64, usize>;

/// The thread of all 2-node lines.
pub(super) fn thread(sections: &Sections, merge: Option<f64>) -> Result<LineMesh, GmshError> {
    let places = places(sections)?;
    let lines = cells::<2>(sections, &places, 1)?;
    let (mut mesh, vertices) = mesh_of(lines, sections, 1, merge)?;
    let groups = groups(sections, 0..=3);
    mesh.vertex_groups = groups.of_vertices(&places, &vertices)?;
    mesh.line_groups = groups.of_cells(1);
    mesh.line_fields = fields::per_cell(sections, 1)?;
    Ok(mesh)
}

/// The sheet of all triangles.
pub(super) fn sheet(sections: &Sections, merge: Option<f64>) -> Result<TriMesh, GmshError> {
    let places = places(sections)?;
    let triangles = cells::<3>(sections, &places, 2)?;
    let (mut mesh, vertices) = mesh_of(triangles, sections, 2, merge)?;
    let groups = groups(sections, 0..=3);
    mesh.vertex_groups = groups.of_vertices(&places, &vertices)?;
    mesh.triangle_groups = groups.of_cells(2);
    mesh.triangle_fields = fields::per_cell(sections, 2)?;
    Ok(mesh)
}

/// The solid of all tetrahedra, all of one order.
pub(super) fn solid(sections: &Sections, merge: Option<f64>) -> Result<TetMesh, GmshError> {
    let places = places(sections)?;
    let mut tetrahedra = sections.blocks.iter().filter(|block| block.kind.dim == 3);
    let cells = if tetrahedra.all(|block| block.kind.nodes == 4) {
        Cells::Linear(cells(sections, &places, 3)?)
    } else {
        let cells = cells(sections, &places, 3)?;
        Cells::Quadratic(cells.into_iter().map(to_or_from_vtk).collect())
    };
    let (mut mesh, vertices) = mesh_of(cells, sections, 3, merge)?;
    mesh.vertex_groups = groups(sections, 0..=2).of_vertices(&places, &vertices)?;
    mesh.cell_groups = groups(sections, 3..=3).of_cells(3);
    mesh.cell_fields = fields::per_cell(sections, 3)?;
    Ok(mesh)
}

/// The indices of the nodes of each element of a dimension.
fn cells<const N: usize>(
    sections: &Sections,
    places: &Places,
    dim: u8,
) -> Result<Vec<[u32; N]>, GmshError> {
    of_dimension(&sections.blocks, dim)
        .map(|element| {
            let mut nodes = [0; N];
            for (vertex, &tag) in nodes.iter_mut().zip(element.nodes) {
                // The numbers overflow only for a mesh that is refused for its size.
                *vertex = place_of(tag, element, sections, places)? as u32;
            }
            Ok(nodes)
        })
        .collect()
}

/// Converts the nodes of a quadratic tetrahedron from Gmsh's order to VTK's, or back: the middles of the edges 13 and
/// 23 are swapped ("Node ordering" in the Gmsh reference manual).
pub(crate) fn to_or_from_vtk(mut nodes: [u32; 10]) -> [u32; 10] {
    nodes.swap(8, 9);
    nodes
}

/// The mesh of the `cells`, which are all elements of a dimension, and the number of each node in it.
fn mesh_of<C: CellList>(
    cells: C,
    sections: &Sections,
    dim: u8,
    merge: Option<f64>,
) -> Result<(C::Mesh, Vec<u32>), InvalidMesh> {
    let positions = sections.nodes.iter().map(|node| node.position).collect();
    let refused = |Fault { source, location }| InvalidMesh {
        position: position_of_fault(location, sections, dim),
        source,
    };
    Soup { positions, cells }.into_mesh(merge).map_err(refused)
}

/// The index of each node tag in the list of nodes. Tags may be sparse: they are looked up, never used as
/// indices.
fn places(sections: &Sections) -> Result<Places, GmshError> {
    let mut places = Places::new();
    for (place, node) in sections.nodes.iter().enumerate() {
        if let Some(earlier) = places.insert(node.tag, place) {
            let item = format!("node tag {}", node.tag);
            let first = sections.nodes.get(earlier).map_or(0, |node| node.at);
            return Err(GmshError::Repeated {
                position: sections.position(node.at),
                item,
                first: sections.position(first),
            });
        }
    }
    Ok(places)
}

/// The index of a node that an element names.
pub(super) fn place_of(
    tag: u64,
    element: Element,
    sections: &Sections,
    places: &Places,
) -> Result<usize, GmshError> {
    places.get(&tag).copied().ok_or_else(|| GmshError::Syntax {
        position: sections.position(element.at),
        expected: "the tag of a node in $Nodes".to_owned(),
        found: tag.to_string(),
    })
}

/// The position of a faulty node, or of a faulty element among those of a dimension.
fn position_of_fault(location: Location, sections: &Sections, dim: u8) -> FilePosition {
    let at = match location {
        Location::Vertex(node) => sections.nodes.get(node as usize).map(|node| node.at),
        Location::Cell(cell) => of_dimension(&sections.blocks, dim)
            .nth(cell as usize)
            .map(|element| element.at),
        Location::Mesh => None,
    };
    at.map_or(sections.end(), |at| sections.position(at))
}
