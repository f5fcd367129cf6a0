//! The sections `$ElementData` of an MSH file, and their conversion to a value for each cell.

use super::elements::{Block, Element, of_dimension};
use super::input::Input;
use super::sections::Sections;
use crate::error::{FilePosition, GmshError, MAX_FIELDS};
use crate::lines::{Fields, Unexpected};
use crate::text::quoted;
use physics::mesh::Field;

/// A field of the file: one number for each of some elements.
pub(super) struct Data {
    name: String,
    position: FilePosition,
    /// In the file's order.
    values: Vec<Value>,
}

struct Value {
    element: u64,
    number: f64,
    at: usize,
}

const END: &str = "$EndElementData";
const INTEGERS: &str =
    "at least 3 integer tags: a time step, a number of components, a number of values";

/// An element that is not a cell of the mesh.
const NO_CELL: u32 = u32::MAX;

/// Reads a section after its first line; `None` if the section has no name, several components or values that
/// are not finite.
pub(super) fn read(input: &mut Input, before: &[Data]) -> Result<Option<Data>, GmshError> {
    let (head, name) = name(input)?;
    for _ in 0..count(input, "a number of real tags")?.1 {
        let mut fields = input.line("a real tag")?;
        fields.finite("a finite real tag")?;
        fields.end()?;
    }
    let (fields, integers) = count(input, INTEGERS)?;
    if integers < 3 {
        let expected = INTEGERS.to_owned();
        let found = integers.to_string();
        return Err(GmshError::Syntax {
            position: fields.position(),
            expected,
            found,
        });
    }
    count_signed(input)?;
    let (_, components) = count(input, "a number of components")?;
    let (claim, claimed) = count(input, "a number of values")?;
    for _ in 3..integers {
        count_signed(input)?;
    }
    let Some(name) = name.filter(|_| components == 1) else {
        input.skip("$ElementData")?;
        return Ok(None);
    };
    if before.len() == MAX_FIELDS {
        return Err(head
            .unexpected(&format!("at most {MAX_FIELDS} fields"))
            .into());
    }
    if let Some(earlier) = before.iter().find(|earlier| earlier.name == name) {
        return Err(GmshError::Repeated {
            position: head.position(),
            item: format!("the field {}", quoted(name)),
            first: earlier.position,
        });
    }
    // "1 1" and its line's end.
    let mut values: Vec<Value> = input.room(claimed, 4);
    while values.len() < claimed {
        let start = input.item(END)?;
        if start.rest() == END {
            return Err(GmshError::Syntax {
                position: claim.position(),
                expected: format!("{claimed} values, as this line says"),
                found: values.len().to_string(),
            });
        }
        values.push(Value {
            element: element(input)?,
            number: input.number("a value of an element")?,
            at: start.at,
        });
        input.end()?;
    }
    input.marker(END).map_err(|error| Unexpected {
        expected: format!("{END} after {claimed} values"),
        ..error
    })?;
    // Programs write other values if a value is not known.
    if values.iter().any(|value| !value.number.is_finite()) {
        return Ok(None);
    }
    values.shrink_to_fit();
    Ok(Some(Data {
        name: name.to_owned(),
        position: head.position(),
        values,
    }))
}

/// The tag of the element to which a value belongs. In a binary file it has four bytes, whatever the version.
fn element(input: &mut Input) -> Result<u64, GmshError> {
    const EXPECTED: &str = "an element's tag";
    Ok(if input.is_binary() {
        u64::from(input.int::<u32>(EXPECTED)?)
    } else {
        input.size(EXPECTED)?
    })
}

/// Reads the string tags. The first tag is the name of the field; returns its line and the name.
fn name<'a>(input: &mut Input<'a>) -> Result<(Fields<'a>, Option<&'a str>), GmshError> {
    let (mut head, tags) = count(input, "a number of string tags")?;
    let mut name = None;
    for number in 0..tags {
        let fields = input.line("a string tag")?;
        let inner = fields.rest().strip_prefix('"');
        let inner = inner.and_then(|inner| inner.strip_suffix('"'));
        let inner = inner.ok_or_else(|| fields.unexpected("a string tag in double quotes"))?;
        if number == 0 {
            head = fields;
            name = Some(inner).filter(|inner| !inner.trim().is_empty());
        }
    }
    Ok((head, name))
}

