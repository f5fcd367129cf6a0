//! Tools that touch: a ball on a device meets a body, is pressed into it, rubs it and leaves it.

use host::engine::faults::{FaultKind, HostFault};
use host::log::Log;
use host::run::prepare::Options;
use host::run::replay::{replay, scene_of};
use host::run::session::Session;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::{Telemetry, Vec3};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use support::watched;

fn scene(name: &str) -> LoadedScene {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    Scene::load(&scenes.join(name)).unwrap()
}

fn shipped() -> LoadedScene {
    scene("touch.toml")
}

/// The shipped scene with these texts in place of others.
fn changed(changes: &[(&str, &str)]) -> LoadedScene {
    let mut text = shipped().source.text;
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Scene::load_texts("touch.toml", &text, &BTreeMap::new()).unwrap()
}

/// The shipped scene with facets on which a ball slides as well as on its own.
fn coarse() -> LoadedScene {
    changed(&[("[12, 12, 6]", "[8, 8, 4]")])
}

/// The ticks of that scene.
static COARSE: LazyLock<Vec<Telemetry>> = LazyLock::new(|| ticks(&coarse(), 4.0));

fn ticks(loaded: &LoadedScene, duration: f64) -> Vec<Telemetry> {
    let world = World::new(loaded).unwrap();
    let mut session = Session::new(&world, &Options::new(duration, 1)).unwrap();
    std::iter::from_fn(|| session.tick()).collect()
}

/// The host makes a step in each tick, and the tick knows of it at once.
const EVERY_TICK: [(&str, &str); 3] = [
    ("step_rate = 120.0", "step_rate = 1000.0"),
    ("publish_rate = 60.0", "publish_rate = 1000.0"),
    ("latency = 0.004", "latency = 0.0"),
];

#[test]
fn a_ball_feels_the_block_that_it_meets() {
    let run = &*COARSE;
    // Nothing is felt in the air, before the block and after it.
    for tick in run[..300].iter().chain(&run[3500..]) {
        assert_eq!(tick.devices[0].wrench.force.norm(), 0.0, "{}", tick.tick);
    }
    // The hand presses, and the block pushes back. The proxy stays above the hand.
    let held = &run[1150];
    let force = held.devices[0].wrench.force;
    assert!(
        force.z > 1.0 && force.xy().norm() < 0.1 * force.z,
        "{force}"
    );
    assert!(held.tools[0].contacts > 0);
    // Friction holds against the motion.
    let [there, back] = [&run[1600], &run[2500]].map(|tick| tick.devices[0].wrench.force);
    assert!(there.x < -0.1 && back.x > 0.1, "{there} {back}");
    let most = run
        .iter()
        .map(|tick| tick.tools[0].energy.least)
        .fold(0.0, f64::min);
    assert!(most > -1e-3, "{most:e}");
}

/// RMS of the difference of a late host's force to that of a host that steps in every tick, as a fraction of the peak, and the peak (N).
fn lateness(changes: &[(&str, &str)]) -> (f64, f64) {
    let every_tick = [changes, &EVERY_TICK].concat();
    let [late, exact] = [changes, &every_tick].map(|changes| ticks(&changed(changes), 1.7));
    let force = |run: &[Telemetry], at: usize| run[at].devices[0].wrench.force;
    let (mut sum, mut peak) = (0.0, 0.0_f64);
    for at in 0..1700 {
        sum += (force(&late, at) - force(&exact, at)).norm_squared();
        peak = peak.max(force(&exact, at).norm());
    }
    ((sum / 1700.0).sqrt() / peak, peak)
}

#[test]
fn a_late_host_renders_what_physics_in_every_tick_renders() {
    let (error, peak) = lateness(&[]);
    assert!(peak > 2.0 && error < 0.02, "{error} of {peak}");
}

