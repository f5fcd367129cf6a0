//! Recorded motions of a hand: a table `time,x,y,z` with one row for each sample (s, m from the start).

use super::csv::Table;
use super::error::SceneError;

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
    let table = Table {
        what: "a recording",
        columns: ["time", "x", "y", "z"],
        name,
    };
    let rows = table.rows(text)?.into_iter();
    Ok(rows.map(|(_, [time, x, y, z])| (time, [x, y, z])).collect())
}
