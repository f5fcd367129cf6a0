//! Reads the sections of an MSH file, each checked by itself.

use super::elements::{self, Block};
use super::fields::{self, Data};
use super::input::Input;
use super::{MAX_GROUPS, MAX_TAGS, version2};
use crate::error::{FilePosition, GmshError};
use crate::lines::{Fields, Lines};
use crate::text::shortened;
use physics::Vec3;
use std::collections::BTreeMap;

/// The content of the file, before one section is compared with another.
#[derive(Default)]
pub(super) struct Sections {
    pub(super) names: Vec<PhysicalName>,
    /// The physical tags of each entity, by its dimension and tag.
    pub(super) entities: Entities,
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    /// The tags of elements that repeat an earlier one for another of its physical tags, each with the tag of the
    /// earlier one.
    pub(super) repeated: Vec<(u64, u64)>,
    pub(super) data: Vec<Data>,
    /// The position of the file's end.
    last: usize,
    is_binary: bool,
}

/// The entities of the model by dimension and tag.
pub(super) type Entities = BTreeMap<(u8, i32), Entity>;

/// The name of the physical group `tag` of entities of dimension `dim`.
pub(super) struct PhysicalName {
    pub(super) dim: u8,
    pub(super) tag: u32,
    pub(super) name: String,
    position: FilePosition,
}

/// A point, curve, surface or volume of the model.
pub(super) struct Entity {
    /// Its physical groups, without their signs.
    pub(super) physical: Vec<u32>,
    at: usize,
}

impl Entity {
    /// The entity of some physical groups, in a file that does not describe its entities.
    pub(super) fn of_groups(physical: Vec<u32>) -> Self {
        Self { physical, at: 0 }
    }
}

/// A node, and where its coordinates stand.
pub(super) struct Node {
    pub(super) tag: u64,
    pub(super) position: Vec3,
    pub(super) at: usize,
}

impl Sections {
    /// A position of the file: a line of a text, or a byte of a binary file.
    pub(super) fn position(&self, at: usize) -> FilePosition {
        position(self.is_binary, at)
    }

    /// The position of the file's end.
    pub(super) fn end(&self) -> FilePosition {
        self.position(self.last)
    }
}

fn position(is_binary: bool, at: usize) -> FilePosition {
    if is_binary {
        FilePosition::Byte(at)
    } else {
        FilePosition::Line(at)
    }
}

/// Longest name of a section (bytes).
const LONGEST_NAME: usize = 64;

/// The version of the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Version {
    /// 2.0 to 2.2.
    Two,
    /// 4.1.
    Four,
}

/// Reads all sections.
pub(super) fn read(bytes: &[u8]) -> Result<Sections, GmshError> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let (version, mut input) = begin(bytes)?;
    let input = &mut input;
    let mut sections = Sections {
        is_binary: input.is_binary(),
        ..Sections::default()
    };
    let mut elements = version2::Elements::default();
    let mut seen: BTreeMap<&str, FilePosition> = BTreeMap::new();
    seen.insert("$MeshFormat", position(sections.is_binary, 1));
    while let Some(fields) = input.next_line()? {
        let section = fields.rest();
        let is_word =
            section.len() <= LONGEST_NAME && section.bytes().all(|b| b.is_ascii_graphic());
        if !is_word || !section.starts_with('$') || section.starts_with("$End") {
            return Err(fields
                .unexpected("the start of a section, such as $Nodes")
                .into());
        }
        let known = [
            "$MeshFormat",
            "$PhysicalNames",
            "$Entities",
            "$PartitionedEntities",
            "$Nodes",
            "$Elements",
        ];
        if known.contains(&section)
            && let Some(first) = seen.insert(section, fields.position())
        {
            return Err(GmshError::Repeated {
                position: fields.position(),
                item: section.to_owned(),
                first,
            });
        }
        match (section, version) {
            ("$PhysicalNames", _) => sections.names = physical_names(input)?,
            ("$Entities", Version::Four) => {
                // The entities of a partitioned file are in the place of those that they are parts of.
                let mut whole = entities(input, false)?;
                whole.append(&mut sections.entities);
                sections.entities = whole;
            }
            ("$PartitionedEntities", Version::Four) => {
                sections.entities.append(&mut entities(input, true)?);
            }
            ("$Nodes", Version::Four) => sections.nodes = nodes(input)?,
            ("$Nodes", Version::Two) => sections.nodes = version2::nodes(input)?,
            ("$ParametricNodes", Version::Two) => {
                return Err(fields
                    .unexpected("$Nodes: save with Mesh.SaveParametric = 0, or in version 4.1")
                    .into());
            }
            ("$Elements", Version::Four) => sections.blocks = elements::read(input)?,
            ("$Elements", Version::Two) => elements = version2::elements(input)?,
            ("$ElementData", _) => {
                let data = fields::read(input, &sections.data)?;
                sections.data.extend(data);
            }
            (other, _) => input.skip(other)?,
        }
    }
    sections.last = input.last();
    for section in ["$Nodes", "$Elements"] {
        if !seen.contains_key(section) {
            return Err(GmshError::Missing {
                position: sections.end(),
                section,
            });
        }
    }
    if version == Version::Two {
        elements.fill(&mut sections);
    }
    Ok(sections)
}