/// The edges are longer than the ball's radius.
#[test]
fn a_ball_on_facets_larger_than_itself_is_felt_late_as_in_every_tick() {
    let (error, peak) = lateness(&[("[12, 12, 6]", "[8, 8, 4]")]);
    assert!(peak > 2.0 && error < 0.02, "{error} of {peak}");
}

/// A light block lies loose on a table, which holds it against the ball.
#[test]
fn a_ball_on_a_loose_block_is_felt_late_as_in_every_tick() {
    let (error, peak) = lateness(&[
        ("[12, 12, 6]", "[6, 6, 3]"),
        ("density = 1000.0", "density = 100.0"),
        (
            "[[body.support]]         # held by the table",
            "[[obstacle]]",
        ),
        (
            "group = \"bottom\"",
            "shape = \"plane\"\nposition = [0.0, 0.0, -0.0301]",
        ),
    ]);
    assert!(peak > 2.0 && error < 0.03, "{error} of {peak}");
}

/// The ball meets two blocks beside each other, one of them stiffer, and slides from the first one to the other.
#[test]
fn a_ball_on_two_blocks_is_felt_late_as_in_every_tick() {
    let second = "[[body]]\nname = \"second\"\nposition = [0.0255, 0.0, 0.0]\ndamping = { mass = 0.1, stiffness = 0.005 }\n\
                  mesh.box = { size = [0.05, 0.1, 0.06], cells = [6, 12, 6] }\n\
                  material = { law = \"corotational\", young = 60e3, poisson = 0.4, density = 1000.0 }\n\
                  [[body.support]]\nname = \"table\"\ngroup = \"bottom\"\n\n[[tool]]";
    let (error, peak) = lateness(&[
        (
            "[0.1, 0.1, 0.06], cells = [12, 12, 6]",
            "[0.05, 0.1, 0.06], cells = [6, 12, 6]",
        ),
        (
            "name = \"block\"",
            "name = \"block\"\nposition = [-0.0255, 0.0, 0.0]",
        ),
        ("[[tool]]", second),
    ]);
    assert!(peak > 2.0 && error < 0.03, "{error} of {peak}");
}

/// The ball of the shipped scene, and another one beside it on a device of its own.
fn two_balls() -> LoadedScene {
    let text = coarse().source.text;
    let (block, ball) = text.split_at(text.find("[[tool]]").unwrap());
    let other = ball
        .replace("\"ball\"", "\"other\"")
        .replace("\"omega\"", "\"second\"")
        .replace("[0.0, 0.0, 0.045]", "[-0.03, 0.0, 0.045]");
    let ball = ball.replace("[0.0, 0.0, 0.045]", "[0.03, 0.0, 0.045]");
    let text = format!("{block}{ball}{other}");
    Scene::load_texts("two.toml", &text, &BTreeMap::new()).unwrap()
}

#[test]
fn two_balls_press_one_block() {
    let run = ticks(&two_balls(), 1.2);
    let [one, other] = [0, 1].map(|device| run[1150].devices[device].wrench.force);
    assert!(one.z > 1.0 && other.z > 1.0, "{one} {other}");
    assert!(run[1150].tools().all(|tool| tool.contacts > 0));
    // Before they touch, none feels the other one.
    assert_eq!(run[300].devices[0].wrench.force.norm(), 0.0);
}

#[test]
fn a_ball_on_a_block_whose_host_stalls_is_held() {
    // The host stands still for half a second while the ball is pressed and begins to rub.
    let world_scene = coarse();
    let world = World::new(&world_scene).unwrap();
    let mut options = Options::new(2.5, 1);
    options.faults = vec![HostFault {
        kind: FaultKind::Stall,
        at: 1.0,
        duration: 0.5,
    }];
    let mut session = Session::new(&world, &options).unwrap();
    let run: Vec<Telemetry> = std::iter::from_fn(|| session.tick()).collect();
    let force = |at: usize| run[at].devices[0].wrench.force;
    for at in 1000..1200 {
        // The hand rests, and so does the force.
        assert!(
            (force(at) - force(1000)).norm() < 0.05 * force(1000).norm(),
            "{at}"
        );
    }
    // It goes on along the surface that it knows, and returns to that of the host.
    let last = COARSE[2400].devices[0].wrench.force;
    assert!(
        (force(2400) - last).norm() < 0.2 * last.norm(),
        "{} {last}",
        force(2400)
    );
    let least = run
        .iter()
        .map(|tick| tick.tools[0].energy.least)
        .fold(0.0, f64::min);
    assert!(least > -1e-3, "{least:e}");
}

