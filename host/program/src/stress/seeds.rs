//! `palpate stress seeds`: results of several seeds of a study, side by side.

use super::{CommandError, Declared, Format};
use host::atomic_file::write_json;
use std::path::PathBuf;
use study::stress::seeds::compare;

/// Arguments of `palpate stress seeds`.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct SeedsArguments {
    /// Files that a study wrote with --json, one for each seed
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Write the comparison as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  for seed in 1 2 3; do palpate stress scene my_scene.toml --seed $seed --json seed-$seed.jsonl; done
  palpate stress seeds seed-1.jsonl seed-2.jsonl seed-3.jsonl";

pub(super) fn run(arguments: &SeedsArguments) -> Result<(), CommandError> {
    let mut declared = Declared::default().file("--json", arguments.json.as_ref(), Format::Json);
    for file in &arguments.files {
        declared = declared.input("a file of results", Some(file));
    }
    let _held = declared.check()?;
    let found = compare(&arguments.files)?;
    out!("{}", found.table());
    if let Some(path) = &arguments.json {
        write_json(path, &found)?;
    }
    Ok(())
}
