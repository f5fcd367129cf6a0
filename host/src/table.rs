//! Tables as CSV, for pandas, MATLAB, R, gnuplot and spreadsheets.
//!
//! The first line names the columns, and every other line has a number in each column. A name consists of Latin letters,
//! digits and underscores and begins with a letter, so that every one of these programs takes it as it is; its end is the
//! unit: `left_force_x_N`. What does not exist is `NaN`. A number has the digits that give the same `f64` again.

use crate::record::field::Cells;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt;
use std::fmt::Write as _;

/// The columns of a table: their names. Each name occurs once.
#[derive(Clone, Debug, Default)]
pub struct Columns {
    names: Vec<String>,
    taken: BTreeSet<String>,
}

impl Columns {
    /// Adds a column for the `quantity` of the device, body or support `of`.
    pub fn add(&mut self, of: &str, quantity: &str) {
        let name = match of {
            "" => quantity.to_owned(),
            _ => format!("{}_{quantity}", plain(of)),
        };
        let mut unique = name.clone();
        let mut number = 1;
        while !self.taken.insert(unique.clone()) {
            number += 1;
            unique = format!("{name}_{number}");
        }
        self.names.push(unique);
    }

    /// Adds a column for each component of a vector, such as `force_x_N`.
    pub fn vector(&mut self, of: &str, quantity: &str, unit: &str) {
        for axis in ["x", "y", "z"] {
            self.add(of, &format!("{quantity}_{axis}_{unit}"));
        }
    }

    /// Takes the names of columns for the device or body `of`.
    pub(crate) fn of<'a>(&'a mut self, of: &'a str) -> impl Cells + 'a {
        Names { columns: self, of }
    }

    /// The line with the names.
    pub fn header(&self) -> String {
        self.names.join(",") + "\n"
    }
}

/// Takes the names of columns.
struct Names<'a> {
    columns: &'a mut Columns,
    of: &'a str,
}

impl Cells for Names<'_> {
    fn number(&mut self, name: fmt::Arguments<'_>, _: f64) {
        self.columns.add(self.of, &name.to_string());
    }

    fn whole(&mut self, name: fmt::Arguments<'_>, _: u64) {
        self.number(name, 0.0);
    }
}

impl Cells for Line {
    fn number(&mut self, _: fmt::Arguments<'_>, value: f64) {
        Self::number(self, value);
    }

    fn whole(&mut self, _: fmt::Arguments<'_>, value: u64) {
        Self::whole(self, value);
    }
}

/// A field of text, in quotes if it must be (RFC 4180).
pub fn quoted(field: &str) -> Cow<'_, str> {
    if field.contains([',', '"', '\n', '\r']) {
        Cow::Owned(format!("\"{}\"", field.replace('"', "\"\"")))
    } else {
        Cow::Borrowed(field)
    }
}

/// A name with an underscore in place of every character that a column may not have.
fn plain(name: &str) -> String {
    let plain: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    match plain.chars().next() {
        Some(first) if first.is_ascii_alphabetic() => plain,
        _ => format!("n{plain}"),
    }
}

/// A line of a table in the making.
#[derive(Clone, Debug, Default)]
pub struct Line {
    text: String,
}

impl Line {
    /// Begins the line again.
    pub fn clear(&mut self) {
        self.text.clear();
    }

    fn next(&mut self) -> &mut String {
        if !self.text.is_empty() {
            self.text.push(',');
        }
        &mut self.text
    }

    /// Adds a number.
    pub fn number(&mut self, value: f64) {
        // The form of `Debug` has an exponent if a plain number would be long. Writing to a string cannot fail.
        let _ = write!(self.next(), "{value:?}");
    }

    /// Adds numbers.
    pub fn numbers(&mut self, values: impl IntoIterator<Item = f64>) {
        for value in values {
            self.number(value);
        }
    }

    /// Adds a whole number.
    pub fn whole(&mut self, value: u64) {
        let _ = write!(self.next(), "{value}");
    }

    /// Adds 1 for yes and 0 for no.
    pub fn flag(&mut self, value: bool) {
        self.whole(u64::from(value));
    }

    /// Adds a time of nanoseconds, in seconds.
    pub fn seconds(&mut self, ns: u64) {
        // A quotient is rounded once, so that 3 ms is 0.003.
        self.number(ns as f64 / 1e9);
    }

    /// The line, with its end.
    pub fn end(&mut self) -> &str {
        self.text.push('\n');
        &self.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_identifiers_and_occur_once() {
        let mut columns = Columns::default();
        columns.add("", "time_s");
        columns.add("left hand", "trust");
        columns.add("left_hand", "trust");
        columns.add("2", "trust");
        columns.vector("Hände", "force", "N");
        assert_eq!(
            columns.header(),
            "time_s,left_hand_trust,left_hand_trust_2,n2_trust,H_nde_force_x_N,H_nde_force_y_N,H_nde_force_z_N\n"
        );
    }

    #[test]
    fn text_is_one_field_whatever_it_contains() {
        assert_eq!(quoted("model age of sheet"), "model age of sheet");
        assert_eq!(quoted("left, \"my\" hand"), "\"left, \"\"my\"\" hand\"");
    }

    #[test]
    fn numbers_are_read_back_to_the_last_bit() {
        let mut line = Line::default();
        let values = [0.1 + 0.2, -1e-300, 5e-324, f64::MAX, -0.0, 1e6];
        line.numbers(values);
        line.seconds(3_000_000);
        line.flag(true);
        let text = line.end().trim_end();
        let read: Vec<f64> = text.split(',').map(|x| x.parse().expect(x)).collect();
        for (value, read) in values.iter().zip(&read) {
            assert_eq!(value.to_bits(), read.to_bits());
        }
        assert!(text.ends_with(",0.003,1"), "{text}");
        line.clear();
        line.number(f64::NAN);
        assert_eq!(line.end(), "NaN\n");
    }
}
