//! `palpate bench velocity`: the error of velocity estimates from encoder counts.

use super::super::CommandError;
use super::super::outputs::{Declared, Format};
use super::{tell, with_bar};
use std::path::PathBuf;
use study::velocity;

/// Arguments of `palpate bench velocity`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct VelocityArguments {
    /// Write all figures as JSON as well
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

pub(super) fn run(arguments: &VelocityArguments) -> Result<(), CommandError> {
    let json = arguments.json.as_ref();
    let _held = Declared::default()
        .file("--json", json, Format::Json)
        .check()?;
    let found = with_bar(|progress| velocity::run(&mut |done| progress(done)));
    tell(&found, json, None)
}
