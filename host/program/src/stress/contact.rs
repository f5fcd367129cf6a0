//! `palpate stress contact`: random worlds in contact.

use super::{CellArguments, CommandError, Declared, judged};
use host::atomic_file::write_atomically;
use std::path::PathBuf;
use study::stress::Verdict;
use study::stress::contact::{self, CELLS, Length, Study};

/// Arguments of `palpate stress contact`.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ContactArguments {
    /// Number of worlds
    #[arg(long, value_name = "N", value_parser = super::cells)]
    runs: Option<u64>,
    /// Run one world again and print its outcome; --folder writes its scene
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "shard", "json"])]
    cell: Option<u64>,
    /// Write scene.toml of the world, as `palpate run` reads it, and the files that it names
    #[arg(long, value_name = "FOLDER", requires = "cell")]
    folder: Option<PathBuf>,
    /// Run few worlds, for a shorter time
    #[arg(long)]
    quick: bool,
    /// Run two worlds for 100,000 steps: a banknote that is crumpled, and a stack of eight sheets that is rocked
    #[arg(long, conflicts_with_all = ["runs", "quick"])]
    long: bool,
    #[command(flatten)]
    cells: CellArguments,
}

pub(super) fn run(arguments: &ContactArguments) -> Result<(), CommandError> {
    let _held = arguments.cells.declare(Declared::default()).check()?;
    let seed = arguments.cells.seed;
    let (length, count) = match (arguments.quick, arguments.long) {
        (_, true) => (Length::Long, CELLS[2]),
        (true, _) => (Length::Quick, CELLS[1]),
        (false, false) => (Length::Whole, CELLS[0]),
    };
    if let Some(cell) = arguments.cell {
        if let Some(folder) = &arguments.folder {
            let (scene, files) = contact::texts(seed, cell, length);
            write_atomically(&folder.join("scene.toml"), scene.as_bytes())?;
            for (name, bytes) in files {
                write_atomically(&folder.join(name), &bytes)?;
            }
        }
        let found = contact::cell(seed, cell, length);
        outln!("{found:#?}");
        let failed = usize::from(!found.failures.is_empty());
        return judged(
            &Verdict {
                failed,
                ..Verdict::default()
            },
            1,
        );
    }
    let cells = arguments.runs.unwrap_or(count);
    arguments.cells.run(&Study {
        seed,
        cells,
        length,
    })
}
