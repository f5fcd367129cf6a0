//! `palpate stress`: what is to be run before a person touches a device. Under virtual time, on all cores, in shards.

mod faults;
mod hold;
mod scene;
mod wall;

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
    what: What,
}

#[derive(Clone, Debug, clap::Subcommand)]
enum What {
    /// A stiff wall on each device: where energy comes out of it, against theory, under each scheme
    Wall(wall::WallArguments),
    /// A hundred million ticks of input that no device, host or clock should ever give
    Faults(faults::FaultsArguments),
    /// Fault-free presses, holds, rubs and tremors on every kind of body: whether what is felt is the body
    Hold(hold::HoldArguments),
    /// A scene under all kinds of hands, rates and faults, under each scheme
    Scene(scene::SceneArguments),
}

/// What all of its commands take.
#[derive(Clone, Debug, clap::Args)]
struct Common {
    /// The corners only, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
    /// Fixes every random choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only the I-th of N shares of the work; the files of all are merged by cat
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// How many threads work; all cores unless told
    #[arg(long, value_name = "N")]
    threads: Option<NonZero<usize>>,
    /// Append every cell as a line of JSON as soon as it is done; cells that are there already are not done again
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw it (SVG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

impl Common {
    /// How cells are run.
    fn options(&self) -> Options {
        Options {
            shard: self.shard.unwrap_or_default(),
            threads: self.threads,
            file: self.json.clone(),
        }
    }
}

pub(super) fn run(arguments: &StressArguments) -> Result<(), CommandError> {
    match &arguments.what {
        What::Wall(arguments) => wall::run(arguments),
        What::Faults(arguments) => faults::run(arguments),
        What::Hold(arguments) => hold::run(arguments),
        What::Scene(arguments) => scene::run(arguments),
    }
}

/// The scheme of this name among those that a study runs.
fn scheme_of(text: &str, known: &[(SchemeName, &str)]) -> Result<SchemeName, String> {
    let found = known.iter().find(|(_, name)| *name == text);
    found.map(|(scheme, _)| *scheme).ok_or_else(|| {
        let names: Vec<_> = known.iter().map(|(_, name)| *name).collect();
        format!("allowed: {}", names.join(", "))
    })
}

/// Shows how far the cells are on a bar of a thousand parts.
fn show(bar: &ProgressBar, at: &Progress) {
    bar.set_position(1000 * at.done / at.of.max(1));
}
