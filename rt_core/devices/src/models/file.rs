//! The file of a device: TOML, read field by field so that each error names its line and its field.

use super::{DeviceModel, RotationModel};
use core::fmt;
use rt_core::Axes;
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The contents of a device's file.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceFile {
    /// The full name of the device, for display.
    pub name: String,
    /// The protocol of the device, by the name of its driver (`"woodenhaptics"`); `None` if the file names none.
    pub protocol: Option<String>,
    /// The numbers of the device.
    pub model: DeviceModel,
    /// The fields whose numbers are estimates. Fields of the rotation have names such as `rotation.inertia`.
    pub estimated: Vec<String>,
    /// The source of each number, by field.
    pub sources: BTreeMap<String, String>,
}

/// The error for a text that is not a device's file, with its position.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct ModelError {
    /// Line of the error, counted from 1.
    pub line: usize,
    /// The field, such as `rotation.inertia`; empty if the error concerns no field.
    pub field: String,
    /// The problem at that position.
    pub problem: ModelProblem,
}

/// A problem in a device's file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ModelProblem {
    /// The text is not TOML.
    #[error("not valid TOML: {0}")]
    Syntax(String),
    /// A required field is missing.
    #[error("missing field `{0}`")]
    Missing(&'static str),
    /// No field of this name exists.
    #[error("unknown field, allowed: {allowed}")]
    Unknown {
        /// The fields that exist at that position.
        allowed: String,
    },
    /// A value is of the wrong type or out of its range.
    #[error("found {found}, allowed: {allowed}")]
    Value {
        /// The value in the file.
        found: String,
        /// The allowed values.
        allowed: String,
    },
}

impl fmt::Display for ModelError {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "line {}: ", self.line)?;
        if !self.field.is_empty() {
            write!(to, "{}: ", self.field)?;
        }
        self.problem.fmt(to)
    }
}

/// Numbers of a device, in the order of the file.
const NUMBERS: [&str; 10] = [
    "rate",
    "mass",
    "damping",
    "friction",
    "position_step",
    "max_force",
    "workspace_radius",
    "output_delay",
    "driver_stiffness",
    "driver_damping",
];
/// The other fields.
const OTHERS: [&str; 6] = [
    "name",
    "protocol",
    "axes",
    "estimated",
    "rotation",
    "sources",
];
/// The axes of a device, by name.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Numbers of a device's rotation.
const TURNING: [&str; 7] = [
    "inertia",
    "damping",
    "friction",
    "step",
    "max_moment",
    "driver_stiffness",
    "driver_damping",
];

/// Longest piece of the file that an error quotes, in characters.
const QUOTED: usize = 60;

