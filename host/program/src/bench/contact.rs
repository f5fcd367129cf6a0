//! `palpate bench contact`: contact against the aims of its design, and what contact costs.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::{level, tell, with_bar};
use std::path::PathBuf;
use study::contact::{self, Section};

/// Arguments of `palpate bench contact`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ContactArguments {
    /// Run this part only
    #[arg(long, value_enum, value_name = "PART")]
    part: Option<SectionName>,
    /// The seed of the throws
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
    /// Write the tables as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the time of each stage against the number of triangles (SVG or PNG; part `cost`)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Use only coarse meshes and 64 throws, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
}

/// The parts, by name.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum SectionName {
    /// Rest, sliding, belts, energy, lists and throws, each with what is asked for
    Aims,
    /// Bodies in equilibrium: a patch test of two meshes, and the law of Hertz
    Between,
    /// The force at the hand under slow hosts: pressed on a floor, on another body, on itself
    Hand,
    /// The force of a tool under slow hosts: a ball on a block, a finger on a cloth
    Tool,
    /// The processor time of detection, rows, solve and certificate
    Cost,
}

pub(super) fn run(arguments: &ContactArguments) -> Result<(), CommandError> {
    let (json, plot) = (arguments.json.as_ref(), arguments.plot.as_ref());
    let _held = Declared::default()
        .file("--json", json, Format::Json)
        .file("--plot", plot, Format::Picture)
        .check()?;
    let section = arguments.part.map(|part| match part {
        SectionName::Aims => Section::Aims,
        SectionName::Between => Section::Between,
        SectionName::Hand => Section::Hand,
        SectionName::Tool => Section::Tool,
        SectionName::Cost => Section::Cost,
    });
    let found = with_bar(|progress| {
        contact::run(
            level(arguments.quick),
            section,
            arguments.seed,
            &mut |done| progress(done),
        )
    })?;
    tell(&found, json, plot)
}
