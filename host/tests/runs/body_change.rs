//! Changes of a body in the host loop: hands take hold and let go, supports come and go, and a mesh is replaced while
//! the body moves. The new solver is made in the background, and the old one serves until then.

use host::world::World;

use host::engine::Engine;
use host::engine::build::{BuildOptions, bodies};
use host::engine::change::{ChangeError, Edit, Grip};
use host::engine::pacer::Due;
use host::engine::virtual_coupling::Spring;
use host::scene::spec::{SchemeName, SolverName};
use host::scene::{LoadedScene, Scene};
use physics::{Body, BodyMap, Border, Freedom, HandleSpec};
use rt_core::{LocalModel, Pose, TickRecord, Vec3};
use std::collections::BTreeMap;
use support::rig::{MS, Rig, Still};

/// Ticks between two host steps: 250 Hz.
const TICKS: u64 = 4;
/// Steps until a change lands in virtual time: 50 ms of 4 ms each, rounded up.
const LANDING: usize = 13;

fn scene() -> LoadedScene {
    Scene::embedded_default().expect("the built-in scene")
}

/// The second hand pulls by 5 mm, to and fro at 1 Hz.
fn pull(tick: u64, hands: &mut [Pose]) {
    let time = tick as f64 * 1e-3;
    hands[1].position.x += 5e-3 * (core::f64::consts::TAU * time).sin();
}

fn steps(rig: &mut Rig, count: usize) {
    for _ in 0..count {
        rig.follow(TICKS, pull);
        rig.step();
    }
}

/// A rig in motion, with a third hand that holds nothing yet.
fn moving(loaded: &LoadedScene, how: BuildOptions) -> Rig {
    let mut rig = Rig::new(loaded, how);
    let between = (rig.rest[0].position + rig.rest[1].position) * 0.5;
    rig.rest.push(Pose::at(between));
    steps(&mut rig, 60);
    rig
}

fn body(rig: &Rig) -> &Body {
    rig.engine.bodies()[0].body()
}

/// The vertices nearest to the middle between the hands, which no handle holds.
fn middle(rig: &Rig) -> Vec<u32> {
    let at = rig.rest[2].position;
    let mut numbered: Vec<(u32, f64)> = (0..)
        .zip(body(rig).positions().map(|x| (x - at).norm()))
        .collect();
    numbered.sort_by(|a, b| a.1.total_cmp(&b.1));
    numbered.iter().take(4).map(|(vertex, _)| *vertex).collect()
}

fn grab(rig: &Rig, link: Option<Spring>) -> Edit {
    Edit::Grab(Grip {
        spec: HandleSpec {
            vertices: middle(rig),
            origin: rig.rest[2].position,
            freedom: Freedom::Translation,
            border: Border::Hinged,
        },
        device: 2,
        link,
    })
}

fn devices(model: &LocalModel) -> Vec<u8> {
    model.handles().map(|handle| handle.device).collect()
}

fn forces(model: &LocalModel) -> Vec<Vec3> {
    model.handles().map(|handle| handle.wrench.force).collect()
}

/// The largest change of the first two hands' forces from one model to the next, from model `from` on (N).
fn largest_step(published: &[LocalModel], from: usize) -> f64 {
    let mut largest: f64 = 0.0;
    for pair in published[from..].windows(2) {
        let [before, after] = pair else { continue };
        for (a, b) in forces(before).iter().zip(&forces(after)) {
            largest = largest.max((a - b).norm());
        }
    }
    largest
}

