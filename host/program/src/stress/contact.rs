//! `palpate stress contact`: random worlds in contact.

use super::{CellArguments, CommandError, Declared, judged};
use host::atomic_file::write_atomically;
use std::path::PathBuf;
use study::stress::Verdict;
use study::stress::contact::{self, Length, Study, Worlds};

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
    /// Let tools of all shapes touch bodies and obstacles, in hands that press, tap, rub, shake or loop in phase with the host
    #[arg(long)]
    tools: bool,
    /// Run few worlds, for a shorter time
    #[arg(long)]
    quick: bool,
    /// Run two worlds for 100,000 steps: a banknote that is crumpled, and a stack of eight sheets that is rocked
    #[arg(long, conflicts_with_all = ["runs", "quick", "tools"])]
    long: bool,
    #[command(flatten)]
    cells: CellArguments,
}

pub(super) fn run(arguments: &ContactArguments) -> Result<(), CommandError> {
    let declared = arguments.cells.declare(Declared::default());
    let declared = declared.folder("--folder", arguments.folder.as_ref(), |_| true);
    let _held = declared.check()?;
    let seed = arguments.cells.seed;
    let length = match (arguments.quick, arguments.long) {
        (_, true) => Length::Long,
        (true, _) => Length::Quick,
        (false, false) => Length::Whole,
    };
    let worlds = if arguments.tools {
        Worlds::Tools
    } else {
        Worlds::Bodies
    };
    let study = Study {
        seed,
        cells: arguments.runs.unwrap_or(contact::cells(worlds, length)),
        worlds,
        length,
    };
    if let Some(cell) = arguments.cell {
        if let Some(folder) = &arguments.folder {
            let (scene, files) = contact::texts(&study, cell);
            write_atomically(&folder.join("scene.toml"), scene.as_bytes())?;
            for (name, bytes) in files {
                write_atomically(&folder.join(name), &bytes)?;
            }
        }
        let found = contact::cell(&study, cell);
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
    arguments.cells.run(&study)
}
