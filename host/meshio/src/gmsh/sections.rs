//! Reads the sections of an MSH 4.1 file, each checked by itself.

use super::elements::{self, Block};
use super::fields::{self, Data};
use super::{GmshError, MAX_GROUPS, MAX_TAGS};
use crate::file::Wanted;
use crate::lines::{Fields, Lines};
use crate::text::shortened;
use physics::Vec3;
use std::collections::BTreeMap;

/// The content of the file, before one section is compared with another.
#[derive(Default)]
pub(super) struct Sections {
    pub(super) names: Vec<PhysicalName>,
    /// The physical tags of each entity, by its dimension and tag.
    pub(super) entities: BTreeMap<(u8, i32), Entity>,
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    pub(super) data: Vec<Data>,
    /// The number of the file's last line.
    pub(super) last_line: usize,
}

/// The name of the physical group `tag` of entities of dimension `dim`.
pub(super) struct PhysicalName {
    pub(super) dim: u8,
    pub(super) tag: u32,
    pub(super) name: String,
    line: usize,
}

/// A point, curve, surface or volume of the model.
pub(super) struct Entity {
    /// Its physical groups, without their signs.
    pub(super) physical: Vec<u32>,
    line: usize,
}

/// A node, and the line of its coordinates.
pub(super) struct Node {
    pub(super) tag: u64,
    pub(super) position: Vec3,
    pub(super) line: usize,
}

/// A vector with room for the number of items that a file claims to hold, but for no more than the text can hold if
/// each item takes at least `least` bytes.
pub(super) fn room<T>(claimed: usize, text: &str, least: usize) -> Vec<T> {
    Vec::with_capacity(claimed.min(text.len() / least))
}

/// Reads all sections.
pub(super) fn read(text: &str, wanted: Wanted) -> Result<Sections, GmshError> {
    let mut lines = Lines::new(text);
    format(&mut lines)?;
    let mut sections = Sections::default();
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    seen.insert("$MeshFormat", 1);
    while let Some(fields) = lines.next() {
        let section = fields.rest();
        if !section.starts_with('$') || section.starts_with("$End") {
            return Err(fields
                .unexpected("the start of a section, such as $Nodes")
                .into());
        }
        let known = [
            "$MeshFormat",
            "$PhysicalNames",
            "$Entities",
            "$Nodes",
            "$Elements",
        ];
        if known.contains(&section)
            && let Some(first) = seen.insert(section, fields.line)
        {
            return Err(GmshError::Repeated {
                line: fields.line,
                item: section.to_owned(),
                first,
            });
        }
        match section {
            "$PhysicalNames" => sections.names = physical_names(&mut lines)?,
            "$Entities" => sections.entities = entities(&mut lines)?,
            "$Nodes" => sections.nodes = nodes(&mut lines, text)?,
            "$Elements" => sections.blocks = elements::read(&mut lines, text, wanted)?,
            "$ElementData" => sections
                .data
                .extend(fields::read(&mut lines, text, &sections.data)?),
            other => skip(&mut lines, other)?,
        }
    }
    sections.last_line = lines.last();
    for section in ["$Nodes", "$Elements"] {
        if !seen.contains_key(section) {
            return Err(GmshError::Missing {
                line: sections.last_line,
                section,
            });
        }
    }
    Ok(sections)
}

/// Checks only that the text begins as an MSH 4.1 ASCII file.
pub(super) fn check_format(text: &str) -> Result<(), GmshError> {
    version(&mut Lines::new(text))
}

fn format(lines: &mut Lines) -> Result<(), GmshError> {
    version(lines)?;
    Ok(lines.marker("$EndMeshFormat")?)
}

fn version(lines: &mut Lines) -> Result<(), GmshError> {
    lines.marker("$MeshFormat")?;
    let mut fields = lines.expect("the version, such as 4.1 0 8")?;
    let before = fields;
    let version = fields.word("the version, such as 4.1 0 8")?;
    let number: f64 = version
        .parse()
        .map_err(|_| before.unexpected("the version, such as 4.1 0 8"))?;
    let kind = match fields.number("0 for ASCII or 1 for binary")? {
        0_u8 => "ASCII",
        1 => "binary",
        _ => {
            return Err(before
                .unexpected("a version and 0 for ASCII or 1 for binary")
                .into());
        }
    };
    if number == 4.1 && kind == "ASCII" {
        return Ok(());
    }
    Err(GmshError::Version {
        line: fields.line,
        found: format!("{} {kind}", shortened(version)),
    })
}

pub(super) fn skip(lines: &mut Lines, section: &str) -> Result<(), GmshError> {
    let end = format!("$End{}", section.trim_start_matches('$'));
    while lines.expect(&end)?.rest() != end {}
    Ok(())
}

