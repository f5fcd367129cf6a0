//! `palpate stress tearing`: random tears of small sheets.

use super::{CellArguments, CommandError, Declared, Format, Shown, Written};
use host::atomic_file::write_atomically;
use std::path::PathBuf;
use study::stress::jobs::{self, Cells, Header};
use study::stress::tearing::{self, Draw};

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

/// Default number of runs, and that of a quick study.
const RUNS: u64 = 1000;
const QUICK: u64 = 20;

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
        return end(usize::from(!found.failures.is_empty()), 1);
    }
    let default = if arguments.quick { QUICK } else { RUNS };
    let header = Header {
        study: "tearing".to_owned(),
        schema: 1,
        seed,
        cells: arguments.runs.unwrap_or(default),
        settings: serde_json::json!({}),
    };
    let shown = Shown::new();
    let work = |cell| tearing::cell(seed, cell);
    let options = arguments.cells.options();
    let cells = jobs::run(&header, &options, &work, &mut |at| shown.show(at));
    let Cells { cells, unwritten } = shown.end(cells)?;
    let count = |is: fn(&tearing::CellResult) -> bool| cells.values().filter(|c| is(c)).count();
    outln!("{} runs, seed {seed}", cells.len());
    outln!(
        "{} tore, {} started a tear at the strength, {} parted, {} used up the room for vertices",
        count(|cell| cell.opened > 0),
        count(|cell| cell.started > 0),
        count(|cell| cell.pieces > 1),
        count(|cell| cell.full)
    );
    let opened: u64 = cells.values().map(|cell| cell.opened).sum();
    let most = cells
        .values()
        .map(|cell| cell.net_energy)
        .fold(0.0, f64::max);
    outln!(
        "{opened} edges opened; net energy of the hands at most {:.3} mJ\n",
        1e3 * most
    );
    let mut failed = 0;
    for (number, cell) in &cells {
        failed += usize::from(!cell.failures.is_empty());
        for failure in &cell.failures {
            errln!("seed {seed}, cell {number}: {failure}");
        }
    }
    Written::default()
        .and(unwritten)
        .end_with(end(failed, cells.len()))
}

/// Fails if a cell failed.
fn end(failed: usize, of: usize) -> Result<(), CommandError> {
    if failed == 0 {
        return Ok(());
    }
    Err(CommandError::Stressed { failed, of })
}
