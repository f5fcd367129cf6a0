//! The file of a study's results: its contents, and the lines that are appended.

use super::{Cell, Header, JobError};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// A file to which results are appended. No other run can open the file at the same time.
pub(super) struct Lines {
    path: PathBuf,
    file: File,
}

/// Opens the file of the study, puts the results that it contains into `done`, and prepares it for more: a new file
/// gets the header, and an incomplete last line is removed.
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
    let sound = parse(path, &text, header, done)?;
    if sound < text.len() {
        file.set_len(sound as u64).map_err(failed)?;
    }
    let mut lines = Lines {
        path: path.to_owned(),
        file,
    };
    if sound == 0 {
        lines.append(&line_of(header))?;
    } else if text[sound - 1] != b'\n' {
        lines.append("")?;
    }
    Ok(lines)
}

impl Lines {
    /// Appends a complete line.
    pub(super) fn append(&mut self, line: &str) -> Result<(), JobError> {
        let whole = format!("{line}\n");
        let written = self.file.write_all(whole.as_bytes());
        written.map_err(|source| JobError::File {
            path: self.path.clone(),
            source,
        })
    }
}

fn line_of(header: &Header) -> String {
    serde_json::to_string(header).unwrap_or_default()
}

/// Puts the results in `text` into `done`. Returns the number of sound bytes: all, except an incomplete last line.
pub(super) fn parse<R: DeserializeOwned>(
    path: &Path,
    text: &[u8],
    header: &Header,
    done: &mut BTreeMap<u64, R>,
) -> Result<usize, JobError> {
    let mut first_header = None;
    let mut lines_of_cells: BTreeMap<u64, (usize, &[u8])> = BTreeMap::new();
    let mut sound = 0;
    for (number, line) in (1..).zip(text.split_inclusive(|byte| *byte == b'\n')) {
        let refuse = |reason: String| JobError::Line {
            path: path.to_owned(),
            line: number,
            reason,
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
            if found != *header {
                return Err(JobError::Header {
                    path: path.to_owned(),
                    line: number,
                    other: first_header.map_or_else(
                        || "the requested study".to_owned(),
                        |first| format!("that of line {first}"),
                    ),
                    found: line_of(&found),
                    expected: line_of(header),
                });
            }
            first_header.get_or_insert(number);
            continue;
        }
        if first_header.is_none() {
            return Err(refuse("a result before any header".to_owned()));
        }
        let cell: Cell<R> = serde_json::from_value(value)
            .map_err(|error| refuse(format!("not a result of this study: {error}")))?;
        if cell.cell >= header.cells {
            let most = header.cells;
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
                done.insert(cell.cell, cell.result);
            }
        }
    }
    Ok(sound)
}
