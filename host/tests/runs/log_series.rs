//! A series of logs: each file is whole, the files together replay bit for bit, and the oldest make room.

use host::log::index::LogIndex;
use host::log::series::{SeriesOptions, with_successors};
use host::run::replay::{Chain, ReplayError, ReplayReport, replay, scene_of};
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use std::error::Error;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

type Outcome = Result<(), Box<dyn Error>>;

/// Runs the built-in scene for a time (s) into a series of files of a second each. Returns its failures.
fn logged(folder: &Path, duration: f64, total_bytes: u64) -> Result<Vec<String>, Box<dyn Error>> {
    let options = RunOptions {
        duration: Some(duration),
        series: Some(SeriesOptions {
            folder: folder.to_owned(),
            file_bytes: 1 << 30,
            file_seconds: 1,
            total_bytes,
        }),
        ..RunOptions::new(Clock::Virtual)
    };
    let scene = Scene::embedded_default()?;
    let summary = run(&World::new(&scene)?, &options, &mut |_| {})?;
    Ok(summary.failures)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut files: Vec<_> = fs::read_dir(folder)?
        .flatten()
        .map(|entry| entry.path())
        .collect();
    files.sort();
    Ok(files)
}

fn replayed(first: &Path) -> Result<ReplayReport, ReplayError> {
    let open = |path: &PathBuf| LogIndex::open(File::open(path).expect("a file"));
    let all = with_successors(first);
    let later: Result<_, _> = all[1..].iter().map(open).collect();
    let mut chain = Chain::new(open(&all[0])?, later?);
    let loaded = scene_of(&mut chain, "a series")?;
    replay(&mut chain, &loaded, &mut |_| {})
}

#[test]
fn the_files_of_a_run_replay_across_the_cuts() -> Outcome {
    let folder = tempfile::tempdir()?;
    assert_eq!(logged(folder.path(), 3.5, u64::MAX)?, [""; 0]);
    assert_eq!(logged(folder.path(), 1.2, u64::MAX)?, [""; 0]);
    let files = files(folder.path())?;
    assert_eq!(files.len(), 4 + 2, "two runs, with a file for each second");
    for (first, ticks) in [(&files[0], 3500), (&files[4], 1200)] {
        let report = replayed(first)?;
        assert!(report.is_exact() && report.complete, "{report}");
        assert_eq!(report.ticks, ticks);
    }
    for file in &files {
        // Each file alone has its scene, its end and an overview of its own ticks.
        let log = LogIndex::open(File::open(file)?)?;
        assert!(log.is_complete() && log.overview().is_some() && !log.scene().is_empty());
    }
    let middle = replayed(&files[1]).expect_err("a later part");
    assert!(matches!(middle, ReplayError::Middle(1000)), "{middle}");
    Ok(())
}

#[test]
fn the_oldest_files_make_room_and_a_file_that_is_cut_still_replays() -> Outcome {
    let folder = tempfile::tempdir()?;
    logged(folder.path(), 1.0, u64::MAX)?;
    let bytes = fs::metadata(&files(folder.path())?[0])?.len();
    // A file may take its part of the whole, which is far more than a second takes here. So nothing older stays.
    logged(folder.path(), 3.5, (1 << 30) + 2 * bytes)?;
    let left = files(folder.path())?;
    assert!((2..=3).contains(&left.len()), "{left:?}");
    assert!(
        left.iter()
            .all(|file| file.display().to_string().contains("palpate-000002-"))
    );
    // Its writer was killed.
    logged(folder.path(), 2.5, u64::MAX)?;
    let all = files(folder.path())?;
    let last = all.last().ok_or("no file")?;
    let whole = fs::read(last)?;
    fs::write(last, &whole[..whole.len() / 2])?;
    let first = all
        .iter()
        .find(|file| file.display().to_string().contains("palpate-000003-0001"));
    let report = replayed(first.ok_or("no first part")?)?;
    assert!(
        report.is_exact() && !report.complete && report.ticks >= 2000,
        "{report}"
    );
    Ok(())
}
