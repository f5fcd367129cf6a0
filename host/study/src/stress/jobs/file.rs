//! The file of a study's results: its contents, and the lines that are appended.

use super::{Cell, Header, JobError};
use host::scene::printable;
use serde::de::DeserializeOwned;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Most characters of a value in a message.
const MOST: usize = 80;

/// A file to which results are appended. No other run can open the file at the same time.
pub(super) struct Lines {
    path: PathBuf,
    file: File,
    /// Bytes of the complete lines in the file.
    length: u64,
    /// The lines that could not be written yet.
    waiting: String,
}

/// Opens the file of the study, puts the results that it contains into `done`, and prepares it for more: a new file
/// gets the header, a file of fewer cells gets the header of more, and an incomplete last line is removed.
pub(super) fn open<R: DeserializeOwned>(
    path: &Path,
    header: &Header,
    done: &mut BTreeMap<u64, R>,
) -> Result<Lines, JobError> {
    let failed = |source: io::Error| JobError::File {
        path: path.to_owned(),
        source,
    };
    let mut options = OpenOptions::new();
    options.read(true).append(true).create(true);
    let mut file = options.open(path).map_err(failed)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            return Err(JobError::Busy {
                path: path.to_owned(),
            });
        }
        // Some network file systems have no locks.
        Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {}
        Err(TryLockError::Error(error)) => return Err(failed(error)),
    }
    let mut text = Vec::new();
    file.read_to_end(&mut text).map_err(failed)?;
    let Parsed { sound, cells } = parse(path, &text, header, done)?;
    if sound < text.len() {
        file.set_len(sound as u64).map_err(failed)?;
    }
    let mut lines = Lines {
        path: path.to_owned(),
        file,
        length: sound as u64,
        waiting: String::new(),
    };
    if sound > 0 && text[sound - 1] != b'\n' {
        lines.append("")?;
    }
    if cells.is_none_or(|cells| cells < header.cells) {
        lines.append(&line_of(header))?;
    }
    Ok(lines)
}

impl Lines {
    /// Appends a complete line, after those that could not be written before. After a failure all of them wait.
    pub(super) fn append(&mut self, line: &str) -> Result<(), JobError> {
        self.waiting.push_str(line);
        self.waiting.push('\n');
        let written = self.file.write_all(self.waiting.as_bytes());
        if let Err(source) = written {
            // The file keeps whole lines only. If the system refuses this, too, the next run removes the incomplete line.
            let _ = self.file.set_len(self.length);
            return Err(JobError::File {
                path: self.path.clone(),
                source,
            });
        }
        self.length += self.waiting.len() as u64;
        self.waiting.clear();
        Ok(())
    }
}

/// The content of a file.
pub(super) fn bytes(path: &Path) -> Result<Vec<u8>, JobError> {
    let mut bytes = Vec::new();
    let read = host::input::open(path).and_then(|mut file| file.read_to_end(&mut bytes));
    read.map_err(|source| JobError::File {
        path: path.to_owned(),
        source,
    })?;
    Ok(bytes)
}

/// The first header in `text`, with the largest number of cells of all headers of its study.
pub(super) fn header(path: &Path, text: &[u8]) -> Result<Header, JobError> {
    let of = |line: &[u8]| serde_json::from_slice::<Header>(line.trim_ascii());
    let mut lines = text.split_inclusive(|byte| *byte == b'\n');
    let first = of(lines.next().unwrap_or_default()).map_err(|error| JobError::Line {
        path: path.to_owned(),
        line: 1,
        reason: format!("not a header of a study's results: {error}"),
    })?;
    let others = lines.filter_map(|line| of(line).ok());
    let most = others.filter(|other| other.is_of_study(&first));
    let cells = most.fold(first.cells, |most, other| most.max(other.cells));
    Ok(Header { cells, ..first })
}

/// What a file contains besides its results.
pub(super) struct Parsed {
    /// Number of sound bytes: all, except an incomplete last line.
    sound: usize,
    /// The largest number of cells of its headers; none without a header.
    cells: Option<u64>,
}

fn line_of(header: &Header) -> String {
    serde_json::to_string(header).unwrap_or_default()
}

