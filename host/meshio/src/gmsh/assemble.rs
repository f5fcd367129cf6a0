//! Builds a sheet from the sections of a file: converts node tags to indices, drops unused nodes, fills groups.

use super::elements::of_dimension;
use super::groups::groups;
use super::sections::Sections;
use super::{GmshError, elements::Element, fields};
use crate::file::Place;
use crate::soup::UNUSED;
use physics::mesh::check::{Location, check_distinct};
use physics::mesh::{MeshError, TriMesh};
use std::collections::BTreeMap;

/// Where each node tag stands in the list of nodes.
pub(super) type Places = BTreeMap<u64, usize>;

/// The sheet of all triangles.
pub(super) fn sheet(sections: &Sections) -> Result<TriMesh, GmshError> {
    let places = places(sections)?;
    let used = of_dimension(&sections.blocks, 2)
        .map(|element| nodes_of(element, sections, &places))
        .collect::<Result<Vec<_>, _>>()?;

    // The vertex of each node.
    let mut vertices = vec![UNUSED; sections.nodes.len()];
    for &node in used.iter().flatten() {
        vertices[node] = 0;
    }
    let mut positions = Vec::new();
    for (vertex, node) in vertices.iter_mut().zip(&sections.nodes) {
        if *vertex != UNUSED {
            // The numbers overflow only for a mesh that is refused for its size below.
            *vertex = positions.len() as u32;
            positions.push(node.position);
        }
    }
    let corners = used
        .iter()
        .map(|nodes| nodes.map(|node| vertices[node]))
        .collect();

    let refused = |source: MeshError| GmshError::Mesh {
        place: place_of_fault(&source, sections, &vertices),
        source,
    };
    let mut mesh = TriMesh::new(positions, corners).map_err(refused)?;
    check_distinct(&mesh.positions).map_err(refused)?;
    let groups = groups(sections, 0..=3);
    mesh.vertex_groups = groups.of_vertices(&places, &vertices)?;
    mesh.triangle_groups = groups.of_cells(2);
    mesh.triangle_fields = fields::per_cell(sections, 2)?;
    Ok(mesh)
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

/// The place of the faulty vertex or triangle.
fn place_of_fault(error: &MeshError, sections: &Sections, vertices: &[u32]) -> Place {
    let at = match error.location() {
        Location::Vertex(index) => {
            let mut nodes = sections.nodes.iter().zip(vertices);
            nodes
                .find(|&(_, &vertex)| vertex == index)
                .map(|(node, _)| node.at)
        }
        Location::Cell(index) => of_dimension(&sections.blocks, 2)
            .nth(index as usize)
            .map(|element| element.at),
        Location::Mesh => None,
    };
    at.map_or(sections.end(), |at| sections.place(at))
}
