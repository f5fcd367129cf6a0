//! The sections of an MSH 2 file that differ from those of MSH 4.1: `$Nodes` and `$Elements`.
//!
//! Source: the Gmsh reference manual, "MSH file format version 2 (Legacy)". An element names its own physical group by
//! its first tag. Gmsh repeats an element of several groups once for each; here such elements are one.

use super::elements::{Block, Kind, kind_of};
use super::input::Input;
use super::sections::{Entity, Node, Sections};
use crate::error::GmshError;
use physics::Vec3;
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// The elements of a file in its order.
#[derive(Default)]
pub(super) struct Elements {
    elements: Vec<Element>,
    /// The tags of the nodes, one element after the other.
    nodes: Vec<u64>,
}

/// An element of the file.
struct Element {
    kind: &'static Kind,
    tag: u64,
    at: usize,
    /// Where its nodes begin in the list of all.
    first: usize,
    /// Its physical group without the sign; zero for no group.
    physical: u32,
}

/// Reads the section `$Nodes`.
pub(super) fn nodes(input: &mut Input) -> Result<Vec<Node>, GmshError> {
    let count = count(input, "the number of nodes")?;
    // "1 0 0 0" with its line's end.
    let mut nodes = input.room(count, 8);
    for _ in 0..count {
        let at = input.item("a node: tag, x, y, z")?.at;
        let tag = tag(input, "a node's tag")?;
        let mut position = Vec3::zeros();
        for coordinate in position.iter_mut() {
            *coordinate = input.real("a finite coordinate of a node")?;
        }
        input.end()?;
        nodes.push(Node { tag, position, at });
    }
    input.marker("$EndNodes")?;
    Ok(nodes)
}

/// Reads the section `$Elements`.
pub(super) fn elements(input: &mut Input) -> Result<Elements, GmshError> {
    const TYPE: &str = "an element type";
    const TAGS: &str = "a number of tags";
    let count = count(input, "the number of elements")?;
    // "1 15 0 1" with its line's end.
    let mut found = Elements {
        elements: input.room(count, 9),
        nodes: Vec::new(),
    };
    while found.elements.len() < count {
        let mut at = input.item("an element")?;
        let mut number = 0;
        if !input.is_binary() {
            number = tag(input, "an element's tag")?;
        }
        let kind = kind_of(input.int(TYPE)?, at.position())?;
        // In a binary file these numbers precede the elements of one kind.
        let before = input.mark();
        let mut in_block: usize = 1;
        if input.is_binary() {
            in_block = input.int("a number of elements")?;
        }
        if in_block == 0 || in_block > count - found.elements.len() {
            let expected = format!("from 1 to {} elements", count - found.elements.len());
            return Err(input.refuse(&before, &expected, in_block));
        }
        let tags: u32 = input.int(TAGS)?;
        for _ in 0..in_block {
            if input.is_binary() {
                at = input.item("an element")?;
                number = tag(input, "an element's tag")?;
            }
            let mut physical = 0;
            for place in 0..tags {
                let tag = input.int::<i32>("a tag of an element")?.unsigned_abs();
                if place == 0 {
                    physical = tag;
                }
            }
            found.elements.push(Element {
                kind,
                tag: number,
                at: at.at,
                first: found.nodes.len(),
                physical,
            });
            for _ in 0..kind.nodes {
                found
                    .nodes
                    .push(tag(input, "the tag of an element's node")?);
            }
            input.end()?;
        }
    }
    input.marker("$EndElements")?;
    Ok(found)
}

/// Reads the number of items of a section: a line of text, in a binary file too.
fn count(input: &mut Input, expected: &str) -> Result<usize, GmshError> {
    let mut line = input.line(expected)?;
    let count = line.number(expected)?;
    line.end()?;
    Ok(count)
}

/// The tag of a node or an element. In a binary file it has four bytes.
fn tag(input: &mut Input, expected: &str) -> Result<u64, GmshError> {
    Ok(if input.is_binary() {
        u64::from(input.int::<u32>(expected)?)
    } else {
        input.size(expected)?
    })
}

