//! `palpate bench accuracy`: the error of sheets and solids against exact solutions and independent programs.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::{level, tell, with_bar};
use std::path::PathBuf;
use study::accuracy;

/// Arguments of `palpate bench accuracy`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct AccuracyArguments {
    /// Write the tables as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw error against element size (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Use only the coarse meshes, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
}

pub(super) fn run(arguments: &AccuracyArguments) -> Result<(), CommandError> {
    let (json, plot) = (arguments.json.as_ref(), arguments.plot.as_ref());
    let _held = Declared::default()
        .file("--json", json, Format::Json)
        .file("--plot", plot, Format::Picture)
        .check()?;
    let level = level(arguments.quick);
    let found = with_bar(|progress| accuracy::run(level, &mut |done| progress(done)))?;
    tell(&found, json, plot)
}
