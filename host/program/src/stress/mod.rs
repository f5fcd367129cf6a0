//! `palpate stress`: studies to run before a person touches a device. They run in virtual time, on all cores and in
//! shards.

mod faults;
mod hold;
mod scene;
mod wall;

use super::outputs::{Declared, Format};
use super::written::Written;
use super::{CommandError, progress_bar};
use host::scene::spec::SchemeName;
use indicatif::ProgressBar;
use std::num::NonZero;
use std::path::PathBuf;
use study::stress::jobs::{Options, Progress, Shard};

/// Arguments of `palpate stress`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct StressArguments {
    #[command(subcommand)]
    study: Study,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum Study {
    /// Find the stiffest passive and stable wall of each device, under each scheme, and compare with theory
    Wall(wall::WallArguments),
    /// Run a hundred million ticks on invalid input of devices, host and clock
    Faults(faults::FaultsArguments),
    /// Press, hold, rub and shake every kind of body without faults, and compare the force with that of the body
    Hold(hold::HoldArguments),
    /// Run a scene with many kinds of hands, rates and faults, under each scheme
    Scene(scene::SceneArguments),
}

/// The arguments of all stress studies.
#[derive(Clone, Debug, clap::Args)]
struct Common {
    /// Run only the corner cases, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Run only shard I of N; cat merges the files of all shards
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<Shard>,
    /// Number of threads. Default: the number of cores
    #[arg(long, value_name = "N")]
    threads: Option<NonZero<usize>>,
    /// Append each cell as a line of JSON as soon as the cell is done. Cells that the file holds are not run again
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the result (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

impl Common {
    /// The options by which the cells are run.
    fn options(&self) -> Options {
        Options {
            shard: self.shard.unwrap_or_default(),
            threads: self.threads,
            file: self.json.clone(),
        }
    }

    /// Declares the outputs of every study.
    fn declare(&self, declared: Declared) -> Declared {
        declared
            .file("--json", self.json.as_ref(), Format::JsonLines)
            .file("--plot", self.plot.as_ref(), Format::Picture)
    }
}

pub(super) fn run(arguments: &StressArguments) -> Result<(), CommandError> {
    match &arguments.study {
        Study::Wall(arguments) => wall::run(arguments),
        Study::Faults(arguments) => faults::run(arguments),
        Study::Hold(arguments) => hold::run(arguments),
        Study::Scene(arguments) => scene::run(arguments),
    }
}

/// The scheme of this name among the schemes of a study.
fn scheme_of(text: &str, known: &[(SchemeName, &str)]) -> Result<SchemeName, String> {
    let found = known.iter().find(|(_, name)| *name == text);
    found.map(|(scheme, _)| *scheme).ok_or_else(|| {
        let names: Vec<_> = known.iter().map(|(_, name)| *name).collect();
        format!("allowed: {}", names.join(", "))
    })
}

/// Parses a shard: `3/8` is the third of eight.
fn shard(text: &str) -> Result<Shard, String> {
    let parts = text.split_once('/');
    let numbers = parts.and_then(|(i, n)| i.parse().ok().zip(n.parse().ok()));
    let shard = numbers.and_then(|(index, count)| Shard::new(index, count));
    shard.ok_or_else(|| format!("a shard is I/N with I from 1 to N, as in 3/8, not {text:?}"))
}

/// Shows the progress of the cells on a bar of a thousand parts.
fn show(bar: &ProgressBar, at: &Progress) {
    bar.set_position(1000 * at.done / at.of.max(1));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read_and_bad_ones_refused() {
        assert_eq!(shard("2/3").ok(), Shard::new(2, 3));
        for bad in ["", "3", "0/3", "4/3", "1/0", "a/b", "1/3/5", "-1/3"] {
            let expected = format!("a shard is I/N with I from 1 to N, as in 3/8, not {bad:?}");
            assert_eq!(shard(bad), Err(expected));
        }
    }
}
