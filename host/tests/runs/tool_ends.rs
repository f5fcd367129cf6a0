//! Tools on surfaces that end below them: a ball goes over the edge of a rigid shelf, a finger tears a hanging cloth, and hands trace contours.

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

/// A sheet yields much across itself, and hardly along itself. A finger that comes back through the hole meets the edges of the flaps, and
/// turns them aside.
#[test]
fn a_finger_comes_back_through_the_cloth_that_it_tore() {
    for aside in [0.004, -0.018] {
        let text = shipped("burst.toml").source.text;
        let through = "[1.2, 0.0, 0.055, 0.0],";
        assert!(text.contains(through));
        let back = format!("{through} [1.3, {aside:?}, 0.055, 0.0], [1.9, {aside:?}, 0.0, 0.0],");
        let text = text.replace(through, &back);
        let loaded = Scene::load_texts("burst.toml", &text, &BTreeMap::new()).unwrap();
        let run = ticks(&loaded, 2.3);
        let force = |at: usize| run[at].tools[0].wrench.force;
        let most = (0..1300).map(|at| force(at).norm()).fold(0.0, f64::max);
        for at in 1300..2300 {
            // The hand of 500 N/m is 20 mm behind its aim at most, and the flaps are softer than the whole cloth.
            let jump = (force(at) - force(at - 1)).norm();
            assert!(
                jump < 0.5 && force(at).norm() < 0.5 * most,
                "{aside} {at}: {jump} {}",
                force(at)
            );
        }
        assert!(run[2299].tools[0].proxy.position.y < 0.01);
    }
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

/// Two hands trace at the same time, each with a ball on a device of its own: a rigid sphere, and a soft block.
#[test]
fn two_hands_trace_a_sphere_and_a_block() {
    let device = |name: &str, heading: &str, force: f64| {
        format!(
            "[[device]]\nname = '{name}'\nmodel = 'omega3'\n[device.hand]\nstiffness = 500\ndamping = 12\n\
             traces = [{{ from = 0.1, to = 2.6, direction = [0, 0, -1], heading = {heading}, force = {force:?}, speed = 0.02 }}]\n\
             waypoints = [[2.6, 0, 0, 0], [2.9, 0, 0, 0.05]]\n"
        )
    };
    let tool = |name: &str, x: f64| {
        format!(
            "[[tool]]\nname = '{name} ball'\ndevice = '{name}'\nradius = 0.008\nposition = [{x:?}, 0, 0.012]\nfriction = 0.2\n"
        )
    };
    let text = format!(
        "name = 'traces'\nduration = 3.2\n[host]\nstep_rate = 120\npublish_rate = 60\nlatency = 0.004\n\
         [[obstacle]]\nname = 'sphere'\nshape = 'sphere'\nradius = 0.06\nposition = [0, 0, -0.06]\n\
         [[body]]\nname = 'block'\nposition = [0.25, 0, -0.02]\ndamping = {{ mass = 0.1, stiffness = 0.005 }}\n\
         mesh.box = {{ size = [0.12, 0.08, 0.04], cells = [12, 8, 4] }}\n\
         material = {{ law = 'corotational', young = 3e4, poisson = 0.4, density = 1000 }}\n\
         [[body.support]]\nname = 'table'\ngroup = 'bottom'\n{}{}{}{}",
        tool("left", 0.0),
        tool("right", 0.23),
        device("left", "[0, 1, 0]", 1.5),
        device("right", "[1, 0, 0]", 0.8),
    );
    let loaded = Scene::load_texts("traces.toml", &text, &BTreeMap::new()).unwrap();
    let run = ticks(&loaded, 3.2);
    let tools = |at: usize| run[at].tools().collect::<Vec<_>>();
    for at in 1200..2600 {
        let [left, right] = tools(at)[..] else {
            panic!("{at}: no two tools");
        };
        // Friction turns the force by 11 degrees from the normal; the device has friction, too, and the block yields while the ball moves.
        for (tool, force) in [(left, 1.5), (right, 0.8)] {
            let felt = tool.wrench.force.norm() / force;
            assert!((0.85..1.15).contains(&felt), "{at}: {felt}");
        }
        let out = left.proxy.position + Vec3::new(0.0, 0.0, 0.06);
        assert!((out.norm() - 0.068).abs() < 1e-4, "{at}: {out}");
    }
    // 20 mm/s on both, for 1.4 s: along the sphere, and along the block.
    let out = |at: usize| tools(at)[0].proxy.position + Vec3::new(0.0, 0.0, 0.06);
    let ways = [
        0.068 * out(1200).angle(&out(2600)),
        (tools(2600)[1].proxy.position - tools(1200)[1].proxy.position).x,
    ];
    for way in ways {
        assert!((0.025..0.031).contains(&way), "{ways:?}");
    }
    // Waypoints lead the hands away from where they are.
    assert!(
        run[3190]
            .tools()
            .all(|tool| tool.wrench.force.norm() == 0.0)
    );
    let least = run
        .iter()
        .flat_map(Telemetry::tools)
        .map(|tool| tool.energy.least);
    assert!(least.fold(0.0, f64::min) > -1e-3);
}
