//! The part of a log that is on disk while its writer runs: the log that a kill at that moment would leave. It is
//! counted in ticks, under virtual time.

use host::log::Log;
use host::run::{Clock, RunOptions, run};
use host::scene::Scene;
use host::world::World;
use std::error::Error;

/// Half a second of the built-in scene, at 1 kHz: the largest part that may not be in the file yet.
const LOST: u64 = 500;

#[test]
fn at_most_half_a_second_is_not_on_disk() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(3.0),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    let mut looks = Vec::new();
    run(
        &World::new(&Scene::embedded_default()?).unwrap(),
        &options,
        &mut |progress| {
            let bytes = std::fs::read(&path).expect("the log is there");
            // The file can be read, although it has no end yet. Before the first chunk it has no channel either.
            let log = Log::parse(&bytes).unwrap_or_default();
            let rows = log.rows.len() as u64;
            // Every model that a tick in the file used precedes the tick.
            let newest = log.models.iter().map(|model| model.head.sequence).max();
            for row in &log.rows {
                assert!(row.bodies[0].sequence <= newest.unwrap_or(0));
            }
            looks.push((progress.ticks, progress.logged, rows));
        },
    )?;
    assert!(looks.len() > 10, "{looks:?}");
    for (ticks, logged, rows) in &looks {
        // Progress names the latest tick, counted from zero.
        assert!(ticks + 1 - rows <= LOST, "{ticks} ticks, {rows} on disk");
        assert!(logged <= rows, "{logged} said to be safe, {rows} on disk");
        assert!(ticks + 1 - logged <= LOST, "{ticks} ticks, {logged} safe");
    }
    Ok(())
}
