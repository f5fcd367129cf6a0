//! A study consists of many cells, the criterion of a failure, and the words and the picture of the results.
//!
//! The author of a study implements [`Study`] and adds a line to [`STUDIES`](super::STUDIES). Running on all cores,
//! shards, files of results, their resumption and merging, progress, exit codes and the comparison of seeds follow from
//! the trait.

use super::jobs::{self, Cells, Header, JobError, Options, Progress};
use host::plot::Picture;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::Path;

/// Is told the fraction of a cell that was done since the last call, on any thread.
pub type Done<'a> = dyn Fn(f64) + Sync + 'a;

/// A study: cells numbered from zero. The result of a cell depends on its number and on the [`Header`] alone.
pub trait Study: Sync {
    /// The result of a cell: a line of the file of results.
    type Outcome: Serialize + DeserializeOwned + Send;
    /// The name of the study in its file and on the command line.
    const NAME: &'static str;
    /// Version of the layout of the results.
    const SCHEMA: u32;
    /// Whether results of several seeds are compared.
    const COMPARED: bool = false;

    /// The seed of every random choice.
    fn seed(&self) -> u64;

    /// Number of cells.
    fn cells(&self) -> u64;

    /// The settings that determine the results, in addition to the seed and the number of a cell.
    fn settings(&self) -> serde_json::Value {
        serde_json::json!({})
    }

    /// Runs a cell. A cell that takes long tells `done` its parts.
    fn cell(&self, cell: u64, done: &Done<'_>) -> Self::Outcome;

    /// A line for the person who waits, before the first cell.
    fn announcement(&self) -> Option<String> {
        None
    }

    /// The results in words and tables.
    fn summary(&self, cells: &BTreeMap<u64, Self::Outcome>) -> String;

    /// What failed.
    fn verdict(&self, cells: &BTreeMap<u64, Self::Outcome>) -> Verdict;

    /// The results as a picture; `None` for a study without one.
    fn draw(&self, _cells: &BTreeMap<u64, Self::Outcome>) -> Option<Picture> {
        None
    }

    /// The quantities that are compared over seeds, if the study is [`COMPARED`](Self::COMPARED).
    fn quantities(_cells: &BTreeMap<u64, Self::Outcome>) -> Vec<Quantity> {
        Vec::new()
    }

    /// The first line of the file of results.
    fn header(&self) -> Header {
        Header {
            study: Self::NAME.to_owned(),
            schema: Self::SCHEMA,
            seed: self.seed(),
            cells: self.cells(),
            settings: self.settings(),
        }
    }

    /// Runs the cells that are not done yet.
    ///
    /// # Errors
    /// [`JobError`] if the file of results cannot be used, or belongs to another study.
    fn run(
        &self,
        options: &Options,
        done: &Done<'_>,
        progress: &mut dyn FnMut(&Progress<'_>),
    ) -> Result<Cells<Self::Outcome>, JobError> {
        jobs::run(
            &self.header(),
            options,
            &|cell| self.cell(cell, done),
            progress,
        )
    }
}

/// The failures of a study.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// Number of cells that did what they must not do.
    pub failed: usize,
    /// Whether a cell could not be run.
    pub incomplete: bool,
    /// A line for each failure.
    pub lines: Vec<String>,
}

impl Verdict {
    /// The verdict on cells that name their failures, each in the words of `line`.
    pub fn of_failures<R>(
        cells: &BTreeMap<u64, R>,
        failures: impl Fn(&R) -> &[String],
        line: impl Fn(u64, &R, &str) -> String,
    ) -> Self {
        let mut verdict = Self::default();
        for (number, cell) in cells {
            let failures = failures(cell);
            verdict.failed += usize::from(!failures.is_empty());
            let lines = failures.iter().map(|failure| line(*number, cell, failure));
            verdict.lines.extend(lines);
        }
        verdict
    }
}

/// A quantity of the results of one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// The subject of the measurement, such as a scheme.
    pub of: String,
    /// Its name, with its unit.
    pub name: String,
    /// Its value, in the unit of the quantity.
    pub value: f64,
}

/// The quantities of `of`, by name.
pub(super) fn quantities(
    of: &str,
    values: impl IntoIterator<Item = (&'static str, f64)>,
) -> Vec<Quantity> {
    let values = values.into_iter().map(|(name, value)| Quantity {
        of: of.to_owned(),
        name: name.to_owned(),
        value,
    });
    values.collect()
}

/// The number of cells of a file of results, and its quantities.
pub type Found = Result<(u64, Vec<Quantity>), JobError>;

/// A study as the commands that treat all studies alike know it: the comparison of seeds, and the page on JSON.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// The name of the study.
    pub name: &'static str,
    /// The path of the type of its results.
    pub outcome: fn() -> &'static str,
    /// Whether results of several seeds are compared.
    pub is_compared: bool,
    /// Reads the file of results at a path, whose header is given.
    pub read: fn(&Path, &Header) -> Found,
}

impl Entry {
    /// The entry of a study.
    pub(super) const fn of<S: Study>() -> Self {
        Self {
            name: S::NAME,
            outcome: std::any::type_name::<S::Outcome>,
            is_compared: S::COMPARED,
            read: |path, header| {
                let cells = jobs::read::<S::Outcome>(path, header)?;
                Ok((cells.len() as u64, S::quantities(&cells)))
            },
        }
    }
}
