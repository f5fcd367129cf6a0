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
    let groups = groups(sections);
    mesh.vertex_groups = vertex_groups(sections, &groups, &places, &vertices)?;
    mesh.triangle_groups = triangle_groups(sections, &groups);
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

/// The blocks of one group, as indices into the file's blocks.
struct Members<'a> {
    name: &'a str,
    blocks: Vec<usize>,
}

/// The groups by name, in the file's order, each with its blocks. Found in one pass over the blocks, so
/// that many small blocks in many groups cost no more time than they take room in the file.
fn groups(sections: &Sections) -> Vec<Members<'_>> {
    let mut groups: Vec<Members> = Vec::new();
    let mut by_tag: BTreeMap<(u8, u32), usize> = BTreeMap::new();
    for PhysicalName { dim, tag, name, .. } in &sections.names {
        let known = groups.iter().position(|group| group.name == name);
        let index = known.unwrap_or(groups.len());
        if known.is_none() {
            let blocks = Vec::new();
            groups.push(Members { name, blocks });
        }
        by_tag.insert((*dim, *tag), index);
    }
    for (number, block) in sections.blocks.iter().enumerate() {
        let entity = sections.entities.get(&(block.dim, block.entity));
        for tag in entity.into_iter().flat_map(|entity| &entity.physical) {
            let index = by_tag.get(&(block.dim, *tag));
            let group = index.and_then(|&index| groups.get_mut(index));
            if let Some(group) = group.filter(|group| group.blocks.last() != Some(&number)) {
                group.blocks.push(number);
            }
        }
    }
    groups
}

fn vertex_groups(
    sections: &Sections,
    groups: &[Members],
    places: &BTreeMap<u64, usize>,
    vertices: &[u32],
) -> Result<Vec<Group>, GmshError> {
    // Lines and points have to name existing nodes whether or not they are in a group.
    for element in sections.blocks.iter().flat_map(|block| &block.elements) {
        nodes_of(element, places)?;
    }
    let mut found = Vec::new();
    for group in groups {
        let mut members = Vec::new();
        let blocks = group.blocks.iter().filter_map(|&k| sections.blocks.get(k));
        for element in blocks.flat_map(|block| &block.elements) {
            for node in nodes_of(element, places)? {
                members.extend(vertices.get(node).filter(|&&vertex| vertex != UNUSED));
            }
        }
        push_group(&mut found, group.name, members);
    }
    Ok(found)
}

fn triangle_groups(sections: &Sections, groups: &[Members]) -> Vec<Group> {
    // Where the triangles of each block start.
    let starts: Vec<u32> = sections
        .blocks
        .iter()
        .scan(0, |next, block| {
            let start = *next;
            *next += if block.dim == 2 {
                block.elements.len() as u32
            } else {
                0
            };
            Some(start)
        })
        .collect();
    let mut found = Vec::new();
    for group in groups {
        let mut members = Vec::new();
        for &number in &group.blocks {
            if let (Some(block), Some(&start)) = (sections.blocks.get(number), starts.get(number))
                && block.dim == 2
            {
                members.extend((start..).take(block.elements.len()));
            }
        }
        push_group(&mut found, group.name, members);
    }
    found
}

/// Adds the group of these members, unless there are none.
fn push_group(groups: &mut Vec<Group>, name: &str, mut members: Vec<u32>) {
    members.sort_unstable();
    members.dedup();
    members.shrink_to_fit();
    if !members.is_empty() {
        groups.push(Group {
            name: name.to_owned(),
            members,
        });
    }
}
