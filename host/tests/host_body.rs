//! A body in the host loop after a stall: a handle catches up with its hand at a speed that a hand could have, no model
//! is published until then, and no tick is published twice. The tests use the engine, on the built-in sheet.

use host::engine::Engine;
use host::engine::build::{How, bodies};
use host::engine::pacer::Due;
use host::engine::stats::Stopwatch;
use host::scene::Scene;
use rt_core::{LocalModel, Pose, TickRecord, Vec3};

/// A speed (m/s) that a handle never reaches while it catches up with a resting hand. It is above the limit of the
/// engine (0.5 m/s beyond the speed of the hand), and far below the speed that would cover the displacement of these
/// tests in one step (5 m/s).
const FASTEST: f64 = 1.0;
/// Displacement of the hand during the stall (m).
const FAR: f64 = 0.02;
/// The number of ticks between two host steps: 250 Hz.
const TICKS: u64 = 4;
const STEP: f64 = 4e-3;
const MS: u64 = 1_000_000;

/// A clock that never advances, because no state depends on it.
struct Still;

impl Stopwatch for Still {
    fn now_ns(&self) -> u64 {
        0
    }
}

/// The engine of the built-in scene, and the poses of its handles.
struct Rig {
    engine: Engine,
    rest: Vec<Pose>,
    tick: u64,
    published: Vec<LocalModel>,
}

impl Rig {
    /// The rig after half a second at rest, with published models.
    fn new() -> Self {
        let loaded = Scene::embedded_default().expect("the built-in scene");
        assert_eq!(loaded.scene.host.step_rate * STEP, 1.0);
        let bodies = bodies(&loaded, How::default()).expect("it can be built");
        let body = bodies[0].body();
        let handles = (0..).map_while(|index| body.handle_report(index));
        let rest: Vec<_> = handles
            .map(|report| Pose {
                position: report.pose.position,
                rotation: report.pose.rotation,
            })
            .collect();
        let mut rig = Self {
            engine: Engine::new(bodies),
            rest,
            tick: 0,
            published: Vec::new(),
        };
        for _ in 0..125 {
            rig.follow(TICKS, |_| 0.0);
            rig.step();
        }
        assert!(rig.published.len() > 100);
        let last = rig.published.last().expect("published");
        // The tests below rely on equal numbers of device and handle.
        assert!(last.handles().zip(0..).all(|(h, index)| h.device == index));
        rig
    }

    /// Runs `count` ticks in which the second hand is displaced along x by `away` (m) of the number of the tick.
    fn follow(&mut self, count: u64, away: impl Fn(u64) -> f64) {
        for _ in 0..count {
            let mut record = TickRecord::empty();
            record.tick = self.tick;
            record.time_ns = self.tick * MS;
            record.device_count = self.rest.len() as u8;
            for (proxy, rest) in record.proxies.iter_mut().zip(&self.rest) {
                proxy.0 = *rest;
            }
            record.proxies[1].0.position.x += away(self.tick);
            self.engine.follow(&record);
            self.tick += 1;
        }
    }

    /// Takes a step that is due to publish. Returns the number of published models.
    fn step(&mut self) -> usize {
        let before = self.published.len();
        let due = Due {
            time_ns: self.tick * MS,
            publishes: true,
        };
        let published = &mut self.published;
        self.engine
            .step(due, &Still, |_, model| published.push(*model));
        self.published.len() - before
    }

    /// Displacement of the second handle from its place at rest (m).
    fn handle(&self) -> Vec3 {
        let report = self.engine.bodies()[0].body().handle_report(1);
        report.expect("two handles").pose.position - self.rest[1].position
    }
}

#[test]
fn a_handle_catches_up_no_faster_than_a_hand_and_then_publishes() {
    let mut rig = Rig::new();
    // The host stalls for two seconds, in which the hand moves and then rests.
    rig.tick += 2000;
    let before = rig.published.len();
    let (mut last, mut steps) = (rig.handle(), 0);
    loop {
        rig.follow(TICKS, |_| FAR);
        let published = rig.step();
        steps += 1;
        let handle = rig.handle();
        let speed = (handle - last).norm() / STEP;
        assert!(speed < FASTEST, "{speed} m/s in step {steps}");
        last = handle;
        let there = (handle.x - FAR).abs() < 1e-6;
        assert!(
            there || published == 0,
            "a blow is published in step {steps}"
        );
        if there && published > 0 {
            break;
        }
        assert!(steps < 100, "the hand is never reached: {handle}");
    }
    // Below a metre a second, the handle needs more than five steps; at half of that speed, ten or eleven.
    assert!(steps > 5, "{steps}");
    assert_eq!(rig.published.len(), before + 1);
    assert_eq!(rig.engine.stats().faults, 0);
}

#[test]
fn a_fast_hand_is_followed_and_published_in_every_step() {
    let mut rig = Rig::new();
    let start = rig.tick;
    // The hand oscillates by 20 mm, at 0.5 m/s at most. A handle may catch up at that speed, and no model is withheld.
    let omega = 25.0;
    let away = |tick: u64| 0.02 * (omega * (tick - start) as f64 * 1e-3).sin();
    for step in 0..100 {
        rig.follow(TICKS, away);
        assert_eq!(rig.step(), 1, "step {step}");
        // The filter of the path has a cut-off of tens of Hz and no lag at constant velocity. Its error is below the
        // acceleration of the hand, 12 m/s^2, times the square of its memory of some ms.
        let off = (rig.handle().x - away(rig.tick - 1)).abs();
        assert!(off < 1e-3, "{off} m behind in step {step}");
    }
}

#[test]
fn no_tick_is_published_twice() {
    let mut rig = Rig::new();
    rig.follow(TICKS, |_| 0.0);
    assert_eq!(rig.step(), 1);
    // The host takes steps before the next record arrives. Its time advances by ten milliseconds, which are three
    // steps, the last a short one. Then its time stands still.
    let published: Vec<usize> = (0..6).map(|_| rig.step()).collect();
    assert_eq!(published, [1, 1, 1, 0, 0, 0]);
    rig.follow(3 * TICKS, |_| 0.0);
    assert_eq!(rig.step(), 1);
    for pair in rig.published.array_windows() {
        let [before, after] = pair;
        assert!(after.time_ns > before.time_ns);
        assert_eq!(after.sequence, before.sequence + 1);
    }
}

#[test]
fn before_the_first_tick_no_model_is_published() {
    let loaded = Scene::embedded_default().expect("the built-in scene");
    let bodies = bodies(&loaded, How::default()).expect("it can be built");
    let mut engine = Engine::new(bodies);
    let due = Due {
        time_ns: 0,
        publishes: true,
    };
    engine.step(due, &Still, |_, _| panic!("no tick has been recorded"));
}