#[test]
fn a_hand_takes_hold_at_a_fixed_step_while_the_old_solver_serves() {
    let run = || {
        let mut rig = moving(&scene(), BuildOptions::default());
        let before = rig.published.len();
        let usual = largest_step(&rig.published, before - 25);
        let edit = grab(&rig, None);
        rig.engine.change(0, vec![edit]).unwrap();
        steps(&mut rig, LANDING - 1);
        assert!(rig.engine.bodies()[0].is_changing());
        assert_eq!(rig.published.len(), before + LANDING - 1);
        assert_eq!(devices(rig.published.last().unwrap()), [0, 1]);
        let positions: Vec<Vec3> = body(&rig).positions().collect();

        steps(&mut rig, 1);
        let last = *rig.published.last().unwrap();
        assert!(!rig.engine.bodies()[0].is_changing());
        assert_eq!((last.head.epoch, devices(&last)), (1, vec![0, 1, 2]));
        assert_eq!(last.head.sequence as usize, rig.published.len());
        // No vertex jumps: none moves by more than the hand does in a step, which is 0.13 mm at most.
        for (x, was) in body(&rig).positions().zip(&positions) {
            assert!((x - was).norm() < 2e-4, "{}", (x - was).norm());
        }
        steps(&mut rig, 100);
        assert_eq!(
            (rig.engine.stats().changes, rig.engine.stats().faults),
            (1, 0)
        );
        (rig.published, usual)
    };
    let (published, usual) = run();
    // The hands feel the middle held, but no blow: a step of the force grows by less than the stiffness does, which is
    // doubled where half of the sheet is pulled.
    let step = largest_step(&published, 60);
    assert!(step < 3.0 * usual, "{step} N after {usual} N");
    // The held middle resists: the third hand feels a force.
    let third = forces(published.last().unwrap())[2].norm();
    assert!(third > 0.01, "{third} N");
    assert_eq!(published, run().0);
}

#[test]
fn a_hand_lets_go_and_the_others_continue() {
    let mut rig = moving(&scene(), BuildOptions::default());
    let edit = grab(&rig, None);
    rig.engine.change(0, vec![edit]).unwrap();
    steps(&mut rig, LANDING + 20);
    rig.engine
        .change(0, vec![Edit::Release { handle: 0 }])
        .unwrap();
    steps(&mut rig, LANDING);
    let last = rig.published.last().unwrap();
    assert_eq!((last.head.epoch, devices(last)), (2, vec![1, 2]));
    // The released edge follows, and in the end nothing pulls at the second hand but damping and weight.
    for _ in 0..1000 {
        rig.follow(TICKS, |_, _| {});
        rig.step();
    }
    assert_eq!(rig.engine.stats().faults, 0);
    let at_rest = rig.published.last().unwrap();
    let energies: Vec<f64> = rig
        .published
        .iter()
        .map(|model| model.head.energy)
        .collect();
    assert!(
        energies
            .iter()
            .all(|energy| energy.is_finite() && *energy >= 0.0)
    );
    assert!(at_rest.handles().all(|handle| handle.wrench.is_finite()));
}

#[test]
fn all_hands_let_go_and_one_takes_hold_again() {
    let mut rig = moving(&scene(), BuildOptions::default());
    let release = |handle| Edit::Release { handle };
    rig.engine.change(0, vec![release(1), release(0)]).unwrap();
    steps(&mut rig, LANDING - 1);
    let before = rig.published.len();
    // The force fades with the age of the last model: no hand feels the body, so nothing more is published.
    steps(&mut rig, 6);
    assert_eq!(
        (rig.published.len(), rig.engine.stats().changes),
        (before, 1)
    );
    let edit = grab(&rig, None);
    rig.engine.change(0, vec![edit]).unwrap();
    steps(&mut rig, LANDING + 5);
    let last = rig.published.last().unwrap();
    assert_eq!((last.head.epoch, devices(last)), (2, vec![2]));
    assert_eq!(rig.engine.stats().faults, 0);
}

#[test]
fn a_support_comes_and_goes() {
    let mut rig = moving(&scene(), BuildOptions::default());
    let vertices = middle(&rig);
    let guide = Edit::Guide {
        vertices: vertices.clone(),
        axes: [false, false, true],
    };
    rig.engine.change(0, vec![guide]).unwrap();
    let height = |rig: &Rig| body(rig).positions().nth(vertices[0] as usize).unwrap().z;
    steps(&mut rig, LANDING - 1);
    let before = height(&rig);
    steps(&mut rig, 50);
    // The support guides the vertices from where they were when it came, to the rounding of a step.
    assert!((height(&rig) - before).abs() < 1e-12);
    rig.engine
        .change(0, vec![Edit::Lift { support: 0 }])
        .unwrap();
    steps(&mut rig, LANDING + 50);
    assert_eq!(body(&rig).support_count(), 0);
    assert_eq!(
        (rig.engine.stats().changes, rig.engine.stats().faults),
        (2, 0)
    );
}

