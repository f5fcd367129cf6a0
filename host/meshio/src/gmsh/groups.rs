//! Physical groups: converts names and tags of entities to sets of vertices and of cells.

use super::assemble::{Places, place_of};
use super::elements::Block;
use super::sections::{PhysicalName, Sections};
use crate::error::GmshError;
use crate::soup::UNUSED;
use physics::mesh::Group;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// The groups of a file over entities of some dimensions.
pub(super) struct Groups<'a> {
    sections: &'a Sections,
    groups: Vec<Members<'a>>,
}

/// The blocks of one group, as indices into the file's blocks.
struct Members<'a> {
    name: &'a str,
    blocks: Vec<usize>,
}

/// The groups by name, in the order of the file, each with its blocks. One pass over the blocks finds all groups, so
/// that the time is proportional to the size of the file, even for many small blocks in many groups.
pub(super) fn groups(sections: &Sections, dims: RangeInclusive<u8>) -> Groups<'_> {
    let mut groups: Vec<Members> = Vec::new();
    let mut by_tag: BTreeMap<(u8, u32), usize> = BTreeMap::new();
    for PhysicalName { dim, tag, name, .. } in &sections.names {
        if !dims.contains(dim) {
            continue;
        }
        let known = groups.iter().position(|group| group.name == name);
        let index = known.unwrap_or(groups.len());
        if known.is_none() {
            let blocks = Vec::new();
            groups.push(Members { name, blocks });
        }
        by_tag.insert((*dim, *tag), index);
    }
    for (number, block) in sections.blocks.iter().enumerate() {
        let entity = sections.entities.get(&(block.kind.dim, block.entity));
        for tag in entity.into_iter().flat_map(|entity| &entity.physical) {
            let index = by_tag.get(&(block.kind.dim, *tag));
            let group = index.and_then(|&index| groups.get_mut(index));
            if let Some(group) = group.filter(|group| group.blocks.last() != Some(&number)) {
                group.blocks.push(number);
            }
        }
    }
    Groups { sections, groups }
}

impl Groups<'_> {
    /// The vertices of each group, where `vertices` gives the vertex of each node.
    pub(super) fn of_vertices(
        &self,
        places: &Places,
        vertices: &[u32],
    ) -> Result<Vec<Group>, GmshError> {
        let blocks = &self.sections.blocks;
        // Every element has to name existing nodes, whether or not the element is in a group.
        for element in blocks.iter().flat_map(Block::elements) {
            for &tag in element.nodes {
                place_of(tag, element, self.sections, places)?;
            }
        }
        let mut found = Vec::new();
        for group in &self.groups {
            let mut members = Vec::new();
            let blocks = group.blocks.iter().filter_map(|&k| blocks.get(k));
            for element in blocks.flat_map(Block::elements) {
                for &tag in element.nodes {
                    let vertex = vertices.get(place_of(tag, element, self.sections, places)?);
                    members.extend(vertex.filter(|&&vertex| vertex != UNUSED));
                }
            }
            push_group(&mut found, group.name, members);
        }
        Ok(found)
    }

    /// The cells of each group. The cells are the elements of dimension `dim`, in the order of the file.
    pub(super) fn of_cells(&self, dim: u8) -> Vec<Group> {
        let blocks = &self.sections.blocks;
        // The number of the first cell of each block.
        let starts: Vec<u32> = blocks
            .iter()
            .scan(0, |next, block| {
                let start = *next;
                *next += if block.kind.dim == dim {
                    block.len() as u32
                } else {
                    0
                };
                Some(start)
            })
            .collect();
        let mut found = Vec::new();
        for group in &self.groups {
            let mut members = Vec::new();
            for &number in &group.blocks {
                if let (Some(block), Some(&start)) = (blocks.get(number), starts.get(number))
                    && block.kind.dim == dim
                {
                    members.extend((start..).take(block.len()));
                }
            }
            push_group(&mut found, group.name, members);
        }
        found
    }
}

/// Adds the group of these members, unless the group is empty.
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
