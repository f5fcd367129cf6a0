//! Many independent cells of a study: on all cores, divided among machines, resumed where they were interrupted.
//!
//! A study has cells numbered from zero. The result of a cell is a function of its number and of the [`Header`] alone.
//! Results therefore do not depend on threads, shards or interruptions. Neither do summaries, which read the cells in
//! the order of their numbers.
//!
//! With a file, each result is appended to the file as soon as it is known, as one line of JSON (JSON Lines): the
//! header first, then `{"cell": 7, ...}`. A run that finds lines in the file does not repeat their cells. `cat` merges
//! the files of several shards. A run of more cells extends the file: it appends its own header, then the cells that the
//! file lacks. A file that cannot be written does not end the run: see [`Cells::unwritten`].

use crate::workers::{self, STACK};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Instant;

mod file;
#[cfg(test)]
mod tests;

/// Everything that determines a study's results, except the number of the cell. The first line of a file.
///
/// No result depends on the number of cells, so files of different numbers of cells belong to the same study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The study's name.
    pub study: String,
    /// Version of the lines' layout.
    pub schema: u32,
    /// The seed of every random choice.
    pub seed: u64,
    /// Number of cells.
    pub cells: u64,
    /// The other settings on which the results depend.
    pub settings: serde_json::Value,
}

impl Header {
    /// Whether a cell has the same result in a study of this header and in a study of `other`.
    fn is_of_study(&self, other: &Self) -> bool {
        let cells = other.cells;
        let mine = Self {
            cells,
            ..self.clone()
        };
        mine == *other
    }
}

/// One part of the cells: those whose number has the remainder `index - 1` when divided by `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u64,
    count: u64,
}

impl Default for Shard {
    /// All cells.
    fn default() -> Self {
        Self { index: 1, count: 1 }
    }
}

impl Shard {
    /// The shard of number `index`, from 1 to `count`; `None` if there is no such shard.
    pub fn new(index: u64, count: u64) -> Option<Self> {
        (1..=count)
            .contains(&index)
            .then_some(Self { index, count })
    }

    fn holds(self, cell: u64) -> bool {
        cell % self.count == self.index - 1
    }
}

/// How the cells are run. No option changes a result.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The cells to run.
    pub shard: Shard,
    /// Number of threads; all cores if none.
    pub threads: Option<NonZero<usize>>,
    /// The file that results are read from, and appended to.
    pub file: Option<PathBuf>,
}

/// The progress of a run.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Cells of this shard that are done.
    pub done: u64,
    /// Cells of this shard.
    pub of: u64,
    /// Time left (s), if the other cells take as long as the cells of this run so far; none before the first.
    pub left: Option<f64>,
    /// Why the latest result could not be appended to the file, if it could not.
    pub unwritten: Option<&'a JobError>,
}

/// The results of a run.
#[derive(Debug)]
pub struct Cells<R> {
    /// The results of all cells that are done, by number: those of this shard, and those of other shards in the file.
    pub cells: BTreeMap<u64, R>,
    /// Why the file lacks some of the results, if it does. The same command runs these cells again.
    pub unwritten: Option<JobError>,
}

/// Why the cells could not be run, or their file could not be used.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The file could not be opened, read or written.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// Another run writes to the file.
    #[error(
        "{}: another run is writing to this file; give each shard a file of its own, and merge the files with cat",
        path.display()
    )]
    Busy {
        /// The file.
        path: PathBuf,
    },
    /// The file belongs to another study, version, seed or setting.
    #[error(
        "{}, line {line}: the results are not those of {other}: {differences}; results of different settings cannot share \
         a file: give another file",
        path.display()
    )]
    Header {
        /// The file.
        path: PathBuf,
        /// The line, from one.
        line: usize,
        /// The place of the other header.
        other: String,
        /// The fields that differ, with the values found and expected.
        differences: String,
    },
    /// A line is neither a header nor a cell of the study.
    #[error(
        "{}, line {line}: {reason}; if a shard was cut off before its file was merged, run this shard \
         again and merge again, else remove the line",
        path.display()
    )]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from one.
        line: usize,
        /// The fault of the line.
        reason: String,
    },
    /// A result that JSON cannot hold.
    #[error("the result of cell {cell} cannot be written: {reason}")]
    Result {
        /// The cell.
        cell: u64,
        /// The reason.
        reason: String,
    },
}

