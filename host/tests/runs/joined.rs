//! Two bodies of the engine that are joined by springs.

use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::change::Edit;
use host::engine::pacer::Due;
use host::engine::stats::Stopwatch;
use host::scene::Scene;
use host::world::World;
use physics::motion::joined::{At, Joints};
use physics::{Body, BodyMap, Vec3};
use rt_core::{Pose, TickRecord};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use support::rig::{MS, Still};

/// Stiffness of a spring in every direction (N/m).
const STIFFNESS: f64 = 40.0;

/// Two sheets of 5 x 2 cells. Each has a hand at its far edge, and their near edges lie 2 cm apart.
const SCENE: &str = r#"
name = "joined"
gravity = [0.0, 0.0, 0.0]

[host]
step_rate = 250
publish_rate = 250

[[body]]
name = "left"
mesh = { sheet = { length = 0.1, width = 0.04, cells = [5, 2] } }
material = { young = 1e5, poisson = 0.3, thickness = 1e-3, density = 1000.0 }
damping = { mass = 20.0, stiffness = 0.002 }
handle = [{ name = "edge", group = "left", device = "a" }]

[[body]]
name = "right"
position = [0.12, 0.0, 0.0]
mesh = { sheet = { length = 0.1, width = 0.04, cells = [5, 2] } }
material = { young = 1e5, poisson = 0.3, thickness = 1e-3, density = 1000.0 }
damping = { mass = 20.0, stiffness = 0.002 }
handle = [{ name = "edge", group = "right", device = "b" }]

[[device]]
name = "a"
model = "virtuose6d"
hand = { grip = "rigid" }

[[device]]
name = "b"
model = "virtuose6d"
hand = { grip = "rigid" }
"#;

/// Springs without length between vertices of the two bodies that lie opposite each other at rest.
struct Springs {
    /// Whether the springs follow a body whose mesh is replaced by a copy.
    follows: bool,
    /// The ends of each spring, and their distance at rest.
    ends: Vec<([At; 2], Vec3)>,
    /// The force on the first end of each spring at the start of the step (N).
    forces: Vec<Vec3>,
    at: [Vec<Vec3>; 2],
}

impl Joints for Springs {
    fn begin(&mut self, body: usize, state: &Body, _h: f64) {
        self.at[body] = state.node_positions().to_vec();
        if body == 1 {
            let of = |at: At| self.at[at.body][at.node as usize];
            let springs = self.ends.iter();
            self.forces = springs
                .map(|([a, b], rest)| (of(*b) - of(*a) - rest) * STIFFNESS)
                .collect();
        }
    }

    fn forces(&self, of: &dyn Fn(At) -> Vec3, add: &mut dyn FnMut(At, Vec3)) {
        for (([a, b], _), force) in self.ends.iter().zip(&self.forces) {
            let force = force + (of(*b) - of(*a)) * STIFFNESS;
            add(*a, force);
            add(*b, -force);
        }
    }

    fn product(&self, of: &dyn Fn(At) -> Vec3, add: &mut dyn FnMut(At, Vec3)) {
        for ([a, b], _) in &self.ends {
            let product = (of(*b) - of(*a)) * STIFFNESS;
            add(*a, -product);
            add(*b, product);
        }
    }

    fn follow(&mut self, body: usize, map: &BodyMap) -> bool {
        for at in self.ends.iter_mut().flat_map(|(ends, _)| ends) {
            let new = map.vertices.iter().position(|old| *old == at.node);
            if let Some(new) = new.filter(|_| at.body == body) {
                at.node = new as u32;
            }
        }
        self.follows
    }
}

/// The engine of the scene, and springs between the near edges.
fn engine() -> (Engine, Springs) {
    built(SCENE, BuildOptions::default())
}

fn built(scene: &str, how: BuildOptions) -> (Engine, Springs) {
    let loaded = Scene::load_texts("joined.toml", scene, &BTreeMap::new()).expect("a scene");
    let world = World::new(&loaded).expect("a world");
    let engine = Engine::new(bodies(&world, how).expect("bodies"));
    let at = [0, 1].map(|body| engine.bodies()[body].body().node_positions().to_vec());
    let edge = |body: usize, x: f64| {
        let nodes = at[body].iter().enumerate();
        nodes.filter_map(move |(node, place)| {
            let at = At {
                body,
                node: node as u32,
            };
            ((place.x - x).abs() < 1e-9).then_some((at, *place))
        })
    };
    let pairs = edge(0, 0.05).flat_map(|(a, from)| {
        let opposite = edge(1, 0.07).filter(move |(_, to)| (to.y - from.y).abs() < 1e-9);
        opposite.map(move |(b, to)| ([a, b], to - from))
    });
    let springs = Springs {
        follows: true,
        ends: pairs.collect(),
        forces: Vec::new(),
        at: Default::default(),
    };
    assert_eq!(springs.ends.len(), 3);
    (engine, springs)
}

/// Makes a step in which the left hand pulls by `pull` (m) and the right hand is moved by `right` (m) along x. Hands rest
/// where the handles began.
fn step(engine: &mut Engine, step: u64, [pull, right]: [f64; 2], watch: &dyn Stopwatch) {
    let mut record = TickRecord::empty();
    record.tick = 4 * step;
    record.time_ns = record.tick * MS;
    record.device_count = 2;
    for (proxy, x) in record.proxies.iter_mut().zip([-0.05 - pull, 0.17 + right]) {
        proxy.0 = Pose::at(Vec3::new(x, 0.0, 0.0));
    }
    engine.follow(&record);
    let due = Due {
        time_ns: record.time_ns,
        publishes: true,
    };
    engine.step(due, watch, &mut |_, _| {});
}

