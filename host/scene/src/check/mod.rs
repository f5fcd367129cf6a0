//! Checks of ranges while a scene is read: each function is the `deserialize_with` of a field.
//!
//! A number outside its range is refused as serde refuses a wrong type: with the value found and the allowed
//! values. `nan` and `inf`, which TOML can write, are always refused. Serde would silently accept a list that is
//! too long for its array, or a list of values in place of a table; both are refused here.

pub(crate) mod visitors;

use super::spec::ModelName;
use devices::Connection;
use serde::de::{Deserialize, Deserializer};
use std::marker::PhantomData;
use visitors::{
    AxesVisitor, Cells, Finite, List, ModelVisitor, Number, Positive, TableVisitor, TablesVisitor,
    Whole, WordVisitor,
};

/// Longest run (s): a day.
const LONGEST: f64 = 86_400.0;

macro_rules! ranges {
    ($($(#[$doc:meta])* $name:ident: $allowed:literal, $test:expr;)*) => {$(
        $(#[$doc])*
        ///
        /// # Errors
        ///
        /// Says what was found and what is allowed.
        pub(super) fn $name<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
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
    fraction: "a number from 0 to 1", |v| (0.0..=1.0).contains(&v);
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
    /// Latency: time from reading the hands to the arrival of the model (s).
    latency: "a number from 0 to 1 (s)", |v| (0.0..=1.0).contains(&v);
    /// Frequency of a hand's motion (Hz).
    hand_frequency: "a number above 0 and up to 5 (Hz)", |v| v > 0.0 && v <= 5.0;
    /// Fraction by which a hand's task varies.
    variation: "a number from 0 to 0.5", |v| (0.0..=0.5).contains(&v);
    /// Distance of a snap as a fraction of an edge.
    snapping: "a number from 0 to 0.5", |v| (0.0..=0.5).contains(&v);
}

macro_rules! optional {
    ($($(#[$doc:meta])* $name:ident: $of:path => $kind:ty;)*) => {$(
        $(#[$doc])*
        ///
        /// # Errors
        ///
        /// Says what was found and what is allowed.
        pub(super) fn $name<'de, D: Deserializer<'de>>(from: D) -> Result<Option<$kind>, D::Error> {
            $of(from).map(Some)
        }
    )*};
}

optional! {
    /// Above zero, for an optional field.
    optional_positive: positive => f64;
    /// Zero or above, for an optional field.
    optional_not_negative: not_negative => f64;
    /// Frequency of a hand's motion, for an optional field.
    optional_hand_frequency: hand_frequency => f64;
    /// Fraction by which a task varies, for an optional field.
    optional_variation: variation => f64;
    /// Poisson's ratio, for an optional field.
    optional_poisson: poisson => f64;
    /// Three numbers above zero, for an optional field.
    optional_positive3: positive3 => [f64; 3];
    /// Three finite numbers, for an optional field.
    optional_finite3: finite3 => [f64; 3];
    /// A button of a device, for an optional field.
    optional_button: button => usize;
    /// Room for vertices that tears add, for an optional field.
    optional_room: room => usize;
}

macro_rules! wholes {
    ($($(#[$doc:meta])* $name:ident: $allowed:literal, $low:literal, $high:literal;)*) => {$(
        $(#[$doc])*
        ///
        /// # Errors
        ///
        /// Says what was found and what is allowed.
        pub(super) fn $name<'de, D: Deserializer<'de>>(from: D) -> Result<usize, D::Error> {
            let whole = Whole { allowed: $allowed, low: $low, high: $high };
            from.deserialize_u64(whole).map(|n| n as usize)
        }
    )*};
}

wholes! {
    /// Iterations of a solver.
    iterations: "a whole number from 1 to 100000", 1, 100_000;
    /// Threads of the host.
    threads: "a whole number from 1 to 64", 1, 64;
    /// Frames of a result.
    frames: "a whole number from 1 to 10000", 1, 10_000;
    /// Order of the elements.
    order: "1 (linear) or 2 (quadratic)", 1, 2;
    /// Vertices that tears may add.
    room: "a whole number from 1 to 1000000", 1, 1_000_000;
    /// A button of a device.
    button: "a whole number from 1 to 16", 1, 16;
    /// Cuts of a row.
    cuts: "a whole number from 1 to 1000", 1, 1_000;
}

/// Cells of a sheet in x and y.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn cells<'de, D: Deserializer<'de>>(from: D) -> Result<[u32; 2], D::Error> {
    List::<Cells, 2>::deserialize(from).map(|list| list.0.map(|n| n.0))
}

/// Segments of a thread.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn segments<'de, D: Deserializer<'de>>(from: D) -> Result<u32, D::Error> {
    Cells::deserialize(from).map(|n| n.0)
}

/// Cells of a box along each axis.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn cells3<'de, D: Deserializer<'de>>(from: D) -> Result<[u32; 3], D::Error> {
    List::<Cells, 3>::deserialize(from).map(|list| list.0.map(|n| n.0))
}

/// A list of axes, at least one. The result tells for x, y and z whether the list contains the axis.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn axes<'de, D: Deserializer<'de>>(from: D) -> Result<[bool; 3], D::Error> {
    from.deserialize_seq(AxesVisitor)
}

/// Three numbers above zero.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn positive3<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
    List::<Positive, 3>::deserialize(from).map(|list| list.0.map(|number| number.0))
}

/// Three finite numbers.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn finite3<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
    List::<Finite, 3>::deserialize(from).map(numbers)
}

/// Two names.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn names2<'de, D: Deserializer<'de>>(from: D) -> Result<[String; 2], D::Error> {
    List::<String, 2>::deserialize(from).map(|list| list.0)
}

/// Rows of four finite numbers.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn rows4<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<[f64; 4]>, D::Error> {
    let rows = Vec::<List<Finite, 4>>::deserialize(from)?;
    Ok(rows.into_iter().map(numbers).collect())
}

/// Two corners of a box, for an optional field.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn optional_box<'de, D>(from: D) -> Result<Option<[[f64; 3]; 2]>, D::Error>
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
pub(super) fn table<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<T, D::Error> {
    from.deserialize_map(TableVisitor(PhantomData))
}

/// A table of fields, for an optional field.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn optional_table<'de, D, T>(from: D) -> Result<Option<T>, D::Error>
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
pub(super) fn tables<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Vec<T>, D::Error> {
    from.deserialize_seq(TablesVisitor(PhantomData))
}

/// One of several names.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn word<'de, D: Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<T, D::Error> {
    from.deserialize_str(WordVisitor(PhantomData))
}

/// The name of a built-in device, or of a device file.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn model_name<'de, D: Deserializer<'de>>(from: D) -> Result<ModelName, D::Error> {
    from.deserialize_str(ModelVisitor)
}

/// The connection to a device: a driver, or a driver and an address.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn connection<'de, D: Deserializer<'de>>(from: D) -> Result<Connection, D::Error> {
    String::deserialize(from).map(|text| Connection::parse(&text))
}

/// One of several names, for an optional field.
///
/// # Errors
///
/// Says what was found and what is allowed.
pub(super) fn optional_word<'de, D, T>(from: D) -> Result<Option<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    word(from).map(Some)
}

fn numbers<const N: usize>(list: List<Finite, N>) -> [f64; N] {
    list.0.map(|number| number.0)
}
