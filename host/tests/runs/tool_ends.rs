//! The shipped scenes in which a surface ends below a tool: a ball goes over the edge of a rigid shelf, and a finger tears a hanging cloth.

use host::run::prepare::Options;
use host::run::session::Session;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::{Telemetry, Vec3};
use std::collections::BTreeMap;
use std::path::Path;

fn shipped(name: &str) -> LoadedScene {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    Scene::load(&scenes.join(name)).unwrap()
}

fn ticks(loaded: &LoadedScene, duration: f64) -> Vec<Telemetry> {
    let world = World::new(loaded).unwrap();
    let mut session = Session::new(&world, &Options::new(duration, 1)).unwrap();
    std::iter::from_fn(|| session.tick()).collect()
}

/// The ball sinks into no wall of the groove, although its triangles are longer than the reach of a patch, and is borne by the shelf. Over the
/// edge its force turns as the ball rolls: at most by its speed over its radius less the depth of the device, 1.4 degrees a millisecond.
#[test]
fn a_ball_slides_along_a_groove_and_over_an_edge() {
    let run = ticks(&shipped("edge.toml"), 2.5);
    let (mut deepest, mut in_groove, mut around) = (0.0_f64, 0, 0);
    for pair in run.windows(2) {
        let [before, now] = [0, 1].map(|at| pair[at].tools().next().unwrap());
        let (place, force) = (now.proxy.position, now.wrench.force);
        // Walls of 45 degrees meet in the x axis, up to x = 0. The top of the shelf is at 2 mm, and its edge at x = 38 mm.
        let edge = Vec3::new(place.x.min(0.038), place.y, place.z.min(0.002));
        let gap = match place.x {
            x if x < 0.0 => (place.z - place.y.abs()) * 0.5_f64.sqrt() - 0.005,
            _ => (place - edge).norm() - 0.005,
        };
        deepest = deepest.max(-gap);
        in_groove += u32::from(place.x < 0.0 && force.z > 1.0);
        if place.x < 0.038 || before.wrench.force.norm().min(force.norm()) < 0.05 {
            continue;
        }
        around += 1;
        let turn = force.angle(&before.wrench.force).to_degrees();
        assert!(turn < 2.0, "{}: {turn}", pair[1].tick);
        assert!(pair[1].devices().next().unwrap().twist.linear.norm() < 0.1);
    }
    assert!(deepest < 1e-6, "{deepest:e}");
    assert!(in_groove > 400 && around > 20, "{in_groove} {around}");
    let least = run.iter().map(|tick| tick.tools[0].energy.least);
    assert!(least.fold(0.0, f64::min) > -1e-3);
}

/// The number that follows a name in a text, such as `x -6.0`.
fn number(text: &str, name: &str) -> f64 {
    let mut words = text.split([' ', ',']).skip_while(|word| *word != name);
    words.nth(1).unwrap().parse().unwrap()
}

#[test]
fn a_finger_tears_a_hanging_cloth_where_it_pushes() {
    let loaded = shipped("burst.toml");
    let world = World::new(&loaded).unwrap();
    let run = run(&world, &RunOptions::new(Clock::Virtual), &mut |_| {}).unwrap();
    let (tears, tool) = (&run.tears[0], &run.tools[0]);
    let mut events = run.events.iter();
    let first = events.find(|event| event.description.contains("a tear started"));
    let first = first.unwrap();
    // The finger of 10 mm pushes the middle. The corners and the rods, where the cloth is held, tear later if at all.
    let [x, z] = ["x", "z"].map(|axis| number(&first.description, axis));
    assert!(x.hypot(z) < 10.0, "{}", first.description);
    // The force is largest when the tear grows. It is at most that of the strength all around the finger, 2 pi r t strength, and a fifth
    // of it at least: the cloth leaves the finger at the side.
    let most = core::f64::consts::TAU * 0.01 * 0.001 * 1e5;
    let force = tool.peak_force;
    assert!((0.2 * most..most).contains(&force), "{force} {most}");
    assert!((tool.peak_time - first.from).abs() < 0.1, "{tool:?}");
    // The finger comes through, and feels no more than the flaps.
    assert!(run.devices[0].reach > 0.05, "{:?}", run.devices[0].reach);
    let after = ticks(&loaded, 1.5);
    assert!(
        (1000..1500).all(|at| after[at].tools[0].wrench.force.norm() < 0.1 * force),
        "{force}"
    );
    assert!(tool.refused_patches == 0 && tool.most_out < 1e-3);
    // The finger supplies what the torn area takes. The torn halves spring back: motion takes the rest.
    let taken = tears.energy - tears.pending;
    assert!(
        tears.edges > 5 && tears.spent > taken && tears.spent < 1.1 * tool.supplied,
        "{tears:?} {tool:?}"
    );
}

/// Tears need a strength to be reached: the same push tears no cloth that is ten times as strong.
#[test]
fn a_finger_tears_no_cloth_that_is_stronger() {
    let mut text = shipped("burst.toml").source.text;
    text = text.replace("strength = 1e5", "strength = 1e6");
    let loaded = Scene::load_texts("burst.toml", &text, &BTreeMap::new()).unwrap();
    let world = World::new(&loaded).unwrap();
    let options = RunOptions {
        duration: Some(1.0),
        ..RunOptions::new(Clock::Virtual)
    };
    let run = run(&world, &options, &mut |_| {}).unwrap();
    assert!(run.tears[0].edges == 0 && run.tools[0].peak_force > 3.0);
}