/// The fields of two headers that differ, with both values; long values are cut off.
fn differences(found: &Header, expected: &Header) -> String {
    let value = |header: &Header| serde_json::to_value(header).unwrap_or_default();
    let cut = |value: &serde_json::Value| -> String {
        let text = value.to_string();
        let mut short: String = text.chars().take(MOST).collect();
        if short.len() < text.len() {
            short.push_str("...");
        }
        short
    };
    let mut differences = Vec::new();
    let mut compare = |name: &str, found: &serde_json::Value, expected: &serde_json::Value| {
        if found != expected {
            differences.push(format!(
                "{name}: found {}, expected {}",
                cut(found),
                cut(expected)
            ));
        }
    };
    let (found, expected) = (value(found), value(expected));
    for name in ["study", "schema", "seed"] {
        compare(name, &found[name], &expected[name]);
    }
    let (found, expected) = (&found["settings"], &expected["settings"]);
    match (found.as_object(), expected.as_object()) {
        (Some(fields), Some(others)) => {
            let names: BTreeSet<&String> = fields.keys().chain(others.keys()).collect();
            for name in names {
                compare(&format!("settings.{name}"), &found[name], &expected[name]);
            }
        }
        _ => compare("settings", found, expected),
    }
    differences.join("; ")
}

/// Puts the results in `text` of the cells of `header` into `done`.
pub(super) fn parse<R: DeserializeOwned>(
    path: &Path,
    text: &[u8],
    header: &Header,
    done: &mut BTreeMap<u64, R>,
) -> Result<Parsed, JobError> {
    let mut first_header = None;
    let mut cells: Option<u64> = None;
    let mut lines_of_cells: BTreeMap<u64, (usize, &[u8])> = BTreeMap::new();
    let mut sound = 0;
    for (number, line) in (1..).zip(text.split_inclusive(|byte| *byte == b'\n')) {
        let refuse = |reason: String| JobError::Line {
            path: path.to_owned(),
            line: number,
            // The reason quotes the line.
            reason: printable(&reason),
        };
        let whole = line.ends_with(b"\n");
        let length = line.len();
        let line = line.trim_ascii();
        let value: serde_json::Value = match serde_json::from_slice(line) {
            Ok(value) => value,
            Err(_) if !whole => break,
            Err(error) => return Err(refuse(format!("not a line of results: {error}"))),
        };
        sound += length;
        if value.get("study").is_some() {
            let found: Header = serde_json::from_value(value)
                .map_err(|error| refuse(format!("not a header: {error}")))?;
            if !found.is_of_study(header) {
                return Err(JobError::Header {
                    path: path.to_owned(),
                    line: number,
                    other: first_header.map_or_else(
                        || "the requested study".to_owned(),
                        |first| format!("line {first}"),
                    ),
                    differences: differences(&found, header),
                });
            }
            first_header.get_or_insert(number);
            cells = cells.max(Some(found.cells));
            continue;
        }
        let Some(most) = cells else {
            return Err(refuse("a result before any header".to_owned()));
        };
        let cell: Cell<R> = serde_json::from_value(value)
            .map_err(|error| refuse(format!("not a result of this study: {error}")))?;
        if cell.cell >= most {
            return Err(refuse(format!(
                "cell {} of a study of {most} cells",
                cell.cell
            )));
        }
        match lines_of_cells.entry(cell.cell) {
            // The file of one shard may be merged twice.
            Entry::Occupied(there) if there.get().1 == line => {}
            Entry::Occupied(there) => {
                let first = there.get().0;
                return Err(refuse(format!(
                    "cell {} has another result than in line {first}",
                    cell.cell
                )));
            }
            Entry::Vacant(free) => {
                free.insert((number, line));
                if cell.cell < header.cells {
                    done.insert(cell.cell, cell.result);
                }
            }
        }
    }
    Ok(Parsed { sound, cells })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_the_system_refused_are_written_before_the_next_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("results.jsonl");
        std::fs::write(&path, "first\n").expect("written");
        let mut lines = Lines {
            path: path.clone(),
            // The system refuses to write to a file that is open for reading.
            file: File::open(&path).expect("a file"),
            length: 6,
            waiting: String::new(),
        };
        for line in ["second", "third"] {
            let refused = lines.append(line);
            assert!(matches!(refused, Err(JobError::File { .. })), "{refused:?}");
        }
        lines.file = OpenOptions::new().append(true).open(&path).expect("a file");
        lines.append("fourth").expect("written");
        let text = std::fs::read_to_string(&path).expect("a file");
        assert_eq!(text, "first\nsecond\nthird\nfourth\n");
    }
}
