//! Tables of numbers over time, as CSV: a header with the names of the columns, then rows whose times increase.
//!
//! Lines that begin with `#` and empty lines are skipped. Numbers need no quotes, so each line is split at its
//! commas. Crate `csv` is not used because its line numbers are wrong after comments.

use super::error::{SceneError, SourceLocation};
use super::source::quoted;

/// Longest table (s), as in `sim`.
const LONGEST: f64 = 3600.0;

/// A table to be read: the names of its columns, of which the first is the time.
#[derive(Clone, Copy)]
pub(super) struct Table<'a, const N: usize> {
    /// What the table is, with its article.
    pub(super) what: &'a str,
    /// Names of the columns, in this order.
    pub(super) columns: [&'a str; N],
    /// The name of the file in messages.
    pub(super) name: &'a str,
}

/// A row, and its line in the file.
pub(super) type Row<const N: usize> = (usize, [f64; N]);

impl<const N: usize> Table<'_, N> {
    /// Reads the rows. The times increase; the first time is arbitrary. The memory is bounded by the number of lines.
    ///
    /// # Errors
    /// [`SceneError::Value`] with the line, the column, the text found and the allowed values.
    pub(super) fn rows(self, text: &str) -> Result<Vec<Row<N>>, SceneError> {
        let mut rows: Vec<Row<N>> = Vec::new();
        let mut has_header = false;
        for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
            if line.trim().is_empty() || line.trim_start().starts_with('#') {
                continue;
            }
            let number = index + 1;
            if has_header {
                let last = rows.last().map(|(_, row)| row[0]);
                rows.push((number, self.row(number, line, last)?));
            } else {
                self.header(number, line)?;
                has_header = true;
            }
        }
        let last = text.lines().count().max(1);
        let found = match rows.len() {
            1 => "1 row".to_owned(),
            rows => format!("{rows} rows"),
        };
        let [(_, first), .., (_, end)] = &rows[..] else {
            let allowed = format!("the header {} and at least 2 rows", self.header_text());
            return Err(self.wrong(last, "", &found, allowed));
        };
        let lasts = end[0] - first[0];
        if lasts > LONGEST {
            let allowed = format!("{} of at most {LONGEST:?} s", self.what);
            return Err(self.wrong(
                last,
                self.columns[0],
                &format!("one of {lasts:?} s"),
                allowed,
            ));
        }
        Ok(rows)
    }

    /// The error for a value of a line.
    pub(super) fn wrong(
        self,
        line: usize,
        column: &str,
        found: &str,
        allowed: impl Into<String>,
    ) -> SceneError {
        let location = SourceLocation {
            column: None,
            file: self.name.to_owned(),
            line,
            field: column.to_owned(),
        };
        SceneError::Value {
            location,
            found: quoted(found),
            allowed: allowed.into(),
        }
    }

    fn header_text(self) -> String {
        self.columns.join(",")
    }

    fn header(self, number: usize, line: &str) -> Result<(), SceneError> {
        if line.split(',').map(str::trim).eq(self.columns) {
            return Ok(());
        }
        let header = self.header_text();
        let allowed = format!("the header {header}, whose names are separated by commas");
        Err(self.wrong(number, "", line, allowed))
    }

    fn row(self, number: usize, line: &str, last: Option<f64>) -> Result<[f64; N], SceneError> {
        let columns = line.split(',').count();
        if columns != N {
            let found = format!("{columns} columns");
            let allowed = format!(
                "{N} columns, {}: numbers with decimal points, separated by commas",
                self.header_text()
            );
            return Err(self.wrong(number, "", &found, allowed));
        }
        let mut row = [0.0; N];
        for ((value, text), column) in row.iter_mut().zip(line.split(',')).zip(self.columns) {
            let parsed = text.trim().parse().ok().filter(|v: &f64| v.is_finite());
            *value = parsed.ok_or_else(|| self.wrong(number, column, text, "a finite number"))?;
        }
        let time = row[0];
        if let Some(last) = last.filter(|last| time <= *last) {
            let allowed = format!("a time after {last:?}");
            return Err(self.wrong(number, self.columns[0], &format!("{time:?}"), allowed));
        }
        Ok(row)
    }
}