/// The name of a range in messages, and the test whether a number lies in it.
type Range = (&'static str, fn(f64) -> bool);

const RATE: Range = ("a whole number from 100 to 10000 (Hz)", |v| {
    (100.0..=10_000.0).contains(&v) && v.fract() == 0.0
});
const POSITIVE: Range = ("a number above 0 and up to 1e6", |v| v > 0.0 && v <= 1e6);
const NOT_NEGATIVE: Range = ("a number from 0 to 1e6", |v| (0.0..=1e6).contains(&v));
const DELAY: Range = ("a number from 0 to 0.1 (s)", |v| (0.0..=0.1).contains(&v));
const STEP: Range = ("a number above 0 and up to 0.1", |v| v > 0.0 && v <= 0.1);

impl DeviceFile {
    /// Reads a device's file.
    ///
    /// # Errors
    /// [`ModelError`], with the line and the field, if the text is not TOML; if a field is missing, unknown, of
    /// another type or out of range; or if `estimated` or `sources` contain a name that is no number of the device.
    pub fn parse(text: &str) -> Result<Self, ModelError> {
        let root = DeTable::parse(text).map_err(|error| ModelError {
            line: line_of(text, error.span().map_or(0, |span| span.start)),
            field: String::new(),
            problem: ModelProblem::Syntax(one_line(error.message())),
        })?;
        let root = Table {
            text,
            fields: root.get_ref(),
            path: "",
            line: 1,
        };
        root.only(NUMBERS.into_iter().chain(OTHERS))?;
        let axes = root.optional("axes", axes)?.flatten();
        let rotation = root.optional("rotation", |at| match axes {
            None => rotation(at),
            Some(_) => Err(at.refused("no rotation on a device that moves along one or two axes")),
        })?;
        let known: Vec<_> = Self::numbers(rotation.is_some()).collect();
        let estimated = root.optional("estimated", |at| names(at, &known))?;
        let sources = root.optional("sources", |at| sources(at, &known))?;
        let model = DeviceModel {
            mass: root.number("mass", POSITIVE)?,
            damping: root.number("damping", NOT_NEGATIVE)?,
            friction: root.number("friction", NOT_NEGATIVE)?,
            position_step: root.number("position_step", STEP)?,
            max_force: root.number("max_force", POSITIVE)?,
            workspace_radius: root.number("workspace_radius", POSITIVE)?,
            driver_stiffness: root.number("driver_stiffness", POSITIVE)?,
            driver_damping: root.number("driver_damping", NOT_NEGATIVE)?,
            rate_hz: root.number("rate", RATE)? as u32,
            output_delay: root
                .optional("output_delay", |at| at.number(DELAY))?
                .unwrap_or(0.0),
            axes,
            rotation,
        };
        Ok(Self {
            name: root.string("name")?,
            protocol: root.optional("protocol", line)?,
            model,
            estimated: estimated.unwrap_or_default(),
            sources: sources.unwrap_or_default(),
        })
    }

    /// The file of the built-in device of that name, among [`FILES`](super::FILES).
    pub fn named(name: &str) -> Option<Self> {
        let (_, text) = super::FILES.iter().find(|(known, _)| *known == name)?;
        // A test parses every file.
        Self::parse(text).ok()
    }

    /// The names of all fields of a device's file.
    pub fn fields() -> impl Iterator<Item = String> {
        let others = OTHERS.iter().map(|name| (*name).to_owned());
        Self::numbers(true).chain(others)
    }

    /// The names of the fields with numbers, including those of the rotation if `rotation` is true.
    pub fn numbers(rotation: bool) -> impl Iterator<Item = String> {
        let turning = TURNING.iter().filter(move |_| rotation);
        let plain = NUMBERS.iter().map(|name| (*name).to_owned());
        plain.chain(turning.map(|name| format!("rotation.{name}")))
    }
}

/// Reads a text of one line.
fn line(at: &Value<'_>) -> Result<String, ModelError> {
    at.string()
}

fn rotation(at: &Value<'_>) -> Result<RotationModel, ModelError> {
    let table = at.table("a table of the rotation's numbers")?;
    table.only(TURNING.into_iter())?;
    Ok(RotationModel {
        inertia: table.number("inertia", POSITIVE)?,
        damping: table.number("damping", NOT_NEGATIVE)?,
        friction: table.number("friction", NOT_NEGATIVE)?,
        step: table.number("step", STEP)?,
        max_moment: table.number("max_moment", POSITIVE)?,
        driver_stiffness: table.number("driver_stiffness", POSITIVE)?,
        driver_damping: table.number("driver_damping", NOT_NEGATIVE)?,
    })
}

/// Reads the axes along which a device moves; `None` for all three.
fn axes(at: &Value<'_>) -> Result<Option<Axes>, ModelError> {
    let refused = || at.refused("a list of one, two or three of \"x\", \"y\", \"z\", each once");
    let DeValue::Array(items) = at.content.get_ref() else {
        return Err(refused());
    };
    let mut free = [false; 3];
    for item in items {
        let DeValue::String(name) = item.get_ref() else {
            return Err(refused());
        };
        let axis = AXES.iter().position(|axis| *axis == name.as_ref());
        let axis = axis.ok_or_else(refused)?;
        if core::mem::replace(&mut free[axis], true) {
            return Err(refused());
        }
    }
    if items.is_empty() {
        return Err(refused());
    }
    Ok(Axes::new(free))
}

/// Reads a list of names of numbers.
fn names(at: &Value<'_>, known: &[String]) -> Result<Vec<String>, ModelError> {
    let allowed = || format!("a list of {}", known.join(", "));
    let DeValue::Array(items) = at.content.get_ref() else {
        return Err(at.refused(allowed()));
    };
    let mut names = Vec::new();
    for (index, item) in items.iter().enumerate() {
        let item = Value {
            path: format!("{}[{index}]", at.path),
            content: item,
            text: at.text,
        };
        match item.content.get_ref() {
            DeValue::String(name) if known.iter().any(|k| k == name) => {
                names.push(name.clone().into_owned());
            }
            _ => return Err(item.refused(known.join(", "))),
        }
    }
    Ok(names)
}

/// Reads a table from names of numbers to texts. The names of the rotation are in a table of their own.
fn sources(at: &Value<'_>, known: &[String]) -> Result<BTreeMap<String, String>, ModelError> {
    let mut found = BTreeMap::new();
    let table = at.table("a table from numbers to their sources")?;
    let top = known
        .iter()
        .map(|name| name.split('.').next().unwrap_or(name));
    table.only(top)?;
    for (key, value) in table.fields {
        let name: &str = key.get_ref();
        let at = table.at(name, value);
        if name == "rotation" {
            let turning = at.table("a table from the rotation's numbers to their sources")?;
            turning.only(TURNING.into_iter())?;
            for (key, value) in turning.fields {
                let source = turning.at(key.get_ref(), value).string()?;
                found.insert(format!("rotation.{}", key.get_ref()), source);
            }
        } else {
            found.insert(name.to_owned(), at.string()?);
        }
    }
    Ok(found)
}

/// A table of the file.
struct Table<'a> {
    text: &'a str,
    fields: &'a DeTable<'a>,
    path: &'a str,
    line: usize,
}

