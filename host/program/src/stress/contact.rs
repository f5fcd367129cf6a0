//! `palpate stress contact`: random worlds in contact.

use super::{CellArguments, CommandError, Declared, judged, number};
use host::atomic_file::write_atomically;
use std::path::PathBuf;
use study::stress::Verdict;
use study::stress::contact::{self, CELLS, Study};

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
    #[command(flatten)]
    cells: CellArguments,
}

pub(super) fn run(arguments: &ContactArguments) -> Result<(), CommandError> {
    let _held = arguments.cells.declare(Declared::default()).check()?;
    let (seed, quick) = (arguments.cells.seed, arguments.quick);
    if let Some(cell) = arguments.cell {
        if let Some(folder) = &arguments.folder {
            let (scene, files) = contact::texts(seed, cell, quick);
            write_atomically(&folder.join("scene.toml"), scene.as_bytes())?;
            for (name, bytes) in files {
                write_atomically(&folder.join(name), &bytes)?;
            }
        }
        let found = contact::cell(seed, cell, quick);
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
    let cells = number(arguments.runs, quick, CELLS);
    arguments.cells.run(&Study { seed, cells, quick })
}