/// The ticks of a scene with one fault of the host, and the summary of the same run.
fn failed(
    loaded: &LoadedScene,
    kind: FaultKind,
    at: f64,
    duration: f64,
) -> (Vec<Telemetry>, RunSummary) {
    let options = RunOptions {
        duration: Some(2.5),
        faults: vec![HostFault { kind, at, duration }],
        ..RunOptions::new(Clock::Virtual)
    };
    let (summary, run) = watched::ticks(&World::new(loaded).unwrap(), &options).unwrap();
    (run, summary)
}

/// The tick uses no patch that is spoilt, and holds the ball on the surface that it knows.
#[test]
fn a_ball_feels_nothing_of_patches_that_are_spoilt() {
    let undisturbed = &*COARSE;
    for kind in [FaultKind::NotANumber, FaultKind::Topology] {
        let (run, summary) = failed(&coarse(), kind, 1.0, 0.5);
        let force = |at: usize| run[at].devices[0].wrench.force;
        for at in 0..1000 {
            assert_eq!(force(at), undisturbed[at].devices[0].wrench.force, "{at}");
        }
        for at in 1000..2500 {
            assert!(force(at).iter().all(|x| x.is_finite()), "{kind:?}: {at}");
        }
        for at in 1000..1200 {
            let by = (force(at) - force(1000)).norm();
            assert!(by < 0.05 * force(1000).norm(), "{kind:?}: {at}");
        }
        let last = undisturbed[2400].devices[0].wrench.force;
        assert!((force(2400) - last).norm() < 0.05 * last.norm(), "{kind:?}");
        // 60 a second.
        let [ball] = &summary.tools[..] else {
            panic!("{:?}", summary.tools);
        };
        assert!(
            (28..32).contains(&ball.refused_patches),
            "{kind:?}: {ball:?}"
        );
        assert!(ball.most_out < 1e-3, "{kind:?}: {ball:?}");
    }
}

#[test]
fn a_ball_whose_host_panics_fades_from_the_block() {
    let young = changed(&[("[host]", "[loop]\nage_limit = 0.1\n\n[host]")]);
    let (run, summary) = failed(&young, FaultKind::Panic, 1.0, 0.0);
    let force = |at: usize| run[at].devices[0].wrench.force;
    assert!(force(999).z > 1.0);
    assert!(run.iter().all(|tick| tick.tools[0].energy.least > -1e-3));
    // The force fades without a jump.
    for at in 1000..2500 {
        assert!((force(at) - force(at - 1)).norm() < 0.1, "{at}");
    }
    // The damping of the safe hold is left: 2 N s/m. The hand moves at up to 70 mm/s.
    assert!((1500..2500).all(|at| force(at).norm() < 0.15));
    assert_eq!(summary.tools[0].faded, 1);
}

#[test]
fn a_run_with_a_tool_replays_exactly() {
    let loaded = coarse();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(1.5),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&loaded).unwrap(), &options, &mut |_| {}).unwrap();
    let log = Log::parse(&fs::read(path).unwrap()).unwrap();
    assert!(log.patches.len() > 80 && log.rows[1200].touch[1] > 0.0);
    let report = replay(&log, &scene_of(&log, "a log").unwrap(), &mut |_| {}).unwrap();
    assert!(report.is_exact(), "{}", report.first.unwrap());
    // A log that lacks a patch is refused.
    let mut less = log.clone();
    less.patches.remove(40);
    let scene = scene_of(&less, "a log").unwrap();
    let refused = replay(&less, &scene, &mut |_| {}).unwrap_err().to_string();
    assert!(refused.contains("lacks patch 41 of the tool"), "{refused}");
}

