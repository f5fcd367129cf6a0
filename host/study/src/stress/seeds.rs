//! Files of results of several seeds, side by side: how far a result of a study depends on its seed.
//!
//! Each file holds the cells of one seed of one study with the same settings. The quantities are those of the tables of
//! the study. Their spread over the seeds shows which of their differences, between two schemes say, mean anything.

use super::jobs::{self, Header, JobError};
use super::{Entry, Quantity, STUDIES};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Version of the JSON of [`Seeds`].
pub const SCHEMA: &str = "palpate.seeds/1";

/// A study over several seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Seeds {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// The study's name.
    pub study: String,
    /// The seeds, in the order of the files.
    pub seeds: Vec<u64>,
    /// Number of cells of each seed.
    pub cells: Vec<u64>,
    /// The quantities.
    pub quantities: Vec<Spread>,
}

impl Seeds {
    /// One row for each quantity: its value for each seed, then the spread.
    pub fn table(&self) -> String {
        let mut text = String::new();
        let cells: Vec<_> = self.cells.iter().map(u64::to_string).collect();
        put!(
            text,
            "{}: {} seeds; cells of each: {}\n",
            self.study,
            self.seeds.len(),
            cells.join(", ")
        );
        let seeds: Vec<_> = self
            .seeds
            .iter()
            .map(|seed| format!("seed {seed}"))
            .collect();
        put!(
            text,
            "| of | quantity | {} | mean | standard deviation | least | most |",
            seeds.join(" | ")
        );
        put!(text, "|{}", "---|".repeat(6 + seeds.len()));
        for spread in &self.quantities {
            let values: Vec<_> = spread.values.iter().copied().map(number).collect();
            let summary = [spread.mean, spread.deviation, spread.least, spread.most].map(number);
            put!(
                text,
                "| {} | {} | {} | {} |",
                spread.of,
                spread.quantity,
                values.join(" | "),
                summary.join(" | ")
            );
        }
        text
    }
}

/// A quantity over the seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The subject of the measurement, such as a scheme.
    pub of: String,
    /// Its name, with its unit.
    pub quantity: String,
    /// Its value for each seed, in the unit of the quantity; none if the cells do not give it.
    pub values: Vec<Option<f64>>,
    /// Mean of the values, in the unit of the quantity; none without values.
    pub mean: Option<f64>,
    /// Standard deviation of the values, in the unit of the quantity (of a sample: divided by their number less one); none
    /// below two values.
    pub deviation: Option<f64>,
    /// Smallest value, in the unit of the quantity.
    pub least: Option<f64>,
    /// Largest value, in the unit of the quantity.
    pub most: Option<f64>,
}

/// Why files cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum SeedsError {
    /// A file cannot be used.
    #[error(transparent)]
    Jobs(#[from] JobError),
    /// Two files are not of the same study.
    #[error(
        "{}: {field} differs from that of {}; give files of one study that differ in their seeds only",
        path.display(), other.display()
    )]
    Differs {
        /// The file.
        path: PathBuf,
        /// The first file.
        other: PathBuf,
        /// The field of the header that differs.
        field: String,
    },
    /// Two files have the same seed.
    #[error(
        "{}: found seed {seed}, which {} has, too; merge the files of the shards of one seed with cat",
        path.display(), other.display()
    )]
    Twice {
        /// The file.
        path: PathBuf,
        /// The earlier file.
        other: PathBuf,
        /// The seed.
        seed: u64,
    },
    /// A study whose results this program does not compare.
    #[error("{}: found the study {study:?}, allowed: {}", path.display(), names())]
    Unknown {
        /// The file.
        path: PathBuf,
        /// The study of the file.
        study: String,
    },
}

/// Compares the files at `paths`.
///
/// # Errors
/// [`SeedsError`] if a file cannot be read, or if the files are not of one study with different seeds.
pub fn compare(paths: &[PathBuf]) -> Result<Seeds, SeedsError> {
    let mut headers: Vec<(&Path, Header)> = Vec::new();
    for path in paths {
        let header = jobs::header_of(path)?;
        if let Some((other, first)) = headers.first()
            && let Some(field) = difference(first, &header)
        {
            return Err(SeedsError::Differs {
                path: path.clone(),
                other: other.to_path_buf(),
                field,
            });
        }
        if let Some((other, _)) = headers.iter().find(|(_, known)| known.seed == header.seed) {
            return Err(SeedsError::Twice {
                path: path.clone(),
                other: other.to_path_buf(),
                seed: header.seed,
            });
        }
        headers.push((path, header));
    }
    let mut cells = Vec::new();
    // In the order in which the first seed gives them.
    let mut spreads: Vec<Spread> = Vec::new();
    for (number, (path, header)) in headers.iter().enumerate() {
        let (count, values) = values(path, header)?;
        cells.push(count);
        for Quantity {
            of,
            name: quantity,
            value,
        } in values
        {
            let same = |one: &&mut Spread| one.of == of && one.quantity == quantity;
            let value = value.is_finite().then_some(value);
            if let Some(known) = spreads.iter_mut().find(same) {
                known.values[number] = value;
                continue;
            }
            let mut values = vec![None; headers.len()];
            values[number] = value;
            spreads.push(Spread {
                of,
                quantity,
                values,
                mean: None,
                deviation: None,
                least: None,
                most: None,
            });
        }
    }
    for spread in &mut spreads {
        spread.complete();
    }
    Ok(Seeds {
        schema: SCHEMA,
        study: headers
            .first()
            .map_or(String::new(), |(_, h)| h.study.clone()),
        seeds: headers.iter().map(|(_, header)| header.seed).collect(),
        cells,
        quantities: spreads,
    })
}

