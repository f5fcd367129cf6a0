//! A body in the host loop after a stall: a handle catches up with its hand at a speed that a hand could have, no model
//! is published until then, and no tick is published twice. The tests use the engine, on the built-in sheet.

use host::world::World;

use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::pacer::Due;
use host::scene::Scene;
use rt_core::Vec3;
use support::rig::{Rig, Still};

/// A speed (m/s) that a handle never reaches while it catches up with a resting hand. It is above the limit of the
/// engine (0.5 m/s beyond the speed of the hand), and far below the speed that would cover the displacement of these
/// tests in one step (5 m/s).
const FASTEST: f64 = 1.0;
/// Displacement of the hand during the stall (m).
const FAR: f64 = 0.02;
/// The number of ticks between two host steps: 250 Hz.
const TICKS: u64 = 4;
const STEP: f64 = 4e-3;

/// The rig of the built-in scene after half a second at rest, with published models.
fn rested() -> Rig {
    let loaded = Scene::embedded_default().expect("the built-in scene");
    assert_eq!(loaded.scene.host.step_rate * STEP, 1.0);
    let mut rig = Rig::new(&loaded, BuildOptions::default());
    for _ in 0..125 {
        rig.follow(TICKS, |_, _| {});
        rig.step();
    }
    assert!(rig.published.len() > 100);
    let last = rig.published.last().expect("published");
    // The tests below rely on equal numbers of device and handle.
    assert!(last.handles().zip(0..).all(|(h, index)| h.device == index));
    rig
}

/// Displacement of the second handle from its place at rest (m).
fn handle(rig: &Rig) -> Vec3 {
    let report = rig.engine.bodies()[0].body().handle_report(1);
    report.expect("two handles").pose.position - rig.rest[1].position
}

#[test]
fn a_handle_catches_up_no_faster_than_a_hand_and_then_publishes() {
    let mut rig = rested();
    // The host stalls for two seconds, in which the hand moves and then rests.
    rig.tick += 2000;
    let before = rig.published.len();
    let (mut last, mut steps) = (handle(&rig), 0);
    loop {
        rig.follow(TICKS, |_, hands| hands[1].position.x += FAR);
        let published = rig.step();
        steps += 1;
        let place = handle(&rig);
        let speed = (place - last).norm() / STEP;
        assert!(speed < FASTEST, "{speed} m/s in step {steps}");
        last = place;
        let there = (place.x - FAR).abs() < 1e-6;
        assert!(
            there || published == 0,
            "a blow is published in step {steps}"
        );
        if there && published > 0 {
            break;
        }
        assert!(steps < 100, "the hand is never reached: {place}");
    }
    // Below a metre a second, the handle needs more than five steps; at half of that speed, ten or eleven.
    assert!(steps > 5, "{steps}");
    assert_eq!(rig.published.len(), before + 1);
    assert_eq!(rig.engine.stats().faults, 0);
}

#[test]
fn a_fast_hand_is_followed_and_published_in_every_step() {
    let mut rig = rested();
    let start = rig.tick;
    // The hand oscillates by 20 mm, at 0.5 m/s at most. A handle may catch up at that speed, and no model is withheld.
    let omega = 25.0;
    let away = |tick: u64| 0.02 * (omega * (tick - start) as f64 * 1e-3).sin();
    for step in 0..100 {
        rig.follow(TICKS, |tick, hands| hands[1].position.x += away(tick));
        assert_eq!(rig.step(), 1, "step {step}");
        // The filter of the path has a cut-off of tens of Hz and no lag at constant velocity. Its error is below the
        // acceleration of the hand, 12 m/s^2, times the square of its memory of some ms.
        let off = (handle(&rig).x - away(rig.tick - 1)).abs();
        assert!(off < 1e-3, "{off} m behind in step {step}");
    }
}

#[test]
fn no_tick_is_published_twice() {
    let mut rig = rested();
    rig.follow(TICKS, |_, _| {});
    assert_eq!(rig.step(), 1);
    // The host takes steps before the next record arrives. Its time advances by ten milliseconds, which are three
    // steps, the last a short one. Then its time stands still.
    let published: Vec<usize> = (0..6).map(|_| rig.step()).collect();
    assert_eq!(published, [1, 1, 1, 0, 0, 0]);
    rig.follow(3 * TICKS, |_, _| {});
    assert_eq!(rig.step(), 1);
    for pair in rig.published.array_windows() {
        let [before, after] = pair;
        assert!(after.head.time_ns > before.head.time_ns);
        assert_eq!(after.head.sequence, before.head.sequence + 1);
    }
}

#[test]
fn before_the_first_tick_no_model_is_published() {
    let loaded = Scene::embedded_default().expect("the built-in scene");
    let bodies =
        bodies(&World::new(&loaded).unwrap(), BuildOptions::default()).expect("it can be built");
    let mut engine = Engine::new(bodies);
    let due = Due {
        time_ns: 0,
        publishes: true,
    };
    engine.step(due, &Still, &mut |_, _| panic!("no tick has been recorded"));
}