#[test]
fn the_summary_says_what_each_ball_met() {
    // The second ball stays above the block. The host stalls while the first one presses, for longer than a patch is trusted.
    let loaded = two_balls();
    let above = loaded.source.text.rfind("[0.6, 0.0, 0.0, -0.012]").unwrap();
    let text = &loaded.source.text;
    let second = text[above..].replace("-0.012]", "0.0]");
    let text = format!("{}{second}", &text[..above]);
    let text = text.replacen("[host]", "[loop]\nage_limit = 0.1\n\n[host]", 1);
    let loaded = Scene::load_texts("two.toml", &text, &BTreeMap::new()).unwrap();
    let options = RunOptions {
        duration: Some(1.5),
        faults: vec![HostFault {
            kind: FaultKind::Stall,
            at: 0.9,
            duration: 0.5,
        }],
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(&loaded).unwrap(), &options, &mut |_| {}).unwrap();
    let [ball, other] = &summary.tools[..] else {
        panic!("{:?}", summary.tools);
    };
    assert_eq!((&*ball.tool, &*ball.device), ("ball", "omega"));
    assert_eq!((&*other.tool, &*other.device), ("other", "second"));
    assert!(ball.pressed > 0.8 && ball.peak_force > 1.0, "{ball:?}");
    // The block is softer than the stiffest spring of the device, so the ball is where the device is.
    assert!(ball.apart < 1e-5 && ball.supplied > 1e-3, "{ball:?}");
    // 60 a second, but not while the host stalls.
    assert!((55..65).contains(&ball.patches), "{ball:?}");
    assert_eq!((ball.faded, ball.refused_patches), (1, 0));
    // The dampers of the safe hold take a little.
    assert_eq!((other.pressed, other.peak_force), (0.0, 0.0));
    assert!(other.supplied < 1e-3, "{other:?}");
    let old: Vec<_> = (summary.events.iter())
        .filter(|event| event.description.contains("too old"))
        .map(|event| event.description.split(':').next().unwrap())
        .collect();
    assert!(old.contains(&"ball") && old.contains(&"other"), "{old:?}");
    let mut held = summary.held_back.iter();
    assert!(held.any(|held| held.of == "ball" && held.cause == "old patch"));
    let printed = summary.to_string();
    assert!(printed.contains("ball on omega: pressed for"), "{printed}");
    assert!(
        printed.contains("other on second: pressed for 0.00 s"),
        "{printed}"
    );
}

