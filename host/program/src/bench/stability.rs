//! `palpate bench stability`: the numerical stress suite, with a verdict and the worst figure for each family.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::{level, tell, with_bar};
use std::path::PathBuf;
use study::stability;

/// Arguments of `palpate bench stability`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct StabilityArguments {
    /// Run only the corner cases of each family, in seconds instead of minutes
    #[arg(long)]
    quick: bool,
    /// Run only the family of this name
    #[arg(long, value_name = "NAME", value_parser = clap::builder::PossibleValuesParser::new(stability::names()))]
    family: Option<String>,
    /// Write every case as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw the recovery of bodies from scrambled starts (SVG or PNG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

pub(super) fn run(arguments: &StabilityArguments) -> Result<(), CommandError> {
    let (json, plot) = (arguments.json.as_ref(), arguments.plot.as_ref());
    let _held = Declared::default()
        .file("--json", json, Format::Json)
        .file("--plot", plot, Format::Picture)
        .check()?;
    let level = level(arguments.quick);
    let report = with_bar(|progress| {
        stability::run(level, arguments.family.as_deref(), &mut |done| {
            progress(done);
        })
    });
    tell(&report, json, plot)?;
    match report.failures().count() {
        0 => Ok(()),
        failed => Err(CommandError::Unstable { failed }),
    }
}
