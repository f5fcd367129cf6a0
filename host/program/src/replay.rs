//! `palpate run --replay`: runs the ticks of a log again and compares them bit for bit.

use super::outputs::{Declared, Format};
use super::sets::Sets;
use super::written::Written;
use super::{CommandError, load, progress_bar};
use host::atomic_file::write_json;
use host::log::index::{IndexError, LogIndex};
use host::log::series::with_successors;
use host::run::TickOutputs;
use host::run::observer::Observers;
use host::run::replay::{Chain, ReplayError, replay_watched, scene_of};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// The reason why a log could not be replayed.
#[derive(Debug, thiserror::Error)]
pub(super) enum ReplayFileError {
    #[error("cannot read this log: {0}")]
    Read(#[from] io::Error),
    #[error(transparent)]
    Log(#[from] IndexError),
    #[error(transparent)]
    Replay(#[from] ReplayError),
}

/// Replays the log at `path` on the scene of the log, or on the scene file `scene` if one is given.
pub(super) fn run(
    path: &Path,
    scene: Option<&Path>,
    json: Option<&PathBuf>,
    ticks: &TickOutputs,
) -> Result<(), CommandError> {
    let refused = |source| CommandError::Replay {
        path: path.to_owned(),
        source: Box::new(source),
    };
    let mut log = open(path).map_err(refused)?;
    let loaded = match scene {
        Some(_) => load(scene, &Sets::default())?,
        None => scene_of(&mut log, &path.display().to_string()).map_err(|e| refused(e.into()))?,
    };
    let declared = Declared::default().input("the log", Some(path));
    let declared = match scene {
        Some(_) => declared.scene(scene, &loaded),
        // The log holds the files of its scene.
        None => declared,
    };
    let declared = declared.ticks(ticks);
    let _held = declared.file("--json", json, Format::Json).check()?;
    let bar = progress_bar();
    let begin = || ticks.observe(&loaded.scene, Observers::new());
    let done = replay_watched(&mut log, &loaded, &begin, &mut |fraction| {
        bar.set_position((1000.0 * fraction) as u64);
    });
    bar.finish_and_clear();
    let (report, observed) = done.map_err(|error| match error {
        ReplayError::File(error) => CommandError::File(error),
        error => refused(error.into()),
    })?;
    out!("{report}");
    let mut written = Written::default();
    written.write(json, |path| write_json(path, &report));
    for failure in &observed.failures {
        errln!("{failure}");
    }
    for (output, path) in [("csv", &ticks.csv), ("curve", &ticks.force_displacement)] {
        if let Some(path) = path
            .as_ref()
            .filter(|path| !observed.unwritten.contains(path))
        {
            outln!("  {output:<10} {}", path.display());
        }
    }
    written.end_with(if !observed.failures.is_empty() {
        Err(CommandError::Incomplete)
    } else if report.is_exact() {
        Ok(())
    } else {
        Err(CommandError::Different)
    })
}

/// The log at `path`, and the logs of its series that continue it.
fn open(path: &Path) -> Result<Chain<File>, ReplayFileError> {
    let open =
        |path: &PathBuf| Ok::<_, ReplayFileError>(LogIndex::open(devices::input::open(path)?)?);
    let first = open(&path.to_owned())?;
    let all = with_successors(path);
    let later: Result<_, _> = all.iter().skip(1).map(open).collect();
    Ok(Chain::new(first, later?))
}