#[test]
fn bad_tools_are_refused_with_their_field() {
    let text = shipped().source.text;
    for (from, to, said) in [
        ("radius = 0.010", "radius = -1", "tool[0].radius: found -1"),
        (
            "device = \"omega\"\nradius",
            "device = \"none\"\nradius",
            "tool[0].device: found \"none\"",
        ),
        (
            "name = \"ball\"",
            "name = \"block\"",
            "tool[0].name: found \"block\"",
        ),
        ("[0.0, 0.0, 0.045]", "[0.0, 0.0, 0.035]", "tool[0]: found"),
        ("[0.0, 0.0, 0.045]", "[0.0, 0.0, 0.0]", "tool[0]: found"),
        (
            "group = \"bottom\"\n",
            "group = \"bottom\"\n[[body.handle]]\nname = 'h'\ngroup = 'top'\ndevice = 'omega'\n",
            "tool[0].device: found \"omega\", allowed: a device that holds no handle",
        ),
        (
            "friction = 0.3",
            "friction = 0.3\ntake_button = 17",
            "tool[0].take_button: found 17",
        ),
        (
            "friction = 0.3\n\n[[device]]\n",
            "friction = 0.3\ntake_button = 2\n\n[[device]]\nengage.stop_button = 2\n",
            "tool[0].take_button: found 2, allowed: another button than the one that stops all devices",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        let text = text.replacen(from, to, 1);
        let loaded = Scene::load_texts("touch.toml", &text, &BTreeMap::new());
        let error = match &loaded {
            Ok(loaded) => World::new(loaded).err(),
            Err(_) => None,
        };
        let error = error.map_or_else(
            || loaded.err().map(|e| e.to_string()),
            |e| Some(e.to_string()),
        );
        let error = error.unwrap_or_default();
        assert!(error.contains(said), "{to}: {error}");
    }
}

#[test]
fn a_tool_and_obstacles_that_do_not_fit_are_refused() {
    let text = scene("groove.toml").source.text;
    let pair = |one: &str, other: &str| {
        format!("[[contact]]\nbetween = [\"{one}\", \"{other}\"]\nfriction = 0.5\n\n[[tool]]")
    };
    for (from, to, said) in [
        (
            "position = [0.0, 0.0, 0.02]",
            "position = [0.0, 0.0, 0.005]".to_owned(),
            "tool[0].position: found 0.00146 m inside obstacle \"left plate\"",
        ),
        (
            "position = [0.0, 0.0, 0.02]",
            "position = [0.0, -0.0247, 0.0177]".to_owned(),
            "tool[0].position: found",
        ),
        (
            "[[tool]]",
            pair("left plate", "right plate"),
            "contact[0].between: found",
        ),
        (
            "[[tool]]",
            pair("ball", "ball"),
            "contact[0].between: found",
        ),
    ] {
        let text = text.replacen(from, &to, 1);
        let loaded = Scene::load_texts("groove.toml", &text, &BTreeMap::new());
        let error = match &loaded {
            Ok(loaded) => World::new(loaded).err().map(|error| error.to_string()),
            Err(error) => Some(error.to_string()),
        };
        let error = error.unwrap_or_default();
        assert!(error.contains(said), "{to}: {error}");
    }
    // A pair of a tool and an obstacle has a friction of its own.
    let rough = text.replacen("[[tool]]", &pair("ball", "left plate"), 1);
    let rough = Scene::load_texts("groove.toml", &rough, &BTreeMap::new()).unwrap();
    let [rough, plain] = [ticks(&rough, 1.4), ticks(&scene("groove.toml"), 1.4)];
    let along = |run: &[Telemetry]| run[1200].tools[0].wrench.force.x.abs();
    assert!(
        along(&rough) > 1.5 * along(&plain),
        "{} {}",
        along(&rough),
        along(&plain)
    );
}

/// A groove of two plates, whose upper sides meet in the x axis at an angle (degrees), and the outward normals of the plates.
fn groove(angle: f64) -> (LoadedScene, [Vec3; 2]) {
    let slope = (90.0 - 0.5 * angle).to_radians();
    let normals = [1.0, -1.0].map(|side| Vec3::new(0.0, side * slope.sin(), slope.cos()));
    let mut text = scene("groove.toml").source.text;
    for (side, normal) in [-1.0, 1.0].into_iter().zip(normals) {
        let along = Vec3::new(0.0, side * slope.cos(), slope.sin());
        let centre = along * 0.03 - normal * 0.005;
        let shipped = format!("position = [0.0, {:?}, 0.017678]", side * 0.024_749);
        assert!(text.contains(&shipped), "{shipped}");
        text = text.replace(
            &shipped,
            &format!("position = [0.0, {:?}, {:?}]", centre.y, centre.z),
        );
        let turn = format!("degrees = {} }}", side * 45.0);
        let new = format!("degrees = {:?} }}", side * slope.to_degrees());
        text = text.replace(&turn, &new);
    }
    // The ball begins above the plates, also between steep ones, and is pressed as deep.
    let height = 0.005 / slope.cos() + 0.013;
    text = text.replace(
        "position = [0.0, 0.0, 0.02]",
        &format!("position = [0.0, 0.0, {height:?}]"),
    );
    let loaded = Scene::load_texts("groove.toml", &text, &BTreeMap::new()).unwrap();
    (loaded, normals)
}

#[test]
fn a_ball_in_a_rigid_groove_overlaps_nothing() {
    for angle in [60.0, 90.0, 120.0, 150.0] {
        let (loaded, normals) = groove(angle);
        let run = ticks(&loaded, 2.4);
        let (mut deepest, mut both) = (0.0_f64, 0);
        for tick in &run {
            let tool = tick.tools().next().unwrap();
            let gaps = normals.map(|normal| normal.dot(&tool.proxy.position) - 0.005);
            deepest = deepest.max(-gaps[0]).max(-gaps[1]);
            both += u32::from(gaps.iter().all(|gap| *gap < 1e-9));
        }
        assert!(deepest < 1e-6, "{angle}: {deepest:e}");
        // The ball lies on both plates while it is pressed and slides.
        assert!(both > 500, "{angle}: {both}");
        let most = run.iter().map(|tick| tick.devices[0].wrench.force.norm());
        let most = most.fold(0.0, f64::max);
        assert!(most > 0.8, "{angle}: {most}");
    }
}

#[test]
fn a_tool_feels_each_shape_of_obstacle_at_its_surface() {
    // The hand comes down on the top of the obstacle at z = 0, and is pressed 2 mm into it.
    let shapes = [
        "shape = \"plane\"",
        "shape = \"box\"\nsize = [0.04, 0.05, 0.06]\nposition = [0.0, 0.0, -0.03]",
        "shape = \"sphere\"\nradius = 0.03\nposition = [0.0, 0.0, -0.03]",
        "shape = \"capsule\"\nradius = 0.02\nlength = 0.05\nposition = [0.0, 0.0, -0.02]\nrotation = { axis = [1, 0, 0], degrees = 90 }",
        "shape = \"cylinder\"\nradius = 0.02\nlength = 0.06\nposition = [0.0, 0.0, -0.02]\nrotation = { axis = [0, 1, 0], degrees = 90 }",
        "shape = \"cylinder\"\nradius = 0.03\nlength = 0.04\nposition = [0.0, 0.0, -0.02]",
    ];
    let text = scene("groove.toml").source.text;
    let (head, rest) = text.split_at(text.find("# The upper sides").unwrap());
    let (_, tail) = rest.split_at(rest.find("[[tool]]").unwrap());
    for shape in shapes {
        let text = format!("{head}[[obstacle]]\nname = \"table\"\n{shape}\n\n{tail}");
        let text = text.replace("0.03, 0.002, -0.016", "0.0, 0.0, -0.017");
        let loaded = Scene::load_texts("table.toml", &text, &BTreeMap::new()).unwrap();
        let run = ticks(&loaded, 1.5);
        let tool = run[1450].tools().next().unwrap();
        assert!(
            (tool.proxy.position - Vec3::new(0.0, 0.0, 0.005)).norm() < 2e-5,
            "{shape}: {}",
            tool.proxy.position
        );
        let force = run[1450].devices[0].wrench.force;
        assert!(
            force.z > 0.5 && force.xy().norm() < 0.02 * force.z,
            "{shape}: {force}"
        );
        // No message moves the ball on the surface by more than the motion of the hand does.
        let jumps = run
            .windows(2)
            .map(|pair| (pair[1].tools[0].wrench.force - pair[0].tools[0].wrench.force).norm());
        let jump = jumps.fold(0.0, f64::max);
        assert!(jump < 0.25, "{shape}: {jump}");
    }
}

#[test]
fn an_obstacle_that_moves_meets_a_tool_that_is_held() {
    let text = scene("groove.toml").source.text;
    let (head, rest) = text.split_at(text.find("# The upper sides").unwrap());
    let (_, tail) = rest.split_at(rest.find("[[tool]]").unwrap());
    let obstacle = "[[obstacle]]\nname = \"lift\"\nshape = \"box\"\nsize = [0.1, 0.1, 0.02]\nposes = \"lift.csv\"\n\n";
    let hand = tail.replace("-0.016", "0.0");
    let hand = hand
        .replace("0.03, 0.002", "0.0, 0.0")
        .replace("-0.03, 0.0, 0.0", "0.0, 0.0, 0.0");
    let text = format!("{head}{obstacle}{hand}");
    // The upper side rises from 15 mm below the ball to 3 mm above its lowest point in half a second, and stands.
    let poses = "time,x,y,z,qw,qx,qy,qz\n0,0,0,-0.01,1,0,0,0\n0.5,0,0,-0.01,1,0,0,0\n1.0,0,0,0.008,1,0,0,0\n";
    let files = BTreeMap::from([("lift.csv".to_owned(), poses.as_bytes().to_vec())]);
    let loaded = Scene::load_texts("lift.toml", &text, &files).unwrap();
    let run = ticks(&loaded, 1.6);
    assert_eq!(run[700].tools[0].wrench.force.norm(), 0.0);
    let tool = run[1550].tools().next().unwrap();
    assert!(tool.wrench.force.z > 0.3, "{}", tool.wrench.force);
    // The ball lies on the plate, whose upper side is at 18 mm.
    assert!(
        (tool.proxy.position.z - 0.023).abs() < 1e-6,
        "{}",
        tool.proxy.position
    );
    // The plate does work on the hand, which has supplied none: the cap withholds the force.
    let least = run.iter().map(|tick| tick.tools[0].energy.least);
    assert!(least.fold(0.0, f64::min) > -1e-3);
    assert!(tool.withheld.force > 0.0);
}

#[test]
fn a_finger_pushes_a_hanging_cloth_that_hardly_resists() {
    let run = ticks(&scene("finger.toml"), 3.0);
    // The cloth weighs 0.21 N.
    let most = run.iter().map(|tick| tick.tools[0].wrench.force.norm());
    let most = most.fold(0.0, f64::max);
    assert!((0.02..0.2).contains(&most), "{most}");
    // The finger takes the cloth along and leaves it on the side from which it came.
    let pressed = run[1200..2000]
        .iter()
        .filter(|tick| tick.tools[0].wrench.force.y < 0.0);
    assert!(pressed.count() > 790);
    assert_eq!(run[2950].tools[0].wrench.force.norm(), 0.0);
    // No patch is refused: each is taken into use.
    let numbers = run
        .windows(2)
        .map(|pair| pair[1].tools[0].sequence - pair[0].tools[0].sequence);
    assert_eq!(numbers.max(), Some(1));
}

#[test]
fn a_finger_pushes_a_cloth_until_it_tears() {
    // The shipped scene with a coarser cloth.
    let text = scene("pierce.toml").source.text;
    let text = text.replace("cells = [24, 24]", "cells = [16, 16]");
    let loaded = Scene::load_texts("pierce.toml", &text, &BTreeMap::new()).unwrap();
    let world = World::new(&loaded).unwrap();
    let run = run(&world, &RunOptions::new(Clock::Virtual), &mut |_| {}).unwrap();
    let (tears, tool) = (&run.tears[0], &run.tools[0]);
    // The finger breaks through: it reaches its aim 40 mm below the cloth, and comes back.
    assert!(
        tears.edges > 5 && tool.peak_force > 2.0,
        "{tears:?} {tool:?}"
    );
    assert!(run.devices[0].reach > 0.038, "{:?}", run.devices[0].reach);
    assert!(
        tool.refused_patches == 0 && tool.most_out < 1e-3,
        "{tool:?}"
    );
    // The finger supplies what the torn area takes; motion and damping take the rest, and the cloth stores nothing at the end. The tick
    // and the host compute the work of the finger for themselves.
    let taken = tears.energy - tears.pending;
    assert!(
        tears.spent > taken && (0.8..1.1).contains(&(tears.spent / tool.supplied)),
        "{tears:?} {tool:?}"
    );
}
