//! Virtual time makes a run a function of scene and seed: two runs give the same bytes under any load.

use host::run::{Clock, RunOptions, run};
use host::world::World;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

fn logged(path: &Path, seed: u64) -> Vec<u8> {
    let loaded = palpate_tests::default_scene();
    let options = RunOptions {
        duration: Some(2.0),
        seed: Some(seed),
        log: Some(path.to_owned()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&loaded).unwrap(), &options, &mut |_| {}).expect("the run succeeds");
    std::fs::read(path).expect("the log was written")
}

#[test]
fn two_runs_give_the_same_bytes_one_of_them_under_load() {
    let folder = tempfile::tempdir().expect("a folder");
    let quiet = logged(&folder.path().join("quiet.mcap"), 1);
    let over = AtomicBool::new(false);
    let loaded = std::thread::scope(|scope| {
        // More threads than cores, each of which is always busy, interrupt the run at random places.
        for _ in 0..8 {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let bytes = logged(&folder.path().join("loaded.mcap"), 1);
        over.store(true, Ordering::Relaxed);
        bytes
    });
    assert!(quiet == loaded, "the logs of two equal runs differ");
    // Two seconds at 1 kHz with two devices: the compared files are not empty.
    assert!(quiet.len() > 500_000, "{}", quiet.len());
}

#[test]
fn another_seed_gives_other_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let one = logged(&folder.path().join("one.mcap"), 1);
    let two = logged(&folder.path().join("two.mcap"), 2);
    assert!(one != two, "the seed changes nothing");
}
