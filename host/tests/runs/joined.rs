//! Two bodies of the engine that are joined by springs.

use crate::rig::{MS, Still};
use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::pacer::Due;
use host::scene::Scene;
use host::world::World;
use physics::motion::joined::{At, Joints};
use physics::{Body, Vec3};
use rt_core::{Pose, TickRecord};
use std::collections::BTreeMap;

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
}

/// The engine of the scene, and springs between the near edges.
fn engine() -> (Engine, Springs) {
    let loaded = Scene::load_texts("joined.toml", SCENE, &BTreeMap::new()).expect("a scene");
    let world = World::new(&loaded).expect("a world");
    let engine = Engine::new(bodies(&world, BuildOptions::default()).expect("bodies"));
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
        ends: pairs.collect(),
        forces: Vec::new(),
        at: Default::default(),
    };
    assert_eq!(springs.ends.len(), 3);
    (engine, springs)
}

/// The forces of the hands on their bodies (N) after the left hand has pulled by `pull` (m) for some seconds.
fn pulled(engine: &mut Engine, pull: f64) -> [Vec3; 2] {
    let reports = [0, 1].map(|body| engine.bodies()[body].body().handle_report(0));
    let rest = reports.map(|report| report.expect("a handle").pose);
    for step in 1..2000_u64 {
        let mut record = TickRecord::empty();
        record.tick = 4 * step;
        record.time_ns = record.tick * MS;
        record.device_count = 2;
        for (proxy, pose) in record.proxies.iter_mut().zip(&rest) {
            proxy.0 = Pose {
                position: pose.position,
                rotation: pose.rotation,
            };
        }
        record.proxies[0].0.position.x -= pull * (step as f64 / 500.0).min(1.0);
        engine.follow(&record);
        let due = Due {
            time_ns: record.time_ns,
            publishes: true,
        };
        engine.step(due, &Still, &mut |_, _| {});
    }
    assert_eq!(engine.stats().faults, 0);
    [0, 1].map(|body| {
        let report = engine.bodies()[body].body().handle_report(0);
        report.expect("a handle").wrench_on_hand.force
    })
}

#[test]
fn a_pull_passes_through_the_springs_to_the_other_hand() {
    let (mut engine, springs) = engine();
    let ends = springs.ends.clone();
    engine.join(vec![0, 1], Box::new(springs));
    let [left, right] = pulled(&mut engine, 0.01);
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
    let [_, right] = pulled(&mut engine, 0.01);
    assert!(right.norm() < 1e-9, "{right}");
}
