//! Ranges, checked while a scene is read: each function here is a field's `deserialize_with`.
//!
//! A number outside its range is refused as serde refuses a wrong type: with what was found and what is
//! allowed. `nan` and `inf`, which TOML can write, are refused everywhere. So is what serde would take in
//! silence: a list too long for its array, a list of values in place of a table.

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, Error, IntoDeserializer, Unexpected};
use serde::de::{MapAccess, SeqAccess, Visitor};
use std::{fmt, marker::PhantomData};

/// Longest run (s): a day.
const LONGEST: f64 = 86_400.0;
/// Most cells of a generated sheet, in each direction.
const MOST_CELLS: u64 = 10_000;

/// A finite number.
struct Finite(f64);

/// A number of cells.
struct Cells(u32);

/// Exactly `N` items.
struct List<T, const N: usize>([T; N]);

/// Reads a number that passes `test`.
struct Number {
    allowed: &'static str,
    test: fn(f64) -> bool,
}

/// Reads a whole number from `low` to `high`.
struct Whole {
    allowed: &'static str,
    low: u64,
    high: u64,
}

macro_rules! ranges {
    ($($(#[$doc:meta])* $name:ident: $allowed:literal, $test:expr;)*) => {$(
        $(#[$doc])*
        ///
        /// # Errors
        ///
        /// Says what was found and what is allowed.
        pub fn $name<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
            from.deserialize_f64(Number { allowed: $allowed, test: $test })
        }
    )*};
}

ranges! {
    /// Any finite number.
    finite: "a finite number", |_| true;
    /// Above zero.
    positive: "a number above 0", |v| v > 0.0;
    /// Zero or above.
    not_negative: "a number not below 0", |v| v >= 0.0;
    /// From zero to one.
    share: "a number from 0 to 1", |v| (0.0..=1.0).contains(&v);
    /// How long a run lasts (s).
    duration: "a number above 0 and up to 86400 (s)", |v| v > 0.0 && v <= LONGEST;
    /// Rate of the host (Hz).
    rate: "a number from 0.1 to 1000 (Hz)", |v| (0.1..=1000.0).contains(&v);
    /// Rate of the loop (Hz).
    tick_rate: "a number from 100 to 10000 (Hz)", |v| (100.0..=10_000.0).contains(&v);
    /// A relative tolerance.
    tolerance: "a number between 0 and 1", |v| v > 0.0 && v < 1.0;
    /// Poisson's ratio.
    poisson: "a number above -1 and below 0.5", |v| v > -1.0 && v < 0.5;
    /// Time from reading the hands to the model's arrival (s).
    latency: "a number from 0 to 1 (s)", |v| (0.0..=1.0).contains(&v);
    /// Frequency of a hand's motion (Hz).
    hand_frequency: "a number above 0 and up to 5 (Hz)", |v| v > 0.0 && v <= 5.0;
}

/// Above zero, for a field that may be left out.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn optional_positive<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    positive(from).map(Some)
}

/// Iterations of a solver.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn iterations<'de, D: Deserializer<'de>>(from: D) -> Result<usize, D::Error> {
    let allowed = "a whole number from 1 to 100000";
    from.deserialize_u64(Whole {
        allowed,
        low: 1,
        high: 100_000,
    })
    .map(|n| n as usize)
}

/// Cells of a sheet in x and y.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn cells<'de, D: Deserializer<'de>>(from: D) -> Result<[u32; 2], D::Error> {
    List::<Cells, 2>::deserialize(from).map(|list| list.0.map(|n| n.0))
}

/// Three finite numbers.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn finite3<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
    List::<Finite, 3>::deserialize(from).map(numbers)
}

/// Rows of four finite numbers.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn rows4<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<[f64; 4]>, D::Error> {
    let rows = Vec::<List<Finite, 4>>::deserialize(from)?;
    Ok(rows.into_iter().map(numbers).collect())
}

/// Two corners of a box, for a field that may be left out.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn optional_box<'de, D>(from: D) -> Result<Option<[[f64; 3]; 2]>, D::Error>
where
    D: Deserializer<'de>,
{
    List::<List<Finite, 3>, 2>::deserialize(from).map(|list| Some(list.0.map(numbers)))
}

/// A table of fields.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn table<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<T, D::Error> {
    from.deserialize_map(TableVisitor(PhantomData))
}

/// A table of fields, for a field that may be left out.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn optional_table<'de, D, T>(from: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    table(from).map(Some)
}

/// A list of tables.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn tables<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<Vec<T>, D::Error> {
    from.deserialize_seq(TablesVisitor(PhantomData))
}

/// One of several names.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub fn word<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<T, D::Error> {
    from.deserialize_str(WordVisitor(PhantomData))
}

fn numbers<const N: usize>(list: List<Finite, N>) -> [f64; N] {
    list.0.map(|number| number.0)
}

impl<'de> Deserialize<'de> for Finite {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        finite(from).map(Self)
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

struct TableVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for TableVisitor<T> {
    type Value = T;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, from: A) -> Result<T, A::Error> {
        T::deserialize(MapAccessDeserializer::new(from))
    }
}

struct TablesVisitor<T>(PhantomData<T>);

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

struct WordVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for WordVisitor<T> {
    type Value = T;

    fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str("a name in quotes")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<T, E> {
        T::deserialize(name.into_deserializer())
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
