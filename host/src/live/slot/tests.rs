use super::*;
use crate::engine::build::{BuildOptions, bodies};
use crate::engine::change::Edit;
use crate::engine::pacer::Due;
use crate::engine::stats::WallStopwatch;
use crate::scene::Scene;
use crate::world::World;
use rt_core::TickRecord;

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

    fn slot(&self) -> (SlotWriter, SlotReader) {
        let watchers = Watchers::default();
        watchers.set(1);
        slot(&self.engine, watchers)
    }

    /// Steps, and offers the step to the slot.
    fn step(&mut self, writer: &mut SlotWriter) {
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
        writer.after_step_at(self.now, time_ns, 5, &self.engine);
    }

    fn rounded(&self) -> Vec<u32> {
        let positions = self.engine.bodies()[0].body().positions();
        positions
            .flat_map(|x| [x.x, x.y, x.z].map(|x| (x as f32).to_bits()))
            .collect()
    }
}

fn bits(moment: &Moment) -> Vec<u32> {
    let positions = moment.bodies[0].positions.iter();
    positions.map(|x| x.to_bits()).collect()
}

#[test]
fn a_moment_has_the_positions_and_the_counts_of_its_step() {
    let mut rig = Rig::new();
    let (mut writer, mut reader) = rig.slot();
    let before = rig.rounded();
    let mut published = 0;
    for step in 1..=20 {
        rig.step(&mut writer);
        let moment = reader.newest().expect("a moment for each step");
        assert_eq!((moment.step, moment.time_ns), (step, step * 4_000_000));
        assert_eq!(bits(&moment), rig.rounded());
        let host = &moment.host;
        let counts = (host.steps, host.skipped, host.publications, host.faults);
        let stats = rig.engine.stats();
        assert_eq!(counts, (step, 5, stats.publications, 0));
        let [solve, condense] = host.stages;
        assert!(solve > Some(0.0) && host.medians[0] > 0.0, "{host:?}");
        published += u64::from(condense.is_some());
        assert_eq!(published, stats.publications);
        reader.give_back(moment);
        assert!(reader.newest().is_none());
    }
    assert!(published > 0);
    assert_ne!(rig.rounded(), before, "the body moves");
}

#[test]
fn the_host_goes_on_without_a_reader_and_copies_nothing_without_a_viewer() {
    let mut rig = Rig::new();
    let (mut writer, mut reader) = rig.slot();
    for _ in 0..10 {
        rig.step(&mut writer);
    }
    // There are three buffers, so the third step is the newest that the reader can see.
    let moment = reader.newest().expect("moments wait");
    assert_eq!(moment.step, 3);
    reader.give_back(moment);
    rig.step(&mut writer);
    assert_eq!(reader.newest().map(|moment| moment.step), Some(11));

    let (mut writer, mut reader) = slot(&rig.engine, Watchers::default());
    writer.after_step(0, 0, &rig.engine);
    assert!(reader.newest().is_none());
}

#[test]
fn copies_are_made_at_most_sixty_times_a_second() {
    let mut rig = Rig::new();
    let (mut writer, mut reader) = rig.slot();
    rig.step(&mut writer);
    let start = rig.now;
    let mut copies = 0;
    for millisecond in 1..1000 {
        let now = start + Duration::from_millis(millisecond);
        writer.after_step_at(now, 0, 0, &rig.engine);
        while let Some(moment) = reader.newest() {
            copies += 1;
            reader.give_back(moment);
        }
    }
    // The first step is among them.
    assert_eq!(copies, 60);
}

#[test]
fn the_mesh_goes_along_when_its_epoch_changes_even_where_the_moment_is_passed_over() {
    let mut rig = Rig::new();
    let (mut writer, mut reader) = rig.slot();
    rig.step(&mut writer);
    let moment = reader.newest().expect("a moment");
    assert!(moment.bodies[0].changed.is_none());
    let before = moment.bodies[0].epoch;
    reader.give_back(moment);

    let edits = vec![Edit::Release { handle: 0 }];
    rig.engine.change(0, edits).expect("a handle to release");
    // The change lands at a fixed step.
    while rig.engine.stats().changes == 0 {
        rig.step(&mut writer);
        if rig.engine.stats().changes == 0 {
            let moment = reader.newest().expect("a moment");
            reader.give_back(moment);
        }
        assert!(rig.engine.stats().steps < 1000, "the change lands");
    }
    rig.step(&mut writer);
    let moment = reader.newest().expect("two moments");
    let body = &moment.bodies[0];
    assert!(body.epoch > before);
    let changed = body.changed.as_ref().expect("the mesh goes along");
    assert_eq!(3 * changed.positions().len(), body.positions.len());
    reader.give_back(moment);
    rig.step(&mut writer);
    let moment = reader.newest().expect("a moment");
    assert!(moment.bodies[0].changed.is_none());
}
