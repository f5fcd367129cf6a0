//! The section `$Elements` of an MSH file: the supported kinds of elements, and the errors for the others.

use super::input::Input;
use super::sections::{Sections, dimension, head, total};
use crate::error::{FilePosition, GmshError};

/// A kind of element.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Kind {
    /// Gmsh's number for it.
    pub(super) code: u32,
    pub(super) name: &'static str,
    pub(super) dim: u8,
    pub(super) nodes: usize,
    /// Zero for points, which go with either of the others.
    order: u8,
}

/// The supported kinds.
static KINDS: [Kind; 7] = [
    kind(15, "points", 0, 1, 0),
    kind(1, "2-node lines", 1, 2, 1),
    kind(2, "3-node triangles", 2, 3, 1),
    kind(8, "3-node lines of second order", 1, 3, 2),
    kind(9, "6-node triangles of second order", 2, 6, 2),
    kind(4, "4-node tetrahedra", 3, 4, 1),
    kind(11, "10-node tetrahedra of second order", 3, 10, 2),
];

const fn kind(code: u32, name: &'static str, dim: u8, nodes: usize, order: u8) -> Kind {
    Kind {
        code,
        name,
        dim,
        nodes,
        order,
    }
}

/// The elements of one entity.
pub(super) struct Block {
    pub(super) kind: &'static Kind,
    pub(super) entity: i32,
    /// Where the block starts.
    pub(super) at: usize,
    elements: Vec<(u64, usize)>,
    /// The tags of the nodes, one element after the other.
    nodes: Vec<u64>,
}

/// An element of a block.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    pub(super) tag: u64,
    /// Where the element stands.
    pub(super) at: usize,
    /// The tags of its nodes.
    pub(super) nodes: &'a [u64],
}

impl Block {
    /// A block without elements, with room for some.
    pub(super) fn with_room(kind: &'static Kind, entity: i32, at: usize, count: usize) -> Self {
        Self {
            kind,
            entity,
            at,
            elements: Vec::with_capacity(count),
            nodes: Vec::with_capacity(count * kind.nodes),
        }
    }

    pub(super) fn push(&mut self, tag: u64, at: usize, nodes: &[u64]) {
        self.elements.push((tag, at));
        self.nodes.extend_from_slice(nodes);
    }

    pub(super) fn len(&self) -> usize {
        self.elements.len()
    }

    pub(super) fn elements(&self) -> impl Iterator<Item = Element<'_>> {
        let nodes = self.nodes.chunks_exact(self.kind.nodes);
        self.elements
            .iter()
            .zip(nodes)
            .map(|(&(tag, at), nodes)| Element { tag, at, nodes })
    }
}

/// The elements of one dimension.
pub(super) fn of_dimension(blocks: &[Block], dim: u8) -> impl Iterator<Item = Element<'_>> {
    blocks
        .iter()
        .filter(move |block| block.kind.dim == dim)
        .flat_map(Block::elements)
}

/// The kind of elements that a file names by its number.
pub(super) fn kind_of(code: u32, position: FilePosition) -> Result<&'static Kind, GmshError> {
    let kind = KINDS.iter().find(|kind| kind.code == code);
    kind.ok_or_else(|| unsupported(position, code))
}

/// Reads the section.
pub(super) fn read(input: &mut Input) -> Result<Vec<Block>, GmshError> {
    let (head, block_count, count) = head(input)?;
    // "2 1 2 1" and "1 1 2 3" with their lines' ends: a block is left out if it has no elements.
    let mut blocks = input.room(block_count, 16);
    let mut total_found = 0;
    for _ in 0..block_count {
        let start = input.item("a block of elements")?;
        let dim = dimension(input)?;
        let entity = input.int("an entity's tag")?;
        let code: u32 = input.int("an element type")?;
        let in_block: usize = input.size("a number of elements")?;
        input.end()?;
        let kind = kind_of(code, start.position())?;
        if dim != kind.dim {
            let expected = format!("dimension {} for elements of type {code}", kind.dim);
            return Err(input.refuse(&start, &expected, dim));
        }
        // "1 1" with its line's end, then two bytes for each node but the first.
        let mut elements = input.room(in_block, 2 + 2 * kind.nodes);
        let mut nodes = input.room(in_block.saturating_mul(kind.nodes), 2);
        for _ in 0..in_block {
            let at = input.item("an element")?.at;
            elements.push((input.size("an element's tag")?, at));
            for _ in 0..kind.nodes {
                nodes.push(input.size("the tag of an element's node")?);
            }
            input.end()?;
        }
        total_found += elements.len();
        if elements.is_empty() {
            continue;
        }
        elements.shrink_to_fit();
        nodes.shrink_to_fit();
        blocks.push(Block {
            kind,
            entity,
            at: start.at,
            elements,
            nodes,
        });
    }
    total(&head, count, total_found, "elements")?;
    input.marker("$EndElements")?;
    Ok(blocks)
}

/// The highest dimension of the elements. With a tetrahedron all elements are of its order, or else of first order.
pub(super) fn highest_dimension(sections: &Sections) -> Result<u8, GmshError> {
    let blocks = &sections.blocks;
    let solid = blocks.iter().find(|block| block.kind.dim == 3);
    let order = solid.map_or(1, |block| block.kind.order);
    let mut others = blocks.iter();
    let Some(other) = others.find(|block| ![0, order].contains(&block.kind.order)) else {
        return Ok(blocks.iter().map(|block| block.kind.dim).max().unwrap_or(0));
    };
    Err(match solid {
        Some(solid) => GmshError::MixedOrder {
            position: sections.position(other.at),
            name: other.kind.name,
            first: sections.position(solid.at),
            first_name: solid.kind.name,
        },
        None => GmshError::Element {
            position: sections.position(other.at),
            code: other.kind.code,
            name: other.kind.name,
            expected: "3-node triangles, 2-node lines or points",
            advice: FIRST_ORDER,
        },
    })
}

const FIRST_ORDER: &str = "set Mesh.ElementOrder = 1 and mesh again";

/// The error for elements of other types. It names the types that users are likely to have, with advice.
fn unsupported(position: FilePosition, code: u32) -> GmshError {
    const TRIANGLES: &str = "set Mesh.RecombineAll = 0 and mesh again";
    const TETRAHEDRA: &str = "mesh again with tetrahedra: neither recombined nor in layers";
    const LOWER_ORDER: &str = "set Mesh.ElementOrder = 1 or 2 and mesh again";
    let (name, advice) = match code {
        3 => ("4-node quadrangles", TRIANGLES),
        5 => ("8-node hexahedra", TETRAHEDRA),
        6 => ("6-node prisms", TETRAHEDRA),
        7 => ("5-node pyramids", TETRAHEDRA),
        10 => ("9-node quadrangles of second order", FIRST_ORDER),
        16 => ("8-node quadrangles of second order", FIRST_ORDER),
        20 | 21 => ("triangles of third order", LOWER_ORDER),
        26 => ("4-node lines of third order", LOWER_ORDER),
        29 => ("20-node tetrahedra of third order", LOWER_ORDER),
        _ => (
            "another kind",
            "mesh again with triangles or tetrahedra of first or second order",
        ),
    };
    GmshError::Element {
        position,
        code,
        name,
        expected: "tetrahedra, triangles, lines or points, of first or second order",
        advice,
    }
}