/// A value of the file.
struct Value<'a> {
    text: &'a str,
    content: &'a Spanned<DeValue<'a>>,
    path: String,
}

impl<'a> Table<'a> {
    fn path_of(&self, name: &str) -> String {
        if self.path.is_empty() {
            name.to_owned()
        } else {
            format!("{}.{name}", self.path)
        }
    }

    fn at(&self, name: &str, value: &'a Spanned<DeValue<'a>>) -> Value<'a> {
        Value {
            text: self.text,
            content: value,
            path: self.path_of(name),
        }
    }

    /// Refuses a field whose name is not in `known`.
    fn only<'k>(&self, known: impl Iterator<Item = &'k str>) -> Result<(), ModelError> {
        let mut known: Vec<_> = known.collect();
        known.dedup();
        for key in self.fields.keys() {
            let name: &str = key.get_ref();
            if !known.contains(&name) {
                return Err(ModelError {
                    line: line_of(self.text, key.span().start),
                    field: one_line(&self.path_of(name)),
                    problem: ModelProblem::Unknown {
                        allowed: known.join(", "),
                    },
                });
            }
        }
        Ok(())
    }

    fn optional<T>(
        &self,
        name: &str,
        read: impl FnOnce(&Value<'_>) -> Result<T, ModelError>,
    ) -> Result<Option<T>, ModelError> {
        self.fields
            .get(name)
            .map(|value| read(&self.at(name, value)))
            .transpose()
    }

    fn required(&self, name: &'static str) -> Result<Value<'a>, ModelError> {
        let value = self.fields.get(name).ok_or_else(|| ModelError {
            line: self.line,
            field: self.path.to_owned(),
            problem: ModelProblem::Missing(name),
        })?;
        Ok(self.at(name, value))
    }

    fn number(&self, name: &'static str, range: Range) -> Result<f64, ModelError> {
        self.required(name)?.number(range)
    }

    fn string(&self, name: &'static str) -> Result<String, ModelError> {
        self.required(name)?.string()
    }
}

impl Value<'_> {
    fn refused(&self, allowed: impl Into<String>) -> ModelError {
        let span = self.content.span();
        ModelError {
            line: line_of(self.text, span.start),
            field: self.path.clone(),
            problem: ModelProblem::Value {
                found: one_line(self.text.get(span).unwrap_or_default()),
                allowed: allowed.into(),
            },
        }
    }

    fn number(&self, (allowed, test): Range) -> Result<f64, ModelError> {
        let number = match self.content.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(whole) => i64::from_str_radix(whole.as_str(), whole.radix())
                .ok()
                .map(|whole| whole as f64),
            _ => None,
        };
        number
            .filter(|x: &f64| x.is_finite() && test(*x))
            .ok_or_else(|| self.refused(allowed))
    }

    /// Reads a text of one line that is not empty.
    fn string(&self) -> Result<String, ModelError> {
        match self.content.get_ref() {
            DeValue::String(text)
                if !text.trim().is_empty() && !text.chars().any(char::is_control) =>
            {
                Ok(text.clone().into_owned())
            }
            _ => Err(self.refused("a text of one line in quotes")),
        }
    }

    fn table<'s>(&'s self, allowed: &str) -> Result<Table<'s>, ModelError> {
        match self.content.get_ref() {
            DeValue::Table(fields) => Ok(Table {
                text: self.text,
                fields,
                path: &self.path,
                line: line_of(self.text, self.content.span().start),
            }),
            _ => Err(self.refused(allowed)),
        }
    }
}

/// The line that contains a byte, counted from 1.
fn line_of(text: &str, byte: usize) -> usize {
    let before = text.as_bytes().get(..byte).unwrap_or(text.as_bytes());
    before.split(|&b| b == b'\n').count()
}

/// A piece of the file for a message: its first line, without control characters, cut to `QUOTED` characters.
fn one_line(text: &str) -> String {
    let line = text.trim().lines().next().unwrap_or_default();
    let mut chars = line.chars().filter(|c| !c.is_control());
    let mut kept: String = chars.by_ref().take(QUOTED).collect();
    if chars.next().is_some() {
        kept.push_str("...");
    }
    kept
}

#[cfg(test)]
mod tests;