#[test]
fn a_clamp_comes_and_a_hand_takes_its_place() {
    let mut rig = moving(&scene(), BuildOptions::default());
    // The vertices in the middle of the lower border.
    let rest: Vec<Vec3> = body(&rig).positions().collect();
    let lowest = rest.iter().map(|x| x.y).fold(f64::INFINITY, f64::min);
    let middle = rig.rest[2].position.x;
    let chosen = |x: &Vec3| x.y < lowest + 1e-3 && (x.x - middle).abs() < 0.03;
    let numbered = (0_u32..).zip(&rest).filter(|(_, x)| chosen(x));
    let vertices: Vec<u32> = numbered.map(|(vertex, _)| vertex).collect();
    assert!(vertices.len() > 2);
    let clamped = body(&rig).vertex_count() + vertices.len() - 1;

    let clamp = Edit::Clamp {
        vertices: vertices.clone(),
    };
    rig.engine.change(0, vec![clamp]).unwrap();
    steps(&mut rig, LANDING + 20);
    assert_eq!(body(&rig).node_positions().len(), clamped);
    assert_eq!(body(&rig).positions().len(), rest.len());
    let before: Vec<Vec3> = body(&rig).positions().collect();

    let grip = Edit::Grab(Grip {
        spec: HandleSpec {
            vertices: vertices.clone(),
            origin: rig.rest[2].position,
            freedom: Freedom::Rigid,
            border: Border::Clamped,
        },
        device: 2,
        link: None,
    });
    rig.engine
        .change(0, vec![Edit::Lift { support: 0 }, grip])
        .unwrap();
    steps(&mut rig, LANDING + 20);
    assert_eq!(body(&rig).node_positions().len(), clamped);
    assert_eq!(devices(rig.published.last().unwrap()), [0, 1, 2]);
    // Support and hand are at rest, and hold the vertices where they were.
    for &vertex in &vertices {
        let now = body(&rig).positions().nth(vertex as usize).unwrap();
        assert!((now - before[vertex as usize]).norm() < 1e-12);
    }
    assert_eq!(
        (rig.engine.stats().changes, rig.engine.stats().faults),
        (2, 0)
    );
}

/// A change that replaces the body by a copy of itself, with another solver.
fn replace() -> Edit {
    Edit::Replace(Box::new(|body: Body| {
        let map = BodyMap::identity(&body);
        Ok((body, map))
    }))
}

#[test]
fn a_replaced_body_continues_the_motion() {
    let run = |replaces: bool| {
        let mut rig = moving(&scene(), BuildOptions::default());
        if replaces {
            rig.engine.change(0, vec![replace()]).unwrap();
        }
        steps(&mut rig, LANDING + 50);
        rig
    };
    let (same, replaced) = (run(false), run(true));
    assert_eq!(replaced.engine.stats().changes, 1);
    for (a, b) in same.published.iter().zip(&replaced.published) {
        for (a, b) in forces(a).iter().zip(&forces(b)) {
            // Both solve to 1e-6 of forces of at most a few newton, from other starts.
            assert!((a - b).norm() < 1e-4, "{}", (a - b).norm());
        }
    }
}

#[test]
fn under_the_real_clock_a_thread_makes_the_solver() {
    let how = BuildOptions {
        real: true,
        ..BuildOptions::default()
    };
    let mut rig = moving(&scene(), how);
    let edit = grab(&rig, None);
    rig.engine.change(0, vec![edit]).unwrap();
    let mut count = 0;
    while rig.engine.bodies()[0].is_changing() {
        let before = rig.published.len();
        steps(&mut rig, 1);
        assert_eq!(rig.published.len(), before + 1);
        count += 1;
        assert!(count < 1_000_000, "the change never lands");
    }
    assert_eq!(devices(rig.published.last().unwrap()), [0, 1, 2]);
    steps(&mut rig, 20);
    assert_eq!(
        (rig.engine.stats().changes, rig.engine.stats().faults),
        (1, 0)
    );
}

