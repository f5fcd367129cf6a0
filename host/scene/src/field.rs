//! Fields of a scene as a user names them, such as `body[0].tear.toughness` or `device[left].model`.

use super::source::printable;
use core::fmt;
use core::str::FromStr;
use toml_edit::{DocumentMut, InlineTable, Item, TableLike, Value};

/// A field of a scene: names of tables and fields, separated by points. `[0]` is the first table of a list, and `[left]` the
/// table whose `name` is `left`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    text: String,
    steps: Vec<Step>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Step {
    /// A table or a field of a table.
    Key(String),
    /// A table of a list, by its place or by its name.
    Entry(String),
}

/// A text that names no field.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "found {found:?}, allowed: a field of the scene, such as body[0].material.young or device[left].model"
)]
pub struct FieldError {
    found: String,
}

impl FromStr for Field {
    type Err = FieldError;

    fn from_str(text: &str) -> Result<Self, FieldError> {
        let refused = || FieldError {
            found: printable(text),
        };
        let is_key = |key: &str| {
            let mut letters = key.chars();
            !key.is_empty() && letters.all(|c| c.is_ascii_alphanumeric() || "_-".contains(c))
        };
        let mut steps = Vec::new();
        let mut rest = text;
        loop {
            let end = rest.find(['.', '[']).unwrap_or(rest.len());
            let (key, after) = rest.split_at(end);
            if !is_key(key) {
                return Err(refused());
            }
            steps.push(Step::Key(key.to_owned()));
            rest = after;
            while let Some(inner) = rest.strip_prefix('[') {
                let (entry, after) = inner.split_once(']').ok_or_else(refused)?;
                if entry.is_empty() {
                    return Err(refused());
                }
                steps.push(Step::Entry(entry.to_owned()));
                rest = after;
            }
            match rest.strip_prefix('.') {
                Some(after) => rest = after,
                None if rest.is_empty() => break,
                None => return Err(refused()),
            }
        }
        Ok(Self {
            text: text.to_owned(),
            steps,
        })
    }
}

impl fmt::Display for Field {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(&self.text)
    }
}

/// The reason why a field cannot be written: a part of its name, what the scene has there, and the allowed parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NoPlace {
    pub(super) found: String,
    pub(super) allowed: String,
}

impl Field {
    /// The field `name` of the table `table` of the scene.
    pub(super) fn of(table: &str, name: &str) -> Self {
        Self {
            text: format!("{table}.{name}"),
            steps: [table, name].map(|key| Step::Key(key.to_owned())).into(),
        }
    }

    /// Writes `value` into the text of a scene. A field or a table that the text lacks is added; an entry of a list is not.
    pub(super) fn write(&self, document: &mut DocumentMut, value: Value) -> Result<(), NoPlace> {
        write(document.as_table_mut(), &self.steps, value)
    }
}

fn write(table: &mut dyn TableLike, steps: &[Step], value: Value) -> Result<(), NoPlace> {
    let [Step::Key(key), rest @ ..] = steps else {
        // A name begins with a key, and a key follows each entry.
        return Ok(());
    };
    match rest {
        [] => {
            set(table, key, value);
            Ok(())
        }
        [Step::Key(_), ..] => {
            let item = (table.entry(key)).or_insert_with(|| Item::Value(InlineTable::new().into()));
            let found = kind(item);
            match item.as_table_like_mut() {
                Some(inner) => write(inner, rest, value),
                None => Err(NoPlace {
                    found: format!("{found} as `{key}`"),
                    allowed: format!("a table; for an entry of a list, {key}[0]"),
                }),
            }
        }
        [Step::Entry(entry), rest @ ..] => {
            let mut none = Item::None;
            let item = table.get_mut(key).unwrap_or(&mut none);
            match item {
                Item::Value(Value::Array(list)) if rest.is_empty() => {
                    let count = list.len();
                    let place = entry.parse().ok().filter(|place| *place < count);
                    let place = place.ok_or_else(|| no_entry(key, entry, count, &[]))?;
                    list.replace(place, value);
                    Ok(())
                }
                _ => {
                    let mut each = tables(item);
                    let named = |table: &&mut dyn TableLike| {
                        table.get("name").and_then(Item::as_str).map(str::to_owned)
                    };
                    let names: Vec<_> = each.iter().map(named).collect();
                    let count = each.len();
                    let place = match entry.parse() {
                        Ok(place) => Some(place).filter(|place| *place < count),
                        Err(_) => names.iter().position(|name| name.as_ref() == Some(entry)),
                    };
                    let place = place.ok_or_else(|| no_entry(key, entry, count, &names))?;
                    write(&mut *each[place], rest, value)
                }
            }
        }
    }
}

fn no_entry(key: &str, entry: &str, count: usize, names: &[Option<String>]) -> NoPlace {
    let allowed = if count == 0 {
        format!("a list; the scene has no entry of `{key}`")
    } else {
        let places = (0..count).map(|place| place.to_string());
        let names = names.iter().flatten().map(|name| printable(name));
        places.chain(names).collect::<Vec<_>>().join(", ")
    };
    NoPlace {
        found: format!("{key}[{}]", printable(entry)),
        allowed,
    }
}

fn kind(item: &Item) -> &'static str {
    match item {
        Item::None => "nothing",
        Item::Table(_) => "a table",
        Item::ArrayOfTables(_) | Item::Value(Value::Array(_)) => "a list",
        Item::Value(_) => "a value",
    }
}

/// The tables of a list of tables, in either of the two forms of TOML.
pub(super) fn tables(list: &mut Item) -> Vec<&mut dyn TableLike> {
    match list {
        Item::ArrayOfTables(list) => list.iter_mut().map(|table| table as _).collect(),
        Item::Value(Value::Array(list)) => {
            let each = list.iter_mut().filter_map(Value::as_inline_table_mut);
            each.map(|table| table as _).collect()
        }
        _ => Vec::new(),
    }
}

/// Sets a field of a table.
pub(super) fn set(table: &mut dyn TableLike, name: &str, value: Value) {
    match table.get_mut(name).and_then(Item::as_value_mut) {
        Some(old) => {
            // The comment behind the value stays.
            let decor = old.decor().clone();
            *old = value;
            *old.decor_mut() = decor;
        }
        None => {
            table.insert(name, Item::Value(value));
        }
    }
}
