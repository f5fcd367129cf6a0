//! From a file's sections to a mesh: node tags to indices, unused nodes dropped, groups filled.

use super::GmshError;
use super::sections::{Block, Element, Node, PhysicalName, Sections};
use crate::mesh::check::{Culprit, check_distinct};
use crate::mesh::{Group, MeshError, TriMesh};
use std::collections::BTreeMap;

/// A node that no triangle uses.
const UNUSED: u32 = u32::MAX;

pub(super) fn mesh(sections: &Sections) -> Result<TriMesh, GmshError> {
    let places = places(&sections.nodes)?;
    let used = triangles(&sections.blocks)
        .map(|element| nodes_of(element, &places))
        .collect::<Result<Vec<_>, _>>()?;

    // The vertex of each node.
    let mut vertices = vec![UNUSED; sections.nodes.len()];
    for &node in used.iter().flatten() {
        vertices[node] = 0;
    }
    let mut positions = Vec::new();
    for (vertex, node) in vertices.iter_mut().zip(&sections.nodes) {
        if *vertex != UNUSED {
            // Numbers run out only where the mesh is refused for its size below.
            *vertex = positions.len() as u32;
            positions.push(node.position);
        }
    }
    let corners = used
        .iter()
        .map(|nodes| nodes.map(|node| vertices[node]))
        .collect();

    let refused = |source: MeshError| GmshError::Mesh {
        line: line_at_fault(&source, sections, &vertices),
        source,
    };
    let mut mesh = TriMesh::new(positions, corners).map_err(refused)?;
    check_distinct(&mesh.positions).map_err(refused)?;
    mesh.vertex_groups = vertex_groups(sections, &places, &vertices, mesh.positions.len())?;
    mesh.triangle_groups = triangle_groups(sections);
    Ok(mesh)
}

/// Where each node tag stands in the list of nodes. Tags may be sparse: they are looked up, never used as
/// indices.
fn places(nodes: &[Node]) -> Result<BTreeMap<u64, usize>, GmshError> {
    let mut places = BTreeMap::new();
    for (place, node) in nodes.iter().enumerate() {
        if let Some(earlier) = places.insert(node.tag, place) {
            let what = format!("node tag {}", node.tag);
            let first = nodes.get(earlier).map_or(0, |node| node.line);
            return Err(GmshError::Repeated {
                line: node.line,
                what,
                first,
            });
        }
    }
    Ok(places)
}

fn triangles(blocks: &[Block]) -> impl Iterator<Item = &Element> {
    blocks
        .iter()
        .filter(|block| block.dim == 2)
        .flat_map(|block| &block.elements)
}

/// The places of an element's nodes.
fn nodes_of(element: &Element, places: &BTreeMap<u64, usize>) -> Result<[usize; 3], GmshError> {
    let mut found = [0; 3];
    for (place, tag) in found.iter_mut().zip(element.nodes) {
        *place = *places.get(&tag).ok_or_else(|| GmshError::Syntax {
            line: element.line,
            expected: "the tag of a node in $Nodes".to_owned(),
            found: tag.to_string(),
        })?;
    }
    Ok(found)
}

/// The line of the vertex or triangle that an error is about.
fn line_at_fault(error: &MeshError, sections: &Sections, vertices: &[u32]) -> usize {
    let line = match error.culprit() {
        Culprit::Vertex(index) => {
            let mut nodes = sections.nodes.iter().zip(vertices);
            nodes
                .find(|&(_, &vertex)| vertex == index)
                .map(|(node, _)| node.line)
        }
        Culprit::Triangle(index) => triangles(&sections.blocks)
            .nth(index as usize)
            .map(|element| element.line),
        Culprit::Mesh => None,
    };
    line.unwrap_or(sections.last_line)
}

/// Whether a block's elements belong to a physical group called `name`.
fn belongs(block: &Block, name: &str, sections: &Sections) -> bool {
    let Some(entity) = sections.entities.get(&(block.dim, block.entity)) else {
        return false;
    };
    let named = |p: &PhysicalName| p.dim == block.dim && p.name == name && entity.in_group(p.tag);
    sections.names.iter().any(named)
}

/// The names of physical groups, each once, in the file's order.
fn names(sections: &Sections) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for PhysicalName { name, .. } in &sections.names {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    names
}

fn vertex_groups(
    sections: &Sections,
    places: &BTreeMap<u64, usize>,
    vertices: &[u32],
    count: usize,
) -> Result<Vec<Group>, GmshError> {
    // Lines and points have to name existing nodes whether or not they are in a group.
    for element in sections.blocks.iter().flat_map(|block| &block.elements) {
        nodes_of(element, places)?;
    }
    let mut groups = Vec::new();
    for name in names(sections) {
        let mut member = vec![false; count];
        let blocks = sections
            .blocks
            .iter()
            .filter(|block| belongs(block, name, sections));
        for element in blocks.flat_map(|block| &block.elements) {
            for node in nodes_of(element, places)? {
                if let Some(member) = member.get_mut(vertices[node] as usize) {
                    *member = true;
                }
            }
        }
        push_group(&mut groups, name, &member);
    }
    Ok(groups)
}

fn triangle_groups(sections: &Sections) -> Vec<Group> {
    let mut groups = Vec::new();
    for name in names(sections) {
        let blocks = sections.blocks.iter().filter(|block| block.dim == 2);
        let member: Vec<bool> = blocks
            .flat_map(|block| {
                std::iter::repeat_n(belongs(block, name, sections), block.elements.len())
            })
            .collect();
        push_group(&mut groups, name, &member);
    }
    groups
}

/// Adds the group of those indices at which `member` is true, unless there are none.
fn push_group(groups: &mut Vec<Group>, name: &str, member: &[bool]) {
    let members: Vec<u32> = (0_u32..)
        .zip(member)
        .filter(|&(_, &is)| is)
        .map(|(index, _)| index)
        .collect();
    if !members.is_empty() {
        groups.push(Group {
            name: name.to_owned(),
            members,
        });
    }
}