/// Reads a line with one number.
fn count<'a>(input: &mut Input<'a>, expected: &str) -> Result<(Fields<'a>, usize), GmshError> {
    let mut fields = input.line(expected)?;
    let line = fields;
    let number = fields.number(expected)?;
    fields.end()?;
    Ok((line, number))
}

/// Reads a line with a number that is not used.
fn count_signed(input: &mut Input) -> Result<(), GmshError> {
    let mut fields = input.line("an integer tag")?;
    fields.number::<i64>("an integer tag")?;
    Ok(fields.end()?)
}

/// The fields over the cells of dimension `dim`, in the order of the blocks. A field that names no such cell is
/// omitted.
pub(super) fn per_cell(sections: &Sections, dim: u8) -> Result<Vec<Field>, GmshError> {
    let mut fields = Vec::new();
    if sections.data.is_empty() {
        return Ok(fields);
    }
    let cells = tags(sections, dim)?;
    let count = of_dimension(&sections.blocks, dim).count();
    for data in &sections.data {
        let mut values = vec![f64::NAN; count];
        let mut named = 0;
        for &Value {
            element,
            number,
            at,
        } in &data.values
        {
            let index = cells.binary_search_by_key(&element, |&(tag, _)| tag);
            let cell = index.ok().and_then(|index| cells.get(index));
            let Some(&(_, cell)) = cell else {
                return Err(GmshError::Syntax {
                    position: sections.position(at),
                    expected: "the tag of an element in $Elements".to_owned(),
                    found: element.to_string(),
                });
            };
            let Some(slot) = values.get_mut(cell as usize) else {
                continue;
            };
            if !slot.is_nan() {
                let item = format!("element {element} in the field {}", quoted(&data.name));
                let mut lines = data.values.iter().filter(|value| value.element == element);
                let first = lines.next().map_or(at, |value| value.at);
                return Err(GmshError::Repeated {
                    position: sections.position(at),
                    item,
                    first: sections.position(first),
                });
            }
            *slot = number;
            named += 1;
        }
        if named == 0 {
            continue;
        }
        if let Some(missing) = values.iter().position(|value| value.is_nan()) {
            let mut cells = of_dimension(&sections.blocks, dim);
            let missing = cells.nth(missing).map_or(0, |element| element.tag);
            return Err(GmshError::Syntax {
                position: data.position,
                expected: format!("values for all {count} elements of the mesh"),
                found: format!("{named}, none for element {missing}"),
            });
        }
        fields.push(Field {
            name: data.name.clone(),
            values,
        });
    }
    Ok(fields)
}

/// The tags of all elements in ascending order, each with its cell. Tags may be sparse: they are looked up,
/// never used as indices.
fn tags(sections: &Sections, dim: u8) -> Result<Vec<(u64, u32)>, GmshError> {
    let mut next = 0;
    let mut tags: Vec<(u64, u32)> = Vec::new();
    for block in &sections.blocks {
        for Element { tag, .. } in block.elements() {
            let is_cell = block.kind.dim == dim;
            tags.push((tag, if is_cell { next } else { NO_CELL }));
            next += u32::from(is_cell);
        }
    }
    tags.sort_unstable();
    if !sections.repeated.is_empty() {
        let cell_of = |tag| {
            let index = tags.binary_search_by_key(&tag, |&(tag, _)| tag);
            index.map_or(NO_CELL, |index| tags[index].1)
        };
        let repeated = sections.repeated.iter();
        let mut repeated: Vec<(u64, u32)> = repeated
            .filter(|(later, first)| later != first)
            .map(|&(later, first)| (later, cell_of(first)))
            .collect();
        tags.append(&mut repeated);
        tags.sort_unstable();
    }
    let twice = tags.windows(2).find_map(|pair| match *pair {
        [(tag, _), (other, _)] => (tag == other).then_some(tag),
        _ => None,
    });
    let Some(tag) = twice else { return Ok(tags) };
    let all = sections.blocks.iter().flat_map(Block::elements);
    let mut lines = all
        .filter(|element| element.tag == tag)
        .map(|element| sections.position(element.at));
    let mut next = || lines.next().unwrap_or(sections.end());
    let (first, position) = (next(), next());
    let item = format!("element tag {tag}");
    Err(GmshError::Repeated {
        position,
        item,
        first,
    })
}