/// The forces of the hands on their bodies (N) after the left hand has pulled by `pull` (m) for some seconds, from step
/// `from` on.
fn pulled(engine: &mut Engine, pull: f64, from: u64) -> [Vec3; 2] {
    for number in from..from + 2000 {
        let pull = pull * (number as f64 / 500.0).min(1.0);
        step(engine, number, [pull, 0.0], &Still);
    }
    [0, 1].map(|body| {
        let report = engine.bodies()[body].body().handle_report(0);
        report.expect("a handle").wrench_on_hand.force
    })
}

/// A change that replaces a body by a copy of itself.
fn replaced() -> Vec<Edit> {
    let copied = |body: Body| {
        let map = BodyMap::identity(&body);
        Ok((body, map))
    };
    vec![Edit::Replace(Box::new(copied))]
}

#[test]
fn a_pull_passes_through_the_springs_to_the_other_hand() {
    let (mut engine, springs) = engine();
    let ends = springs.ends.clone();
    engine.join(vec![0, 1], Box::new(springs));
    let [left, right] = pulled(&mut engine, 0.01, 1);
    assert_eq!(engine.stats().faults, 0);
    // At rest each hand holds the springs.
    let at = |at: At| engine.bodies()[at.body].body().node_positions()[at.node as usize];
    let springs = ends.iter();
    let pull: Vec3 = springs
        .map(|([a, b], rest)| (at(*b) - at(*a) - rest) * STIFFNESS)
        .sum();
    println!("{left} {right} {pull}");
    // The steps are solved to 1e-6 of their forces.
    assert!(pull.x > 0.1, "{pull}");
    assert!((left - pull).norm() < 1e-4 * pull.norm(), "{left} {pull}");
    assert!((right + pull).norm() < 1e-4 * pull.norm(), "{right} {pull}");
}

#[test]
fn bodies_that_are_not_joined_feel_nothing_of_each_other() {
    let (mut engine, _) = engine();
    let [_, right] = pulled(&mut engine, 0.01, 1);
    assert!(right.norm() < 1e-9, "{right}");
}

#[test]
fn springs_follow_a_body_that_is_replaced_or_let_it_go() {
    for follows in [true, false] {
        let (mut engine, springs) = engine();
        engine.join(vec![0, 1], Box::new(Springs { follows, ..springs }));
        let [_, before] = pulled(&mut engine, 0.01, 1);
        engine.change(0, replaced()).expect("a change");
        engine.change(1, replaced()).expect("a change");
        let [_, after] = pulled(&mut engine, 0.01, 2001);
        let stats = engine.stats();
        assert_eq!(stats.changes, 2);
        assert!(before.x < -0.1, "{before}");
        if follows {
            assert_eq!(stats.faults, 0);
            assert!(
                (after - before).norm() < 1e-4 * before.norm(),
                "{after} {before}"
            );
        } else {
            // The bodies part once, and the right hand holds nothing any more.
            assert_eq!(stats.faults, 1);
            assert!(
                stats
                    .first_fault
                    .as_ref()
                    .is_some_and(|fault| fault.contains("joints"))
            );
            assert!(after.norm() < 1e-6 * before.norm(), "{after}");
        }
    }
}

#[test]
fn the_other_body_goes_on_while_one_fails() {
    let (mut engine, springs) = engine();
    engine.join(vec![0, 1], Box::new(springs));
    let [before, _] = pulled(&mut engine, 0.01, 1);
    let still = engine.bodies()[1].body().node_positions().to_vec();
    for number in 2001..4001 {
        // The right hand is where no step reaches it, and the left hand pulls twice as far.
        step(&mut engine, number, [0.02, 1e200], &Still);
    }
    let stats = engine.stats();
    assert_eq!(stats.faults, 2000);
    assert!(
        stats
            .first_fault
            .as_ref()
            .is_some_and(|fault| fault.starts_with("body 1"))
    );
    assert_eq!(engine.bodies()[1].body().node_positions(), still);
    let report = engine.bodies()[0]
        .body()
        .handle_report(0)
        .expect("a handle");
    let after = report.wrench_on_hand.force;
    // The right body stands still, so its half of the stretch is missing: the left hand pulls more than twice as hard.
    assert!(
        after.x > 2.0 * before.x && before.x > 0.1,
        "{after} {before}"
    );
}

/// A clock that is read every 0.1 ms.
#[derive(Default)]
struct Busy(AtomicU64);

impl Stopwatch for Busy {
    fn now_ns(&self) -> u64 {
        self.0.fetch_add(MS / 10, Ordering::Relaxed)
    }
}

#[test]
fn the_budget_of_a_step_ends_the_solution_of_joined_bodies() {
    let unconverged = |budget: &str| {
        let scene = SCENE.replace("[host]", &format!("[host]\nbudget = {budget}"));
        let how = BuildOptions {
            real: true,
            ..BuildOptions::default()
        };
        let (mut engine, springs) = built(&scene, how);
        engine.join(vec![0, 1], Box::new(springs));
        for number in 1..100 {
            step(
                &mut engine,
                number,
                [1e-4 * number as f64, 0.0],
                &Busy::default(),
            );
        }
        for body in engine.bodies() {
            assert!(
                body.body()
                    .node_positions()
                    .iter()
                    .all(|x| x.norm().is_finite())
            );
        }
        engine.stats().unconverged
    };
    // A tenth of a millisecond goes by between two looks at the clock: a budget of 0.3 ms leaves one iteration.
    assert!(unconverged("0.0003") > 20);
    assert_eq!(unconverged("1.0"), 0);
}