/// Reads the section `$MeshFormat`, with which a file begins.
fn begin(bytes: &[u8]) -> Result<(Version, Input<'_>), GmshError> {
    let (text, is_text) = match std::str::from_utf8(bytes) {
        Ok(text) => (text, true),
        Err(error) => {
            let text = bytes.get(..error.valid_up_to()).unwrap_or_default();
            (std::str::from_utf8(text).unwrap_or_default(), false)
        }
    };
    let (version, is_binary) = format(&mut Lines::new(text))?;
    if !is_binary && !is_text {
        return Err(GmshError::NotText {
            line: 1 + text.matches('\n').count(),
        });
    }
    let mut input = if is_binary {
        Input::binary(bytes)
    } else {
        Input::text(text)
    };
    for line in ["$MeshFormat", "the version, such as 4.1 0 8"] {
        input.line(line)?;
    }
    if is_binary {
        input.byte_order()?;
    }
    input.marker("$EndMeshFormat")?;
    Ok((version, input))
}

/// The version of the format, and whether the file is binary.
fn format(lines: &mut Lines) -> Result<(Version, bool), GmshError> {
    const EXPECTED: &str = "the version, such as 4.1 0 8";
    let start = lines.expect("$MeshFormat")?;
    if start.rest() == "$NOD" {
        return Err(GmshError::Version {
            line: start.at,
            found: "1 ASCII".to_owned(),
        });
    }
    if start.rest() != "$MeshFormat" {
        return Err(start.unexpected("$MeshFormat").into());
    }
    let mut fields = lines.expect(EXPECTED)?;
    let before = fields;
    let version = fields.word(EXPECTED)?;
    let number: f64 = version.parse().map_err(|_| before.unexpected(EXPECTED))?;
    let is_binary = match fields.number("0 for ASCII or 1 for binary")? {
        0_u8 => false,
        1 => true,
        _ => {
            return Err(before
                .unexpected("a version and 0 for ASCII or 1 for binary")
                .into());
        }
    };
    let known = match number {
        2.0..=2.2 => Version::Two,
        4.1 => Version::Four,
        _ => {
            let kind = if is_binary { "binary" } else { "ASCII" };
            return Err(GmshError::Version {
                line: before.at,
                found: format!("{} {kind}", shortened(version)),
            });
        }
    };
    if is_binary && fields.rest() != "8" {
        return Err(fields
            .unexpected("8, the bytes of a number of a binary file")
            .into());
    }
    Ok((known, is_binary))
}

fn physical_names(input: &mut Input) -> Result<Vec<PhysicalName>, GmshError> {
    let mut fields = input.line("the number of physical names")?;
    let head = fields;
    let count: usize = fields.number("the number of physical names")?;
    fields.end()?;
    if count > MAX_GROUPS {
        return Err(head
            .unexpected(&format!("at most {MAX_GROUPS} physical names"))
            .into());
    }
    let mut names: Vec<PhysicalName> = Vec::new();
    for _ in 0..count {
        let mut fields = input.line("a physical name: dimension, tag, \"name\"")?;
        let position = fields.position();
        let before = fields;
        let dim = fields.number("a dimension from 0 to 3")?;
        if dim > 3 {
            return Err(before.unexpected("a dimension from 0 to 3").into());
        }
        let tag = fields.number("a physical tag")?;
        let name = fields
            .rest()
            .strip_prefix('"')
            .and_then(|rest| rest.strip_suffix('"'));
        let Some(name) = name.filter(|name| !name.trim().is_empty()) else {
            return Err(fields.unexpected("a name in double quotes").into());
        };
        if let Some(earlier) = names
            .iter()
            .find(|earlier| (earlier.dim, earlier.tag) == (dim, tag))
        {
            let item = format!("physical tag {tag} of dimension {dim}");
            return Err(GmshError::Repeated {
                position,
                item,
                first: earlier.position,
            });
        }
        names.push(PhysicalName {
            dim,
            tag,
            name: name.to_owned(),
            position,
        });
    }
    input.marker("$EndPhysicalNames")?;
    Ok(names)
}