fn physical_names(lines: &mut Lines) -> Result<Vec<PhysicalName>, GmshError> {
    let mut fields = lines.expect("the number of physical names")?;
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
        let mut fields = lines.expect("a physical name: dimension, tag, \"name\"")?;
        let line = fields.line;
        let dim = dimension(&mut fields)?;
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
                line,
                item,
                first: earlier.line,
            });
        }
        names.push(PhysicalName {
            dim,
            tag,
            name: name.to_owned(),
            line,
        });
    }
    lines.marker("$EndPhysicalNames")?;
    Ok(names)
}

fn entities(lines: &mut Lines) -> Result<BTreeMap<(u8, i32), Entity>, GmshError> {
    const COUNT: &str = "a number of points, curves, surfaces, then volumes";
    let mut fields = lines.expect(COUNT)?;
    let mut counts = [0_usize; 4];
    for count in &mut counts {
        *count = fields.number(COUNT)?;
    }
    fields.end()?;
    let mut entities = BTreeMap::new();
    for (dim, count) in (0_u8..).zip(counts) {
        for _ in 0..count {
            let mut fields = lines.expect("a point, curve, surface or volume")?;
            let line = fields.line;
            let tag: i32 = fields.number("an entity's tag")?;
            // A point has three coordinates, other entities a bounding box. Neither is used.
            for _ in 0..if dim == 0 { 3 } else { 6 } {
                fields.word("an entity's coordinate")?;
            }
            let before = fields;
            let tags: usize = fields.number("a number of physical tags")?;
            if tags > MAX_TAGS {
                let expected = format!("at most {MAX_TAGS} physical tags of one entity");
                return Err(before.unexpected(&expected).into());
            }
            let mut physical = Vec::new();
            for _ in 0..tags {
                physical.push(fields.number::<i32>("a physical tag")?.unsigned_abs());
            }
            // The boundary of the entity follows, which is not used.
            if let Some(earlier) = entities.insert((dim, tag), Entity { physical, line }) {
                let item = format!("entity {tag} of dimension {dim}");
                return Err(GmshError::Repeated {
                    line,
                    item,
                    first: earlier.line,
                });
            }
        }
    }
    lines.marker("$EndEntities")?;
    Ok(entities)
}

fn nodes(lines: &mut Lines, text: &str) -> Result<Vec<Node>, GmshError> {
    let (head, blocks, count) = head(lines)?;
    // "1" and "0 0 0" with their lines' ends.
    let mut nodes: Vec<Node> = room(count, text, 8);
    for _ in 0..blocks {
        let mut fields = lines.expect("a block of nodes")?;
        let dim = dimension(&mut fields)?;
        fields.number::<i32>("an entity's tag")?;
        let parametric: u8 = fields.number("0, or 1 for parametric coordinates")?;
        let in_block: usize = fields.number("a number of nodes")?;
        fields.end()?;
        let first = nodes.len();
        for _ in 0..in_block {
            let mut fields = lines.expect("a node's tag")?;
            let line = fields.line;
            let tag = fields.number("a node's tag")?;
            fields.end()?;
            nodes.push(Node {
                tag,
                position: Vec3::zeros(),
                line,
            });
        }
        for node in nodes.iter_mut().skip(first) {
            let mut fields = lines.expect("a node's coordinates")?;
            node.line = fields.line;
            for coordinate in node.position.iter_mut() {
                *coordinate = fields.finite("a finite coordinate of a node")?;
            }
            for _ in 0..if parametric == 1 { dim } else { 0 } {
                fields.finite("a finite parametric coordinate")?;
            }
            fields.end()?;
        }
    }
    total(&head, count, nodes.len(), "nodes")?;
    lines.marker("$EndNodes")?;
    Ok(nodes)
}

/// The first line of `$Nodes` and `$Elements`: the line, the number of blocks and that of items.
pub(super) fn head<'a>(lines: &mut Lines<'a>) -> Result<(Fields<'a>, usize, usize), GmshError> {
    const EXPECTED: &str = "numbers of blocks and items, least and greatest tag";
    let mut fields = lines.expect(EXPECTED)?;
    let start = fields;
    let blocks = fields.number(EXPECTED)?;
    let items = fields.number(EXPECTED)?;
    fields.number::<u64>(EXPECTED)?;
    fields.number::<u64>(EXPECTED)?;
    fields.end()?;
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
    Err(GmshError::Syntax {
        line: head.line,
        expected: format!("{claimed} {items}, as this line says"),
        found: format!("{found} in the blocks below"),
    })
}

pub(super) fn dimension(fields: &mut Fields) -> Result<u8, GmshError> {
    let before = *fields;
    match fields.number("a dimension from 0 to 3")? {
        dim @ 0..=3 => Ok(dim),
        _ => Err(before.unexpected("a dimension from 0 to 3").into()),
    }
}
