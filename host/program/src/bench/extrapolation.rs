//! `palpate bench extrapolation`: the force error of each scheme between publications.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::{tell, with_bar};
use std::path::PathBuf;
use study::extrapolation::{self, BLENDS, DURATION, RATES};

/// Arguments of `palpate bench extrapolation`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ExtrapolationArguments {
    /// Write the table as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the error against the publication rate (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

pub(super) fn run(arguments: &ExtrapolationArguments) -> Result<(), CommandError> {
    let (json, plot) = (arguments.json.as_ref(), arguments.plot.as_ref());
    let _held = Declared::default()
        .file("--json", json, Format::Json)
        .file("--plot", plot, Format::Picture)
        .check()?;
    let found = with_bar(|progress| {
        extrapolation::run(DURATION, &RATES, &BLENDS, &mut |done| progress(done))
    })?;
    tell(&found, json, plot)
}
