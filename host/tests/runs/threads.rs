//! `host.threads`: a run gives the same bytes on any number of threads.

use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use std::collections::BTreeMap;

/// Two bodies beside each other. The block is large enough that its elements and its factor are in parts.
const SCENE: &str = r#"
name = "threads"
duration = 0.04
[[body]]
name = "block"
mesh.box = { size = [0.1, 0.05, 0.05], cells = [24, 10, 10] }
material = { young = 1e5, poisson = 0.3, density = 1000.0 }
damping = { mass = 0.1, stiffness = 0.01 }
[[body.handle]]
name = "left"
group = "left"
device = "one"
[[body.handle]]
name = "right"
group = "right"
device = "two"
[[body]]
name = "sheet"
mesh.sheet = { length = 0.1, width = 0.1, cells = [8, 8] }
material = { young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000.0 }
[[body.handle]]
name = "edge"
group = "left"
device = "three"
[[device]]
name = "one"
model = "falcon"
hand = {}
[[device]]
name = "two"
model = "falcon"
hand = { waypoints = [[0.0, 0.0, 0.0, 0.0], [0.04, 0.002, 0.001, 0.0]] }
[[device]]
name = "three"
model = "falcon"
hand = {}
"#;

fn scene() -> LoadedScene {
    Scene::load_texts("threads.toml", SCENE, &BTreeMap::new()).expect("a scene")
}

/// The log of the run on `threads` threads. The text of the scene, which the log contains, does not name them.
fn logged(threads: usize) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let mut loaded = scene();
    loaded.scene.host.threads = threads;
    let options = RunOptions {
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary =
        run(&World::new(&loaded).unwrap(), &options, &mut |_| {}).expect("the run succeeds");
    assert!(summary.failures.is_empty(), "{:?}", summary.failures);
    std::fs::read(path).expect("the log was written")
}

#[test]
fn every_number_of_threads_gives_the_same_bytes() {
    let alone = logged(1);
    // 40 ticks of three devices, with their models.
    assert!(alone.len() > 20_000, "{}", alone.len());
    for threads in 2..=4 {
        assert!(logged(threads) == alone, "{threads} threads");
    }
}

/// Under the real clock the bytes depend on the time, but the run must succeed on the threads.
#[test]
fn a_run_under_the_real_clock_steps_on_its_threads() {
    let mut loaded = scene();
    loaded.scene.host.threads = 2;
    let options = RunOptions {
        duration: Some(0.2),
        ..RunOptions::new(Clock::Real)
    };
    let summary =
        run(&World::new(&loaded).unwrap(), &options, &mut |_| {}).expect("the run succeeds");
    assert!(summary.failures.is_empty(), "{:?}", summary.failures);
    assert!(summary.host.steps > 0);
}
