//! A body in the host loop, where the host was late: a handle comes after its hand at a speed that a hand could have,
//! what is published on the way is withheld, and one tick is told of once. Through the engine, on the built-in sheet.

use host::engine::Engine;
use host::engine::build::{How, bodies};
use host::engine::pacer::Due;
use host::engine::stats::Stopwatch;
use host::scene::Scene;
use rt_core::{LocalModel, Pose, TickRecord, Vec3};

/// Faster than this (m/s) a handle never comes after a hand that rests: above what the engine allows (0.5 m/s on top of
/// the hand's own speed), and far below the way of these tests in one step (5 m/s).
const FASTEST: f64 = 1.0;
/// How far the hand went while the host stalled (m).
const FAR: f64 = 0.02;
/// Ticks from one host step to the next: 250 Hz.
const TICKS: u64 = 4;
const STEP: f64 = 4e-3;
const MS: u64 = 1_000_000;

/// No clock: nothing in the state depends on it.
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
    /// After half a second at rest, with models published.
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
        // What the tests below rely on: hand and handle have one number.
        assert!(last.handles().zip(0..).all(|(h, index)| h.device == index));
        rig
    }

    /// `count` ticks in which the second hand is off its place along x by `away` (m) of the tick's number.
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

    /// A step that is due to publish; how many models it published.
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

    /// Where the second handle is, from its place at rest (m).
    fn handle(&self) -> Vec3 {
        let report = self.engine.bodies()[0].body().handle_report(1);
        report.expect("two handles").pose.position - self.rest[1].position
    }
}

#[test]
fn a_handle_comes_after_its_hand_no_faster_than_a_hand_and_tells_when_it_is_there() {
    let mut rig = Rig::new();
    // Nobody follows for two seconds, in which the hand goes elsewhere and rests.
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
    // At less than a metre a second, the way takes more than five steps; at half of that, ten or eleven.
    assert!(steps > 5, "{steps}");
    assert_eq!(rig.published.len(), before + 1);
    assert_eq!(rig.engine.stats().faults, 0);
}

#[test]
fn a_hand_that_moves_fast_is_followed_and_told_of_in_every_step() {
    let mut rig = Rig::new();
    let start = rig.tick;
    // To and fro by 20 mm, at 0.5 m/s at most: as fast as a handle may catch up, and no reason to withhold anything.
    let omega = 25.0;
    let away = |tick: u64| 0.02 * (omega * (tick - start) as f64 * 1e-3).sin();
    for step in 0..100 {
        rig.follow(TICKS, away);
        assert_eq!(rig.step(), 1, "step {step}");
        // The filter of the path has a cut-off of tens of Hz and no lag at constant velocity: it errs by less than
        // the hand's acceleration, 12 m/s^2, over its memory of some ms.
        let off = (rig.handle().x - away(rig.tick - 1)).abs();
        assert!(off < 1e-3, "{off} m behind in step {step}");
    }
}

#[test]
fn no_time_is_told_of_twice() {
    let mut rig = Rig::new();
    rig.follow(TICKS, |_| 0.0);
    assert_eq!(rig.step(), 1);
    // The host steps on before the next record is there. Its time goes on for ten milliseconds: for three steps, the last
    // a short one. Then it stands.
    let told: Vec<usize> = (0..6).map(|_| rig.step()).collect();
    assert_eq!(told, [1, 1, 1, 0, 0, 0]);
    rig.follow(3 * TICKS, |_| 0.0);
    assert_eq!(rig.step(), 1);
    for pair in rig.published.array_windows() {
        let [before, after] = pair;
        assert!(after.time_ns > before.time_ns);
        assert_eq!(after.sequence, before.sequence + 1);
    }
}

#[test]
fn before_the_first_tick_nothing_is_told() {
    let loaded = Scene::embedded_default().expect("the built-in scene");
    let bodies = bodies(&loaded, How::default()).expect("it can be built");
    let mut engine = Engine::new(bodies);
    let due = Due {
        time_ns: 0,
        publishes: true,
    };
    engine.step(due, &Still, |_, _| panic!("of what time?"));
}