/// One line of a file.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Cell<R> {
    cell: u64,
    #[serde(flatten)]
    result: R,
}

/// Runs the cells that are not done yet. Returns the results of all cells that are done. A result must contain finite
/// numbers only, and serialize to a map without a key `cell`.
///
/// A result that cannot be appended to the file waits, and is written before the next one. A disk that is full for a
/// while loses nothing.
///
/// # Errors
/// [`JobError`] if the file cannot be used, or belongs to another study. The file is read before any cell runs.
pub fn run<R: Serialize + DeserializeOwned + Send>(
    header: &Header,
    options: &Options,
    work: &(dyn Fn(u64) -> R + Sync),
    progress: &mut dyn FnMut(&Progress<'_>),
) -> Result<Cells<R>, JobError> {
    let mut done = BTreeMap::new();
    let mut file = None;
    if let Some(path) = &options.file {
        file = Some(file::open(path, header, &mut done)?);
    }
    let of_shard = || (0..header.cells).filter(|cell| options.shard.holds(*cell));
    let left: Vec<u64> = of_shard().filter(|cell| !done.contains_key(cell)).collect();
    let of = of_shard().count() as u64;
    let before = of - left.len() as u64;
    let threads = workers::count(options.threads, left.len());
    let began = Instant::now();
    progress(&Progress {
        done: before,
        of,
        left: None,
        unwritten: None,
    });
    let mut unwritten = None;

    let mut count = 0;
    let mut take = |(cell, result)| {
        // The result is read back from its line, so that an interrupted run continues with the same result.
        let (line, result) = round_trip(cell, result)?;
        if let Some(file) = &mut file {
            unwritten = file.append(&line).err();
        }
        done.insert(cell, result);
        count += 1;
        let each = began.elapsed().as_secs_f64() / count as f64;
        progress(&Progress {
            done: before + count,
            of,
            left: Some(each * (left.len() as u64 - count) as f64),
            unwritten: unwritten.as_ref(),
        });
        Ok(())
    };

    let next = AtomicUsize::new(0);
    let (sender, results) = mpsc::channel();
    std::thread::scope(|scope| {
        // The receiver is dropped with the scope's closure, so that after an error each worker ends with its current
        // cell.
        let results = results;
        let (next, left) = (&next, &left);
        let started = workers::start(scope, threads, STACK, || {
            let sender = sender.clone();
            move || {
                while let Some(&cell) = left.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if sender.send((cell, work(cell))).is_err() {
                        break;
                    }
                }
            }
        });
        drop(sender);
        if started == 0 {
            // The system gives no thread.
            return left.iter().try_for_each(|&cell| take((cell, work(cell))));
        }
        results.iter().try_for_each(take)
    })?;
    Ok(Cells {
        cells: done,
        unwritten,
    })
}

fn round_trip<R: Serialize + DeserializeOwned>(
    cell: u64,
    result: R,
) -> Result<(String, R), JobError> {
    let refuse = |error: serde_json::Error| JobError::Result {
        cell,
        reason: error.to_string(),
    };
    let line = serde_json::to_string(&Cell { cell, result }).map_err(refuse)?;
    let read: Cell<R> = serde_json::from_str(&line).map_err(refuse)?;
    Ok((line, read.result))
}

/// The cells of a file that belong to the study of `header`, as [`run`] finds them.
///
/// # Errors
/// As [`run`].
pub fn read<R: DeserializeOwned>(
    path: &Path,
    header: &Header,
) -> Result<BTreeMap<u64, R>, JobError> {
    let mut done = BTreeMap::new();
    file::parse(path, &file::bytes(path)?, header, &mut done)?;
    Ok(done)
}

/// The header of a file, with the largest number of cells of all its headers.
///
/// # Errors
/// [`JobError`] if the file cannot be read, or if its first line is no header.
pub fn header_of(path: &Path) -> Result<Header, JobError> {
    file::header(path, &file::bytes(path)?)
}
