//! Snapshots for viewers, with the clock of a test.

use super::*;
use crate::engine::build::{BuildOptions, bodies};
use crate::engine::change::Edit;
use crate::engine::pacer::Due;
use crate::engine::stats::WallStopwatch;
use crate::scene::Scene;
use crate::world::World;
use rt_core::TickRecord;
use std::time::{Duration, Instant};

/// A time long enough for the next copy to be due.
const LATER: Duration = Duration::from_millis(17);

/// The engine of the built-in scene, and the clock of a test.
struct Rig {
    engine: Engine,
    now: Instant,
}

impl Rig {
    fn new() -> Self {
        let loaded = Scene::embedded_default().expect("the built-in scene loads");
        let bodies = bodies(&World::new(&loaded).unwrap(), BuildOptions::default())
            .expect("it can be built");
        Self {
            engine: Engine::new(bodies),
            now: Instant::now(),
        }
    }

    fn watched(&self) -> (Subscriber, Reader) {
        let watchers = Watchers::default();
        watchers.set(1);
        Subscriber::watched(&self.engine, watchers)
    }

    /// Steps, and tells the subscriber of the step.
    fn step(&mut self, subscriber: &mut Subscriber) {
        let time_ns = 4_000_000 * (self.engine.stats().steps + 1);
        let due = Due {
            time_ns,
            publishes: true,
        };
        let mut record = TickRecord::empty();
        (record.tick, record.time_ns) = (time_ns / 1_000_000, time_ns);
        self.engine.follow(&record);
        self.engine
            .step(due, &WallStopwatch::start(), &mut |_, _| {});
        self.now += LATER;
        subscriber.after_step(self.now, time_ns, 5, &self.engine);
    }

    fn rounded(&self) -> Vec<u32> {
        let positions = self.engine.bodies()[0].body().positions();
        positions
            .flat_map(|x| [x.x, x.y, x.z].map(|x| (x as f32).to_bits()))
            .collect()
    }
}

fn bits(snapshot: &Snapshot) -> Vec<u32> {
    snapshot.bodies[0].rounded().map(f32::to_bits).collect()
}

#[test]
fn a_snapshot_has_the_positions_and_the_counts_of_its_step() {
    let mut rig = Rig::new();
    let (mut subscriber, mut reader) = rig.watched();
    let before = rig.rounded();
    let mut published = 0;
    for step in 1..=20 {
        rig.step(&mut subscriber);
        let snapshot = reader.newest().expect("a snapshot for each step");
        assert_eq!((snapshot.step, snapshot.time_ns), (step, step * 4_000_000));
        assert_eq!(bits(&snapshot), rig.rounded());
        let host = &snapshot.host;
        let counts = (host.steps, host.skipped, host.publications, host.faults);
        let stats = rig.engine.stats();
        assert_eq!(counts, (step, 5, stats.publications, 0));
        let [solve, condense] = host.stages;
        assert!(solve > Some(0.0) && host.medians[0] > 0.0, "{host:?}");
        published += u64::from(condense.is_some());
        assert_eq!(published, stats.publications);
        reader.give_back(snapshot);
        assert!(reader.newest().is_none());
    }
    assert!(published > 0);
    assert_ne!(rig.rounded(), before, "the body moves");
}

#[test]
fn the_host_goes_on_without_a_reader_and_copies_nothing_without_a_viewer() {
    let mut rig = Rig::new();
    let (mut subscriber, mut reader) = rig.watched();
    for _ in 0..10 {
        rig.step(&mut subscriber);
    }
    // There are three buffers, so the third step is the newest that the reader can see.
    let snapshot = reader.newest().expect("snapshots wait");
    assert_eq!(snapshot.step, 3);
    reader.give_back(snapshot);
    rig.step(&mut subscriber);
    assert_eq!(reader.newest().map(|snapshot| snapshot.step), Some(11));

    let (mut subscriber, mut reader) = Subscriber::watched(&rig.engine, Watchers::default());
    subscriber.after_step(rig.now, 0, 0, &rig.engine);
    assert!(reader.newest().is_none());
}

#[test]
fn copies_are_made_at_most_sixty_times_a_second() {
    let mut rig = Rig::new();
    let (mut subscriber, mut reader) = rig.watched();
    rig.step(&mut subscriber);
    let start = rig.now;
    let mut copies = 0;
    for millisecond in 1..1000 {
        let now = start + Duration::from_millis(millisecond);
        subscriber.after_step(now, 0, 0, &rig.engine);
        while let Some(snapshot) = reader.newest() {
            copies += 1;
            reader.give_back(snapshot);
        }
    }
    // The first step is among them.
    assert_eq!(copies, 60);
}

#[test]
fn the_mesh_goes_along_when_its_epoch_changes_even_if_the_snapshot_is_passed_over() {
    let mut rig = Rig::new();
    let (mut subscriber, mut reader) = rig.watched();
    rig.step(&mut subscriber);
    let snapshot = reader.newest().expect("a snapshot");
    assert!(snapshot.bodies[0].changed.is_none());
    let before = snapshot.bodies[0].epoch;
    reader.give_back(snapshot);

    let edits = vec![Edit::Release { handle: 0 }];
    rig.engine.change(0, edits).expect("a handle to release");
    // The change lands at a fixed step.
    while rig.engine.stats().changes == 0 {
        rig.step(&mut subscriber);
        if rig.engine.stats().changes == 0 {
            let snapshot = reader.newest().expect("a snapshot");
            reader.give_back(snapshot);
        }
        assert!(rig.engine.stats().steps < 1000, "the change lands");
    }
    rig.step(&mut subscriber);
    let snapshot = reader.newest().expect("two snapshots");
    let body = &snapshot.bodies[0];
    assert!(body.epoch > before);
    let changed = body.changed.as_ref().expect("the mesh goes along");
    assert_eq!(changed.positions().len(), body.positions.len());
    reader.give_back(snapshot);
    rig.step(&mut subscriber);
    let snapshot = reader.newest().expect("a snapshot");
    assert!(snapshot.bodies[0].changed.is_none());
}
