//! Serde's visitors for the checks of [`super`].

use super::{ModelName, finite, positive, table};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, IntoDeserializer, Unexpected};
use serde::de::{MapAccess, SeqAccess, Visitor};
use std::{fmt, marker::PhantomData};

/// Largest number of cells of a generated mesh in each direction.
const MOST_CELLS: u64 = 10_000;

/// A finite number.
pub(super) struct Finite(pub(super) f64);

/// A number above zero.
pub(super) struct Positive(pub(super) f64);

/// A number of cells.
pub(super) struct Cells(pub(super) u32);

/// Exactly `N` items.
pub(super) struct List<T, const N: usize>(pub(super) [T; N]);

/// Reads a number that passes `test`.
pub(crate) struct Number {
    pub(crate) allowed: &'static str,
    pub(crate) test: fn(f64) -> bool,
}

/// Reads a whole number from `low` to `high`.
pub(crate) struct Whole {
    pub(crate) allowed: &'static str,
    pub(crate) low: u64,
    pub(crate) high: u64,
}

impl<'de> Deserialize<'de> for Finite {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        finite(from).map(Self)
    }
}

impl<'de> Deserialize<'de> for Positive {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        positive(from).map(Self)
    }
}

impl<'de> Deserialize<'de> for Cells {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let allowed = "a whole number from 1 to 10000";
        from.deserialize_u64(Whole {
            allowed,
            low: 1,
            high: MOST_CELLS,
        })
        .map(|n| Self(n as u32))
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for List<T, N> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_seq(ListVisitor(PhantomData))
    }
}

struct ListVisitor<T, const N: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for ListVisitor<T, N> {
    type Value = List<T, N>;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "a list of {N}")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<Self::Value, A::Error> {
        let mut items = Vec::with_capacity(N);
        while let Some(item) = from.next_element::<T>()? {
            items.push(item);
        }
        let found = items.len();
        items
            .try_into()
            .map(List)
            .map_err(|_| A::Error::invalid_length(found, &self))
    }
}

pub(super) struct TableVisitor<T>(pub(super) PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for TableVisitor<T> {
    type Value = T;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, from: A) -> Result<T, A::Error> {
        T::deserialize(MapAccessDeserializer::new(from))
    }
}

pub(super) struct TablesVisitor<T>(pub(super) PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for TablesVisitor<T> {
    type Value = Vec<T>;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a list of tables, each [[...]] or {...}")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<Vec<T>, A::Error> {
        let mut items = Vec::new();
        while let Some(Table(item)) = from.next_element()? {
            items.push(item);
        }
        Ok(items)
    }
}

/// A member of a list of tables.
struct Table<T>(T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Table<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        table(from).map(Self)
    }
}

pub(super) struct WordVisitor<T>(pub(super) PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for WordVisitor<T> {
    type Value = T;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a name in quotes")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<T, E> {
        T::deserialize(name.into_deserializer())
    }
}

/// Reads the name of a built-in device, or of a device file.
pub(super) struct ModelVisitor;

impl Visitor<'_> for ModelVisitor {
    type Value = ModelName;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, _) in sim::models::FILES {
            write!(to, "`{name}`, ")?;
        }
        to.write_str("or the name of a device's file, which ends in .toml")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<ModelName, E> {
        if let Some((known, _)) = sim::models::FILES.iter().find(|(known, _)| *known == name) {
            return Ok(ModelName::BuiltIn(known));
        }
        let printable = !name.chars().any(char::is_control);
        let file = name
            .strip_suffix(".toml")
            .is_some_and(|stem| !stem.trim().is_empty());
        if printable && file {
            Ok(ModelName::File(name.to_owned()))
        } else {
            Err(E::invalid_value(Unexpected::Str(name), &self))
        }
    }
}

impl Visitor<'_> for Number {
    type Value = f64;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(self.allowed)
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<f64, E> {
        if value.is_finite() && (self.test)(value) {
            Ok(value)
        } else {
            Err(E::invalid_value(Unexpected::Float(value), &self))
        }
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<f64, E> {
        self.visit_f64(value as f64)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<f64, E> {
        self.visit_f64(value as f64)
    }
}

impl Visitor<'_> for Whole {
    type Value = u64;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(self.allowed)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<u64, E> {
        if (self.low..=self.high).contains(&value) {
            Ok(value)
        } else {
            Err(E::invalid_value(Unexpected::Unsigned(value), &self))
        }
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<u64, E> {
        let found = Unexpected::Signed(value);
        let value = u64::try_from(value).map_err(|_| E::invalid_value(found, &self))?;
        self.visit_u64(value)
    }
}

/// Reads names of axes.
pub(super) struct AxesVisitor;

impl<'de> Visitor<'de> for AxesVisitor {
    type Value = [bool; 3];

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a list of axes, \"x\", \"y\" or \"z\", at least one")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut from: A) -> Result<[bool; 3], A::Error> {
        let mut axes = [false; 3];
        while let Some(Axis(axis)) = from.next_element()? {
            axes[axis] = true;
        }
        if axes == [false; 3] {
            return Err(A::Error::invalid_length(0, &self));
        }
        Ok(axes)
    }
}

/// One axis, as an index.
struct Axis(usize);

impl<'de> Deserialize<'de> for Axis {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_str(AxisVisitor)
    }
}

struct AxisVisitor;

impl Visitor<'_> for AxisVisitor {
    type Value = Axis;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("\"x\", \"y\" or \"z\"")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Axis, E> {
        ["x", "y", "z"]
            .iter()
            .position(|axis| *axis == name)
            .map(Axis)
            .ok_or_else(|| E::invalid_value(Unexpected::Str(name), &self))
    }
}
