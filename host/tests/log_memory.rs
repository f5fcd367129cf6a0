//! Reading and replaying a log, and drawing a run, take memory that does not grow with the length of the run; and a length
//! in a log reserves no memory that the file does not have.
//!
//! A binary of its own, because its allocator counts every byte of the process, and one test, because tests beside each
//! other would be counted together.

use alloc_count::peak::{self, Peak};
use host::log::index::LogIndex;
use host::log::{Log, LogHeader, LogWriter};
use host::run::replay::{replay, scene_of};
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::Telemetry;
use std::error::Error;
use std::fs::{self, File};
use std::io::Cursor;
use std::path::Path;

type Outcome = Result<(), Box<dyn Error>>;

#[global_allocator]
static ALLOCATOR: Peak = Peak;

/// Lengths of the two runs (s).
const SHORT: f64 = 5.0;
const LONG: f64 = 25.0;
/// Most bytes by which the peaks of the two may differ: the list of the log's chunks, with 100 bytes for each half second,
/// and the rounding of lists that double. The logs differ by twenty megabytes.
const GROWTH: usize = 100_000;

/// A scene whose steps are fast, with two devices.
fn scene() -> Result<LoadedScene, Box<dyn Error>> {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    Ok(Scene::load(&scenes.join("thread.toml"))?)
}

/// Logs a run, and returns the length of its log (bytes).
fn log_of(scene: &LoadedScene, duration: f64, path: &Path) -> Result<u64, Box<dyn Error>> {
    let options = RunOptions {
        duration: Some(duration),
        log: Some(path.to_owned()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(scene).unwrap(), &options, &mut |_| {})?;
    Ok(fs::metadata(path)?.len())
}

/// The most bytes that a replay of the log takes.
fn replayed(path: &Path) -> Result<usize, Box<dyn Error>> {
    let once = || -> Result<u64, Box<dyn Error>> {
        let mut log = LogIndex::open(File::open(path)?)?;
        let scene = scene_of(&mut log, "a log")?;
        let report = replay(&mut log, &scene, &mut |_| {})?;
        assert!(report.is_exact(), "{report}");
        Ok(report.ticks)
    };
    let (peak, ticks) = peak::peak(once);
    println!("replay of {} ticks: {peak} bytes at most", ticks?);
    Ok(peak)
}

/// A small log with all its kinds of records.
fn small() -> Result<Vec<u8>, Box<dyn Error>> {
    let loaded = scene()?;
    let header = LogHeader {
        facts: [("clock".to_owned(), "virtual".to_owned())].into(),
        limits: loaded
            .models
            .iter()
            .map(devices::DeviceModel::capabilities)
            .collect(),
        scene: loaded.source.text,
        files: [("file".to_owned(), vec![7; 9])].into(),
    };
    let mut writer = LogWriter::create(Cursor::new(Vec::new()), &header)?;
    for tick in 0..3 {
        let mut telemetry = Telemetry::empty();
        telemetry.tick = tick;
        writer.write(&telemetry)?;
        writer.flush()?;
    }
    Ok(writer.finish()?.into_inner())
}

#[test]
fn memory_is_bounded_by_what_is_read_and_not_by_what_is_said() -> Outcome {
    let folder = tempfile::tempdir()?;
    let at = |name: &str| folder.path().join(name);
    let scene = scene()?;
    let short = log_of(&scene, SHORT, &at("short.mcap"))?;
    let long = log_of(&scene, LONG, &at("long.mcap"))?;
    assert!(long - short > 100 * GROWTH as u64, "{short}, {long}");
    let (few, many) = (replayed(&at("short.mcap"))?, replayed(&at("long.mcap"))?);
    assert!(many < few + GROWTH, "{few}, {many}");
    // The whole log in memory, as a measure that the count counts.
    let bytes = fs::read(at("long.mcap"))?;
    let (whole, log) = peak::peak(|| Log::parse(&bytes));
    assert_eq!(log?.rows.len(), 25_000);
    assert!(whole > 4 * many, "{whole}, {many}");

    // Every four bytes in turn say that four gigabytes follow, in the whole file and in a file without its end.
    let bytes = small()?;
    let mut refused = 0;
    for end in [bytes.len(), bytes.len() - 1] {
        for place in 8..end - 4 {
            let mut hostile = bytes[..end].to_vec();
            hostile[place..place + 4].copy_from_slice(&u32::MAX.to_le_bytes());
            let (most, log) = peak::peak(|| Log::parse(&hostile));
            refused += u32::from(log.is_err());
            // A record, its copy in the reader, and what is parsed; then a file of the scene, a second time.
            assert!(
                most < 8 * bytes.len() + (1 << 17),
                "{most} bytes for byte {place}"
            );
        }
    }
    assert!(refused > 1000, "{refused}");
    Ok(())
}
