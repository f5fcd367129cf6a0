//! `palpate stress tearing`: random tears of small sheets.

use super::{CellArguments, CommandError, Declared, Format, judged, number};
use host::atomic_file::write_atomically;
use std::path::PathBuf;
use study::stress::Verdict;
use study::stress::tearing::{self, CELLS, Draw, Study};

/// Arguments of `palpate stress tearing`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct TearingArguments {
    /// Number of runs
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    /// Run one cell again and print its outcome; --scene writes its scene file
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "quick", "shard", "json"])]
    cell: Option<u64>,
    /// Write the scene of the cell, as `palpate run` reads it (TOML)
    #[arg(long, value_name = "FILE", requires = "cell")]
    scene: Option<PathBuf>,
    /// Make few runs
    #[arg(long)]
    quick: bool,
    #[command(flatten)]
    cells: CellArguments,
}

pub(super) fn run(arguments: &TearingArguments) -> Result<(), CommandError> {
    let declared = Declared::default().file("--scene", arguments.scene.as_ref(), Format::Toml);
    let _held = arguments.cells.declare(declared).check()?;
    let seed = arguments.cells.seed;
    if let Some(cell) = arguments.cell {
        if let Some(path) = &arguments.scene {
            write_atomically(path, Draw::new(seed, cell).scene().as_bytes())?;
        }
        let found = tearing::cell(seed, cell);
        outln!("{found:#?}");
        return judged(
            &Verdict {
                failed: usize::from(!found.failures.is_empty()),
                ..Verdict::default()
            },
            1,
        );
    }
    let cells = number(arguments.runs, arguments.quick, CELLS);
    arguments.cells.run(&Study { seed, cells })
}