#[test]
fn every_solver_and_scheme_takes_a_change() {
    for solver in [SolverName::Frozen, SolverName::Incomplete] {
        for scheme in [SchemeName::Capped, SchemeName::Linear, SchemeName::Proxy] {
            let mut loaded = scene();
            loaded.scene.host.solver = solver;
            loaded.scene.realtime.scheme = scheme;
            let mut rig = moving(&loaded, BuildOptions::default());
            let link = Spring {
                stiffness: 500.0,
                damping: 1.0,
            };
            let edit = grab(&rig, (scheme == SchemeName::Proxy).then_some(link));
            rig.engine.change(0, vec![edit]).unwrap();
            steps(&mut rig, LANDING + 20);
            rig.engine
                .change(0, vec![Edit::Release { handle: 1 }])
                .unwrap();
            steps(&mut rig, LANDING + 20);
            let last = rig.published.last().unwrap();
            assert_eq!(devices(last), [0, 2], "{solver:?} {scheme:?}");
            let stats = rig.engine.stats();
            assert_eq!(
                (stats.changes, stats.faults),
                (2, 0),
                "{solver:?} {scheme:?}"
            );
        }
    }
}

#[test]
fn what_cannot_be_changed_is_refused_and_the_body_continues() {
    let mut rig = moving(&scene(), BuildOptions::default());
    let mut undisturbed = moving(&scene(), BuildOptions::default());
    let refused = rig.engine.change(7, Vec::new()).unwrap_err();
    assert_eq!(refused, ChangeError::NoBody { body: 7, count: 1 });
    let edit = match grab(&rig, None) {
        Edit::Grab(grip) => Edit::Grab(Grip { device: 9, ..grip }),
        other => other,
    };
    let refused = rig.engine.change(0, vec![edit]).unwrap_err();
    assert_eq!(refused, ChangeError::NoDevice { device: 9 });

    // The work finds that there is no handle 5. Until then no other change may begin.
    rig.engine
        .change(0, vec![Edit::Release { handle: 5 }])
        .unwrap();
    let refused = rig.engine.change(0, Vec::new()).unwrap_err();
    assert_eq!(refused, ChangeError::UnderWay);
    steps(&mut rig, LANDING);
    let stats = rig.engine.stats();
    assert_eq!((stats.changes, stats.faults), (0, 1));
    let told = stats.first_fault.clone().unwrap();
    assert_eq!(
        told,
        "body 0: change: handle 5 does not exist: the body has 2 handles, counted from 0"
    );
    steps(&mut undisturbed, LANDING);
    assert_eq!(rig.published, undisturbed.published);
}

#[test]
fn a_scheme_with_proxies_needs_a_link_for_each_grip() {
    let mut loaded = scene();
    loaded.scene.realtime.scheme = SchemeName::Proxy;
    let mut rig = moving(&loaded, BuildOptions::default());
    let edit = grab(&rig, None);
    let refused = rig.engine.change(0, vec![edit]).unwrap_err();
    assert_eq!(refused, ChangeError::NoLink { device: 2 });
}

#[test]
fn a_body_that_nobody_holds_moves_and_publishes_nothing() {
    let loose = r#"
[[body]]
name = "loose"
mesh.thread = { length = 0.1, segments = 5 }
material = { young = 6.4e6, poisson = 0.45, area = 3.14e-6, density = 1100.0 }
[[body.support]]
name = "left end"
group = "left"
"#;
    let text = format!("{}{loose}", include_str!("../../scenes/thread.toml"));
    let loaded = Scene::load_texts("x.toml", &text, &BTreeMap::new()).expect("a scene");
    let mut engine = Engine::new(
        bodies(&World::new(&loaded).unwrap(), BuildOptions::default()).expect("it can be built"),
    );
    let lowest = |engine: &Engine| {
        let heights = engine.bodies()[1].body().positions().map(|x| x.z);
        heights.fold(f64::INFINITY, f64::min)
    };
    let before = lowest(&engine);
    let mut published = [0, 0];
    for step in 1..=100_u64 {
        let mut record = TickRecord::empty();
        record.time_ns = step * 4 * MS;
        record.device_count = 2;
        for (device, proxy) in record.proxies.iter_mut().enumerate().take(2) {
            let report = engine.bodies()[0].body().handle_report(device);
            proxy.0 = Pose::at(report.expect("two handles").pose.position);
        }
        engine.follow(&record);
        let due = Due {
            time_ns: record.time_ns,
            publishes: true,
        };
        engine.step(due, &Still, &mut |body, _| published[body] += 1);
    }
    assert_eq!((published, engine.stats().faults), ([100, 0], 0));
    // The free end hangs or swings below the support.
    assert!(lowest(&engine) < before + 1e-3 && lowest(&engine) < -0.01);
}
