//! Recorded motions of a hand, as CSV: a header `time,x,y,z`, then one row per sample (s, m from the start).
//!
//! Lines that begin with `#` and empty lines are skipped. Numbers need no quotes, so each line is split at its
//! commas. Crate `csv` is not used because its line numbers are wrong after comments.

use super::error::{SceneError, SourceLocation};
use super::source::quoted;

/// Names of the columns, in this order.
const COLUMNS: [&str; 4] = ["time", "x", "y", "z"];

/// Longest recording (s), as in `sim`.
const LONGEST: f64 = 3600.0;

/// One sample: time (s) and position (m).
pub type Sample = (f64, [f64; 3]);

/// Reads a recording: rows of time (s) and position (m). The times increase; the first time is arbitrary.
///
/// Messages call the file `name`. The memory is bounded by the number of lines.
///
/// # Errors
///
/// [`SceneError::Value`] with the line, the column, the text found and the allowed values.
pub fn parse(text: &str, name: &str) -> Result<Vec<Sample>, SceneError> {
    let mut samples = Vec::new();
    let mut has_header = false;
    for (index, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let at = Location {
            name,
            line: index + 1,
        };
        if has_header {
            samples.push(at.sample(line, samples.last())?);
        } else {
            at.header(line)?;
            has_header = true;
        }
    }
    let last = Location {
        name,
        line: text.lines().count().max(1),
    };
    let found = match samples.len() {
        1 => "1 row".to_owned(),
        rows => format!("{rows} rows"),
    };
    let [first, .., end] = &samples[..] else {
        return Err(last.wrong("", &found, "the header time,x,y,z and at least 2 rows"));
    };
    let lasts = end.0 - first.0;
    if lasts > LONGEST {
        let allowed = format!("a recording of at most {LONGEST:?} s");
        return Err(last.wrong("time", &format!("one of {lasts:?} s"), allowed));
    }
    Ok(samples)
}

/// A line of a recording.
#[derive(Clone, Copy)]
struct Location<'a> {
    name: &'a str,
    line: usize,
}

impl Location<'_> {
    fn wrong(self, column: &str, found: &str, allowed: impl Into<String>) -> SceneError {
        let location = SourceLocation {
            file: self.name.to_owned(),
            line: self.line,
            field: column.to_owned(),
        };
        SceneError::Value {
            location,
            found: quoted(found),
            allowed: allowed.into(),
        }
    }

    fn header(self, line: &str) -> Result<(), SceneError> {
        if line.split(',').map(str::trim).eq(COLUMNS) {
            return Ok(());
        }
        let allowed = "the header time,x,y,z, whose names are separated by commas";
        Err(self.wrong("", line, allowed))
    }

    fn sample(self, line: &str, last: Option<&Sample>) -> Result<Sample, SceneError> {
        let columns = line.split(',').count();
        if columns != COLUMNS.len() {
            let found = format!("{columns} columns");
            let allowed = "4 columns, time,x,y,z: numbers with decimal points, separated by commas";
            return Err(self.wrong("", &found, allowed));
        }
        let mut row = [0.0; COLUMNS.len()];
        for ((value, text), column) in row.iter_mut().zip(line.split(',')).zip(COLUMNS) {
            let number = text.trim().parse().ok().filter(|v: &f64| v.is_finite());
            *value = number.ok_or_else(|| self.wrong(column, text, "a finite number"))?;
        }
        let [time, x, y, z] = row;
        if let Some((last, _)) = last.filter(|(last, _)| time <= *last) {
            let allowed = format!("a time after {last:?}");
            return Err(self.wrong("time", &format!("{time:?}"), allowed));
        }
        Ok((time, [x, y, z]))
    }
}