impl Spread {
    fn complete(&mut self) {
        let values: Vec<f64> = self.values.iter().copied().flatten().collect();
        let count = values.len() as f64;
        if values.is_empty() {
            return;
        }
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        self.mean = Some(mean);
        self.deviation = (count > 1.0).then(|| (squares / (count - 1.0)).sqrt());
        self.least = values.iter().copied().reduce(f64::min);
        self.most = values.iter().copied().reduce(f64::max);
    }
}

/// The first field in which two headers differ; the seed and the number of cells may.
fn difference(first: &Header, other: &Header) -> Option<String> {
    if first.study != other.study {
        return Some("study".to_owned());
    }
    if first.schema != other.schema {
        return Some("schema".to_owned());
    }
    let [one, two] = [first, other].map(|header| {
        let mut settings = header.settings.clone();
        // The study of walls has its seed among its settings, too.
        if let Some(seed) = settings.pointer_mut("/study/seed") {
            *seed = serde_json::Value::Null;
        }
        settings
    });
    if one == two {
        return None;
    }
    let fields = |settings: &serde_json::Value| {
        let fields = settings.as_object().map(|fields| fields.keys().cloned());
        fields.map_or_else(Vec::new, Iterator::collect)
    };
    let all = fields(&one).into_iter().chain(fields(&two));
    let mut differing = all.filter(|field| one.get(field) != two.get(field));
    let field = differing.next();
    Some(field.map_or_else(
        || "settings".to_owned(),
        |field| format!("settings.{field}"),
    ))
}

/// The number of cells of a file, and its quantities.
fn values(path: &Path, header: &Header) -> Result<(u64, Vec<Quantity>), SeedsError> {
    match compared().find(|study| study.name == header.study) {
        Some(study) => Ok((study.read)(path, header)?),
        None => Err(SeedsError::Unknown {
            path: path.to_owned(),
            study: header.study.clone(),
        }),
    }
}

/// The studies whose seeds are compared.
fn compared() -> impl Iterator<Item = &'static Entry> {
    STUDIES.iter().filter(|study| study.is_compared)
}

fn names() -> String {
    let names: Vec<_> = compared().map(|study| study.name).collect();
    names.join(", ")
}

/// A number with four significant digits; nothing if there is no value.
fn number(value: Option<f64>) -> String {
    let Some(value) = value else {
        return String::new();
    };
    if value == 0.0 {
        return "0".to_owned();
    }
    let before = value.abs().log10().floor() as i32 + 1;
    let decimals = usize::try_from(4 - before).unwrap_or(0).min(9);
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::Study as _;
    use crate::stress::faults;
    use crate::stress::jobs::Options;

    /// A file of the study of invalid input: `failed` of its `cells` cells fail.
    fn file(folder: &Path, seed: u64, cells: u64, failed: u64, ticks: u64) -> PathBuf {
        let path = folder.join(format!("{seed}-{cells}-{ticks}.jsonl"));
        let study = faults::Study {
            seed,
            cells,
            devices: Vec::new(),
        };
        let mut header = study.header();
        header.settings["ticks"] = ticks.into();
        let options = Options {
            file: Some(path.clone()),
            ..Options::default()
        };
        let work = |cell| faults::Outcome {
            beyond: u64::from(cell < failed),
            ..faults::Outcome::default()
        };
        jobs::run(&header, &options, &work, &mut |_| {}).expect("cells");
        path
    }

    #[test]
    fn the_spread_over_the_seeds_is_that_of_the_values() {
        let folder = tempfile::tempdir().expect("a folder");
        let counts = [(1, 5, 1), (2, 5, 3), (7, 6, 5)];
        let paths = counts.map(|(seed, cells, failed)| file(folder.path(), seed, cells, failed, 9));
        let found = compare(&paths).expect("one study");
        assert_eq!((found.seeds, found.cells), (vec![1, 2, 7], vec![5, 5, 6]));
        let [spread] = &found.quantities[..] else {
            panic!("{:?}", found.quantities);
        };
        assert_eq!(spread.values, [Some(1.0), Some(3.0), Some(5.0)]);
        let summary = [spread.mean, spread.deviation, spread.least, spread.most];
        assert_eq!(summary, [Some(3.0), Some(2.0), Some(1.0), Some(5.0)]);
        // One seed has no spread.
        let found = compare(&paths[..1]).expect("one file");
        assert_eq!(found.quantities[0].deviation, None);
        assert_eq!(found.quantities[0].mean, Some(1.0));
    }

    #[test]
    fn files_that_are_not_of_one_study_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = file(folder.path(), 1, 3, 0, 9);
        let refused = |other: PathBuf| {
            let refused = compare(&[first.clone(), other]).expect_err("refused");
            refused.to_string()
        };
        let said = refused(file(folder.path(), 2, 3, 0, 10));
        assert!(
            said.contains("settings.ticks differs from that of"),
            "{said}"
        );
        let said = refused(file(folder.path(), 1, 4, 0, 9));
        assert!(said.contains("found seed 1, which "), "{said}");
        let text = folder.path().join("notes.txt");
        std::fs::write(&text, "no results\n").expect("written");
        let said = refused(text);
        assert!(said.contains("line 1: not a header"), "{said}");
    }

    #[test]
    fn numbers_have_four_significant_digits() {
        for (value, text) in [
            (0.0, "0"),
            (98.765_43, "98.77"),
            (1234.56, "1235"),
            (123_456.0, "123456"),
            (0.001_234_56, "0.001235"),
            (-2.0, "-2.000"),
            (1e-12, "0.000000000"),
        ] {
            assert_eq!(number(Some(value)), text);
        }
        assert_eq!(number(None), "");
    }
}