impl Elements {
    /// Makes blocks of the elements that follow each other and have one kind and the same groups. Each set of groups
    /// becomes an entity.
    pub(super) fn fill(self, sections: &mut Sections) {
        let named = |element: &Element| {
            let (dim, tag) = (element.kind.dim, element.physical);
            let mut names = sections.names.iter();
            names.any(|name| (name.dim, name.tag) == (dim, tag))
        };
        // Only the groups that have names count, of which there are few.
        let physical: Vec<u32> = self
            .elements
            .iter()
            .map(|element| if named(element) { element.physical } else { 0 })
            .collect();
        let twins = self.twins();
        let mut groups: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
        for &[first, later] in &twins {
            let all = groups.entry(first).or_insert_with(|| vec![physical[first]]);
            all.push(physical[later]);
        }
        let mut is_kept = vec![true; self.elements.len()];
        for &[first, later] in &twins {
            is_kept[later] = false;
            let [first, later] = [first, later].map(|place| self.elements[place].tag);
            sections.repeated.push((later, first));
        }
        for all in groups.values_mut() {
            all.sort_unstable();
            all.dedup();
        }

        let mut entities: BTreeMap<(u8, Vec<u32>), i32> = BTreeMap::new();
        let mut entity_of = |place: usize| {
            let dim = self.elements[place].kind.dim;
            let key = match groups.get(&place) {
                Some(all) => (dim, all.clone()),
                None => (dim, vec![physical[place]]),
            };
            let next = entities.len() as i32;
            *entities.entry(key).or_insert(next)
        };
        let kept = (0..self.elements.len()).filter(|&place| is_kept[place]);
        let kept: Vec<(usize, i32)> = kept.map(|place| (place, entity_of(place))).collect();
        let mut rest = &kept[..];
        while let Some(&(first, entity)) = rest.first() {
            let Element { kind, at, .. } = self.elements[first];
            let same = |&&(place, other): &&(usize, i32)| {
                other == entity && self.elements[place].kind == kind
            };
            let count = rest.iter().take_while(same).count();
            let mut block = Block::with_room(kind, entity, at, count);
            for &(place, _) in &rest[..count] {
                let element = &self.elements[place];
                block.push(element.tag, element.at, self.nodes_of(element));
            }
            sections.blocks.push(block);
            rest = &rest[count..];
        }
        for ((dim, physical), entity) in entities {
            let entity = (dim, entity);
            sections
                .entities
                .insert(entity, Entity::of_groups(physical));
        }
    }

    fn nodes_of(&self, element: &Element) -> &[u64] {
        let end = element.first + element.kind.nodes;
        self.nodes.get(element.first..end).unwrap_or_default()
    }

    /// The elements that repeat an earlier one for another physical group, each with the first of the same nodes.
    fn twins(&self) -> Vec<[usize; 2]> {
        let mut sorted = self.nodes.clone();
        for element in &self.elements {
            let end = element.first + element.kind.nodes;
            if let Some(nodes) = sorted.get_mut(element.first..end) {
                nodes.sort_unstable();
            }
        }
        let nodes = |element: &Element| {
            let end = element.first + element.kind.nodes;
            sorted.get(element.first..end).unwrap_or_default()
        };
        let same_nodes = |a: &Element, b: &Element| {
            let by_kind = a.kind.code.cmp(&b.kind.code);
            by_kind.then_with(|| nodes(a).cmp(nodes(b)))
        };
        let mut order: Vec<u32> = (0_u32..).take(self.elements.len()).collect();
        let at = |place: &u32| &self.elements[*place as usize];
        order.sort_unstable_by(|a, b| same_nodes(at(a), at(b)).then(a.cmp(b)));
        let mut twins = Vec::new();
        for alike in order.chunk_by(|a, b| same_nodes(at(a), at(b)) == Ordering::Equal) {
            let Some((first, later)) = alike.split_first() else {
                continue;
            };
            let mut groups = vec![at(first).physical];
            for other in later {
                let group = at(other).physical;
                // An element that is twice in one group is an error of the mesh, which its check finds.
                if !groups.contains(&group) && groups.len() < super::MAX_GROUPS {
                    groups.push(group);
                    twins.push([*first as usize, *other as usize]);
                }
            }
        }
        twins
    }
}
