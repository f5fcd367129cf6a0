//! `palpate stress hold`: presses, holds, slow rubs and tremors on bodies of every kind.

use super::scene::{show, write_scene};
use super::{CommandError, Common, Declared, Format, Values, judged, number, scheme_of};
use crate::{build, progress_bar};
use host::scene::spec::SchemeName;
use std::collections::BTreeMap;
use std::path::PathBuf;
use study::stress::hold::{Holds, SCHEMES, Study, holds, judge};

/// Arguments of `palpate stress hold`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct HoldArguments {
    /// Judge this scene file (TOML) with its own hands, instead of the cells of the study
    #[arg(conflicts_with_all = ["runs", "cell", "quick", "seed", "shard", "json", "plot"])]
    file: Option<PathBuf>,
    #[command(flatten)]
    values: Values,
    /// Number of cells: the fixed cases first, then random draws. Each cell is run under linear and capped
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    /// Run one cell again and print its outcome: --plot draws the cell, --log writes every tick, --write writes its
    /// scene file
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "quick", "shard", "json"])]
    cell: Option<u64>,
    /// Scheme of the cell: linear or capped. Default: capped
    #[arg(long, value_name = "NAME", requires = "cell", value_parser = scheme)]
    scheme: Option<SchemeName>,
    /// Write every tick of the cell (CSV)
    #[arg(long, value_name = "FILE", requires = "cell")]
    log: Option<PathBuf>,
    /// Write the scene of the cell, which `palpate run` repeats (TOML)
    #[arg(long, value_name = "FILE", requires = "cell")]
    write: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

/// Default number of cells, and that of a quick study: the cases, and each specimen on each device.
const RUNS: [u64; 2] = [2000, 84];

fn scheme(text: &str) -> Result<SchemeName, String> {
    scheme_of(text, &SCHEMES)
}

pub(super) fn run(arguments: &HoldArguments) -> Result<(), CommandError> {
    let common = &arguments.common;
    if let Some(path) = &arguments.file {
        let loaded = arguments.values.load(Some(path), Vec::new())?;
        // This prints the warnings of the meshes.
        build(&loaded, &progress_bar())?;
        let cell = judge(loaded)?;
        if cell.moves {
            outln!("a hand moves in the last second; the hold is not judged");
        }
        let cells = BTreeMap::from([(0, cell)]);
        out!("{}", holds::listed(&cells));
        return judged(&holds::verdict(&cells), cells.len());
    }
    let declared = Declared::default()
        .file("--log", arguments.log.as_ref(), Format::Csv)
        .file("--write", arguments.write.as_ref(), Format::Toml);
    let _held = common.declare(declared).check()?;
    let study = Study::new(common.cells.seed);
    if let Some(cell) = arguments.cell {
        return show_cell(arguments, study, cell);
    }
    common.run(&Holds {
        study,
        cells: number(arguments.runs, common.quick, RUNS),
    })
}

/// Runs one cell under one scheme and prints its outcome.
fn show_cell(arguments: &HoldArguments, study: Study, cell: u64) -> Result<(), CommandError> {
    let wanted = arguments.scheme.unwrap_or(SchemeName::Capped);
    if let Some(path) = &arguments.write {
        write_scene(path, &study.written(cell, wanted)?)?;
    }
    let files = [&arguments.common.plot, &arguments.log];
    show(&study.again(cell, wanted)?, files)
}
