//! Builds a sheet from the sections of a file: converts node tags to indices, drops unused nodes, fills groups.

use super::elements::of_dimension;
use super::groups::groups;
use super::sections::Sections;
use super::{elements::Element, fields};
use crate::error::{GmshError, InvalidMesh, Place};
use crate::soup::{CellList, Fault, Soup};
use physics::mesh::TriMesh;
use physics::mesh::check::Location;
use std::collections::BTreeMap;

/// Where each node tag stands in the list of nodes.
pub(super) type Places = BTreeMap<u64, usize>;

/// The sheet of all triangles.
pub(super) fn sheet(sections: &Sections, merge: Option<f64>) -> Result<TriMesh, GmshError> {
    let places = places(sections)?;
    let triangles = of_dimension(&sections.blocks, 2)
        .map(|element| {
            // The numbers overflow only for a mesh that is refused for its size.
            let nodes = nodes_of::<3>(element, sections, &places)?;
            Ok(nodes.map(|node| node as u32))
        })
        .collect::<Result<Vec<_>, GmshError>>()?;
    let (mut mesh, vertices) = mesh_of(triangles, sections, 2, merge)?;
    let groups = groups(sections, 0..=3);
    mesh.vertex_groups = groups.of_vertices(&places, &vertices)?;
    mesh.triangle_groups = groups.of_cells(2);
    mesh.triangle_fields = fields::per_cell(sections, 2)?;
    Ok(mesh)
}

/// The mesh of the `cells`, which are all elements of a dimension, and the number of each node in it.
pub(super) fn mesh_of<C: CellList>(
    cells: C,
    sections: &Sections,
    dim: u8,
    merge: Option<f64>,
) -> Result<(C::Mesh, Vec<u32>), InvalidMesh> {
    let positions = sections.nodes.iter().map(|node| node.position).collect();
    let refused = |Fault { source, location }| InvalidMesh {
        place: place_of_fault(location, sections, dim),
        source,
    };
    Soup { positions, cells }.into_mesh(merge).map_err(refused)
}

/// The index of each node tag in the list of nodes. Tags may be sparse: they are looked up, never used as
/// indices.
pub(super) fn places(sections: &Sections) -> Result<Places, GmshError> {
    let mut places = Places::new();
    for (place, node) in sections.nodes.iter().enumerate() {
        if let Some(earlier) = places.insert(node.tag, place) {
            let item = format!("node tag {}", node.tag);
            let first = sections.nodes.get(earlier).map_or(0, |node| node.at);
            return Err(GmshError::Repeated {
                place: sections.place(node.at),
                item,
                first: sections.place(first),
            });
        }
    }
    Ok(places)
}

/// The indices of an element's nodes.
pub(super) fn nodes_of<const N: usize>(
    element: Element,
    sections: &Sections,
    places: &Places,
) -> Result<[usize; N], GmshError> {
    let mut found = [0; N];
    for (place, &tag) in found.iter_mut().zip(element.nodes) {
        *place = place_of(tag, element, sections, places)?;
    }
    Ok(found)
}

/// The index of a node that an element names.
pub(super) fn place_of(
    tag: u64,
    element: Element,
    sections: &Sections,
    places: &Places,
) -> Result<usize, GmshError> {
    places.get(&tag).copied().ok_or_else(|| GmshError::Syntax {
        place: sections.place(element.at),
        expected: "the tag of a node in $Nodes".to_owned(),
        found: tag.to_string(),
    })
}

/// The place of a faulty node, or of a faulty element among those of a dimension.
fn place_of_fault(location: Location, sections: &Sections, dim: u8) -> Place {
    let at = match location {
        Location::Vertex(node) => sections.nodes.get(node as usize).map(|node| node.at),
        Location::Cell(cell) => of_dimension(&sections.blocks, dim)
            .nth(cell as usize)
            .map(|element| element.at),
        Location::Mesh => None,
    };
    at.map_or(sections.end(), |at| sections.place(at))
}