/// Reads `$Entities`, or `$PartitionedEntities` if `parts` is set.
fn entities(input: &mut Input, parts: bool) -> Result<Entities, GmshError> {
    const COUNT: &str = "a number of points, curves, surfaces, then volumes";
    const GHOSTS: &str = "a number of ghost entities";
    if parts {
        input.item("a number of partitions")?;
        input.size::<usize>("a number of partitions")?;
        input.end()?;
        input.item(GHOSTS)?;
        let ghosts: usize = input.size(GHOSTS)?;
        input.end()?;
        for _ in 0..ghosts {
            input.item("a ghost entity")?;
            for _ in 0..2 {
                input.int::<i32>("a ghost entity and its partition")?;
            }
            input.end()?;
        }
    }
    input.item(COUNT)?;
    let mut counts = [0_usize; 4];
    for count in &mut counts {
        *count = input.size(COUNT)?;
    }
    input.end()?;
    let mut entities = Entities::new();
    for (dim, count) in (0_u8..).zip(counts) {
        for _ in 0..count {
            let start = input.item("a point, curve, surface or volume")?;
            let tag: i32 = input.int("an entity's tag")?;
            if parts {
                for _ in 0..2 {
                    input.int::<i32>("the dimension and tag of an entity's parent")?;
                }
                let partitions: usize = input.size("a number of partitions")?;
                for _ in 0..partitions {
                    input.int::<i32>("a partition")?;
                }
            }
            // A point has three coordinates, other entities a bounding box. Neither is used.
            for _ in 0..if dim == 0 { 3 } else { 6 } {
                input.unused("an entity's coordinate")?;
            }
            let before = input.mark();
            let tags: usize = input.size("a number of physical tags")?;
            if tags > MAX_TAGS {
                let expected = format!("at most {MAX_TAGS} physical tags of one entity");
                return Err(input.refuse(&before, &expected, tags));
            }
            let mut physical = Vec::new();
            for _ in 0..tags {
                physical.push(input.int::<i32>("a physical tag")?.unsigned_abs());
            }
            // The boundary of the entity follows, which is not used.
            if dim > 0 {
                input.skip_ints("the boundary of an entity")?;
            }
            let at = start.at;
            if let Some(earlier) = entities.insert((dim, tag), Entity { physical, at }) {
                let item = format!("entity {tag} of dimension {dim}");
                return Err(GmshError::Repeated {
                    position: start.position(),
                    item,
                    first: position(input.is_binary(), earlier.at),
                });
            }
        }
    }
    input.marker(if parts {
        "$EndPartitionedEntities"
    } else {
        "$EndEntities"
    })?;
    Ok(entities)
}

fn nodes(input: &mut Input) -> Result<Vec<Node>, GmshError> {
    let (head, blocks, count) = head(input)?;
    // "1" and "0 0 0" with their lines' ends.
    let mut nodes: Vec<Node> = input.room(count, 8);
    for _ in 0..blocks {
        input.item("a block of nodes")?;
        let dim = dimension(input)?;
        input.int::<i32>("an entity's tag")?;
        let parametric: u8 = input.int("0, or 1 for parametric coordinates")?;
        let in_block: usize = input.size("a number of nodes")?;
        input.end()?;
        let first = nodes.len();
        for _ in 0..in_block {
            let at = input.item("a node's tag")?.at;
            let tag = input.size("a node's tag")?;
            input.end()?;
            nodes.push(Node {
                tag,
                position: Vec3::zeros(),
                at,
            });
        }
        for node in nodes.iter_mut().skip(first) {
            node.at = input.item("a node's coordinates")?.at;
            for coordinate in node.position.iter_mut() {
                *coordinate = input.real("a finite coordinate of a node")?;
            }
            for _ in 0..if parametric == 1 { dim } else { 0 } {
                input.real("a finite parametric coordinate")?;
            }
            input.end()?;
        }
    }
    total(&head, count, nodes.len(), "nodes")?;
    input.marker("$EndNodes")?;
    Ok(nodes)
}

/// The first item of `$Nodes` and `$Elements`: the position, the number of blocks and that of items.
pub(super) fn head<'a>(input: &mut Input<'a>) -> Result<(Fields<'a>, usize, usize), GmshError> {
    const EXPECTED: &str = "numbers of blocks and items, least and greatest tag";
    let start = input.item(EXPECTED)?;
    let blocks = input.size(EXPECTED)?;
    let items = input.size(EXPECTED)?;
    input.size::<u64>(EXPECTED)?;
    input.size::<u64>(EXPECTED)?;
    input.end()?;
    Ok((start, blocks, items))
}

pub(super) fn total(
    head: &Fields,
    claimed: usize,
    found: usize,
    items: &str,
) -> Result<(), GmshError> {
    if claimed == found {
        return Ok(());
    }
    let position = head.position();
    let this = match position {
        FilePosition::Line(_) => "this line",
        FilePosition::Byte(_) | FilePosition::Item { .. } => "the number here",
    };
    Err(GmshError::Syntax {
        position,
        expected: format!("{claimed} {items}, as {this} says"),
        found: format!("{found} in the blocks below"),
    })
}

pub(super) fn dimension(input: &mut Input) -> Result<u8, GmshError> {
    const EXPECTED: &str = "a dimension from 0 to 3";
    let before = input.mark();
    match input.int(EXPECTED)? {
        dim @ 0..=3 => Ok(dim),
        other => Err(input.refuse(&before, EXPECTED, other)),
    }
}
