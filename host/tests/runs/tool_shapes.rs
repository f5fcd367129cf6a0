//! Tools of every shape: capsules, plates, boxes and hulls, on obstacles and on soft bodies.

use host::engine::faults::{FaultKind, HostFault};
use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::tool::Patch;
use rt_core::{Telemetry, Vec3};
use runner::AnyDevice;
use sim::{Fault, Faulty};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Every shape but the ball: its fields in a scene, and the height of its centre over its lowest point (m).
const SHAPES: [(&str, f64); 5] = [
    ("shape = 'capsule'\nlength = 0.02\nradius = 0.005", 0.015),
    (
        "shape = 'capsule'\nlength = 0.02\nradius = 0.005\nrotation = { axis = [0, 1, 0], degrees = 90 }",
        0.005,
    ),
    (
        "shape = 'plate'\nlength = 0.02\nwidth = 0.014\nradius = 0.001",
        0.001,
    ),
    (
        "shape = 'box'\nsize = [0.02, 0.01, 0.01]\nradius = 0.002\nrotation = { axis = [1, 0, 0], degrees = 45 }",
        // A half of the diagonal between two edges, and the radius.
        0.003 * std::f64::consts::SQRT_2 + 0.002,
    ),
    // The edge of the wedge is 5 mm below its origin.
    (
        "shape = 'hull'\nmesh = { file = 'wedge.obj', scale = 0.01 }\nradius = 0.002",
        0.007,
    ),
];
/// A wedge with an edge along x below, and a vertex in its middle that is no corner.
const WEDGE: &str = "v -1 -0.7 0.5\nv 1 -0.7 0.5\nv 1 0.7 0.5\nv -1 0.7 0.5\nv -1 0 -0.5\nv 1 0 -0.5\nv 0 0 0.5\n\
                     f 1 2 7\nf 2 3 7\nf 3 4 7\nf 4 1 7\nf 2 1 5\nf 2 5 6\nf 4 3 6\nf 4 6 5\nf 1 4 5\nf 3 2 6\n";

fn shipped(name: &str) -> String {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    fs::read_to_string(scenes.join(name)).unwrap()
}

fn load(text: &str) -> LoadedScene {
    let files = BTreeMap::from([("wedge.obj".to_owned(), WEDGE.as_bytes().to_vec())]);
    Scene::load_texts("shapes.toml", text, &files).unwrap()
}

fn ticks(loaded: &LoadedScene, duration: f64) -> Vec<Telemetry> {
    let world = World::new(loaded).unwrap();
    let mut session = Session::new(&world, &Options::new(duration, 1)).unwrap();
    std::iter::from_fn(|| session.tick()).collect()
}

/// Lines of a hand that goes down by `depth` (m) below its rest in 0.4 s and stays there.
fn press(depth: f64) -> String {
    format!(
        "waypoints = [[0.1, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, {:?}]]",
        -depth
    )
}

/// A scene text with another tool and another hand. `surface` is the height of the surface (m), above which the tool begins 3 mm.
fn with_tool(text: &str, (fields, lowest): (&str, f64), surface: f64, hand: &str) -> String {
    let (head, _) = text.split_at(text.find("[[tool]]").unwrap());
    format!(
        "{head}[[tool]]\nname = 'tool'\ndevice = 'omega'\n{fields}\nposition = [0.0, 0.0, {:?}]\nfriction = 0.3\n\n\
         [[device]]\nname = 'omega'\nmodel = 'omega3'\nmax_force = 8.0\n\n\
         [device.hand]\nstiffness = 500.0\ndamping = 12.0\n{hand}\n",
        surface + lowest + 0.003
    )
}

#[test]
fn a_tool_of_each_shape_stands_on_each_obstacle() {
    // Each has its highest point at the origin.
    let obstacles = [
        "shape = 'plane'",
        "shape = 'box'\nsize = [0.1, 0.1, 0.06]\nposition = [0.0, 0.0, -0.03]",
        "shape = 'sphere'\nradius = 0.03\nposition = [0.0, 0.0, -0.03]",
        "shape = 'capsule'\nradius = 0.02\nlength = 0.05\nposition = [0.0, 0.0, -0.02]\nrotation = { axis = [1, 0, 0], degrees = 90 }",
        "shape = 'cylinder'\nradius = 0.03\nlength = 0.04\nposition = [0.0, 0.0, -0.02]",
    ];
    let head = "name = 'table'\nduration = 2.0\n[host]\nstep_rate = 120.0\npublish_rate = 60.0\nlatency = 0.004\n";
    for obstacle in obstacles {
        for shape in SHAPES {
            let text = format!("{head}[[obstacle]]\nname = 'table'\n{obstacle}\n\n[[tool]]");
            let run = ticks(&load(&with_tool(&text, shape, 0.0, &press(0.006))), 0.8);
            let tool = run[750].tools().next().unwrap();
            // Triangles stand for curved obstacles.
            let apart = tool.proxy.position - Vec3::z() * shape.1;
            assert!(apart.norm() < 3e-5, "{obstacle} {shape:?}: {apart}");
            let force = run[750].devices[0].wrench.force;
            let is_across = force.xy().norm() < 0.02 * force.z;
            assert!(force.z > 0.5 && is_across, "{obstacle} {shape:?}: {force}");
            let least = run.iter().map(|tick| tick.tools[0].energy.least);
            assert!(least.fold(0.0, f64::min) > -1e-3);
        }
    }
}

/// A tool of each shape is pressed on a soft block of coarse cells. A host of 60 Hz lets it feel what physics in every tick does.
#[test]
fn a_tool_of_each_shape_feels_a_soft_block() {
    let text = shipped("touch.toml").replace("[12, 12, 6]", "[8, 8, 4]");
    for shape in SHAPES {
        let text = with_tool(&text, shape, 0.03, &press(0.009));
        let every_tick = text
            .replace("step_rate = 120.0", "step_rate = 1000.0")
            .replace("publish_rate = 60.0", "publish_rate = 1000.0")
            .replace("latency = 0.004", "latency = 0.0");
        let [late, exact] = [text, every_tick].map(|text| ticks(&load(&text), 0.8));
        let force = |run: &[Telemetry], at: usize| run[at].devices[0].wrench.force;
        let each = (0..800).map(|at| (force(&late, at) - force(&exact, at)).norm_squared());
        let peak = exact.iter().map(|tick| tick.devices[0].wrench.force.norm());
        let peak = peak.fold(0.0, f64::max);
        let error = (each.sum::<f64>() / 800.0).sqrt() / peak;
        // Measured: 0.8 % (a standing capsule) to 3.7 % (the plate). The cells are nearly as long as the tools; on cells of 8 mm, tools
        // of these kinds err by under 1 % (`palpate bench contact --part tool`).
        assert!(peak > 0.5 && error < 0.04, "{shape:?}: {error} of {peak}");
    }
}

/// The forces on a tool that is pressed (N), in the tick and in the host at the hold, and the largest change of the tick's force in a
/// tick.
fn held(text: &str) -> (Vec3, Vec3, f64) {
    let loaded = load(text);
    let world = World::new(&loaded).unwrap();
    let mut session = Session::new(&world, &Options::new(0.8, 1)).unwrap();
    let (mut force, mut host, mut jump) = (Vec3::zeros(), Vec3::zeros(), 0.0_f64);
    while let Some(tick) = session.tick() {
        let now = tick.tools[0].wrench.force;
        jump = jump.max((now - force).norm());
        force = now;
        for (_, patch) in session.engine().unwrap().patches() {
            host = host_force(patch);
        }
    }
    (force, host, jump)
}

/// The force of the surface on the tool in the host's step (N).
fn host_force(patch: &Patch) -> Vec3 {
    let sites = (patch.sites.iter()).take(usize::from(patch.head.site_count));
    -sites.map(|site| site.force).sum::<Vec3>()
}

/// Long, wide and thin tools lie on many more vertices than a patch has sites. The tick feels them as the host does.
#[test]
fn the_tick_feels_what_the_host_presses_under_long_and_wide_tools() {
    let capsule = |length: f64, turned: f64| {
        let (y, x) = turned.sin_cos();
        format!(
            "shape = 'capsule'\nlength = {length}\nradius = 0.005\nrotation = {{ axis = [{}, {x}, 0], degrees = 90 }}",
            -y
        )
    };
    let plate = |length: f64, width: f64, radius: f64| {
        format!("shape = 'plate'\nlength = {length}\nwidth = {width}\nradius = {radius}")
    };
    let block = |cells: &str, young: &str| {
        let text = shipped("touch.toml").replace("[12, 12, 6]", cells);
        (
            text.replace("young = 30e3", &format!("young = {young}")),
            0.03,
        )
    };
    let sheet = |cells: &str| {
        let text = shipped("pierce.toml").replace("[24, 24]", cells);
        (text.replace("strength = 1e5", "strength = 1e9"), 0.0005)
    };
    for (tool, radius, (text, surface)) in [
        (capsule(0.08, 0.0), 0.005, block("[12, 12, 6]", "30e3")),
        (capsule(0.16, 0.2), 0.005, block("[12, 12, 6]", "30e3")),
        (
            plate(0.06, 0.06, 0.001),
            0.001,
            block("[16, 16, 4]", "10e3"),
        ),
        (
            plate(0.08, 0.01, 0.002),
            0.002,
            block("[12, 12, 6]", "30e3"),
        ),
        // Wider than the block, which is stiffer than the device.
        (plate(0.2, 0.2, 0.004), 0.004, block("[8, 8, 4]", "100e3")),
        (plate(0.2, 0.05, 0.004), 0.004, block("[8, 8, 4]", "30e3")),
        (capsule(0.08, 0.0), 0.005, sheet("[16, 16]")),
        (capsule(0.08, 0.3), 0.005, sheet("[24, 24]")),
        (plate(0.05, 0.03, 0.002), 0.002, sheet("[24, 24]")),
    ] {
        let text = with_tool(&text, (&tool, radius), surface, &press(0.009));
        let (tick, host, jump) = held(&text);
        let error = (tick.z - host.z).abs() / host.z;
        // Measured: up to 10 % on blocks and 17 % on sheets, which hardly resist; and jumps of up to 0.38 N, where a tool that comes at
        // 50 mm/s meets a block flatly.
        assert!(
            host.z > 0.1 && error < 0.2 && jump < 0.5,
            "{tool:?}: {tick} {host}, {error} {jump}"
        );
        // Across, each keeps the friction that it had when its contacts began to stick.
        let across = (tick - host).xy().norm();
        assert!(across < 0.3 * host.z, "{tool:?}: {tick} {host}");
    }
}

/// Two tools of different shapes press one block, and each has the force that it has alone.
#[test]
fn two_tools_of_different_shapes_press_one_block() {
    let text = shipped("touch.toml")
        .replace("[12, 12, 6]", "[8, 8, 4]")
        .replace("[0.1, 0.1, 0.06]", "[0.2, 0.1, 0.06]");
    let [capsule, plate] = [SHAPES[1], SHAPES[2]].map(|shape| {
        let text = with_tool(&text, shape, 0.03, &press(0.009));
        text.split_at(text.find("[[tool]]").unwrap()).1.to_owned()
    });
    let head = text.split_at(text.find("[[tool]]").unwrap()).0;
    let capsule = capsule.replace("position = [0.0", "position = [-0.06");
    let plate = plate
        .replace("position = [0.0", "position = [0.06")
        .replace("'tool'", "'second'")
        .replace("'omega'", "'other'");
    let run = |tools: &str| ticks(&load(&format!("{head}{tools}")), 0.8);
    let both = run(&format!("{capsule}{plate}"));
    for (device, alone) in [run(&capsule), run(&plate)].iter().enumerate() {
        let [alone, beside] = [&alone[790].devices[0], &both[790].devices[device]];
        let [alone, beside] = [alone, beside].map(|device| device.wrench.force);
        let apart = (alone - beside).norm();
        assert!(
            alone.z > 0.3 && apart < 0.03 * alone.norm(),
            "{alone} {beside}"
        );
    }
}

/// A long capsule and a wide plate press one block, and the host stands still, or the first device is silent or gone, for a while. The
/// tool of the other device is not disturbed. After a while the tick feels of each tool what the host presses.
#[test]
fn long_and_wide_tools_come_back_after_faults() {
    let text = shipped("touch.toml")
        .replace("[12, 12, 6]", "[12, 6, 3]")
        .replace("[0.1, 0.1, 0.06]", "[0.2, 0.1, 0.06]");
    let capsule = "shape = 'capsule'\nlength = 0.07\nradius = 0.005\nrotation = { axis = [1, 0, 0], degrees = 90 }";
    let plate = "shape = 'plate'\nlength = 0.05\nwidth = 0.06\nradius = 0.002";
    let [capsule, plate] = [(capsule, 0.005), (plate, 0.002)]
        .map(|shape| with_tool(&text, shape, 0.03, &press(0.009)));
    let tools = |text: &str| text.split_at(text.find("[[tool]]").unwrap()).1.to_owned();
    let capsule = capsule.replace("position = [0.0", "position = [-0.05");
    let second = tools(&plate)
        .replace("position = [0.0", "position = [0.05")
        .replace("'tool'", "'second'")
        .replace("'omega'", "'other'");
    let text = format!("{capsule}{second}");
    come_back(&load(&text), 0.1, 0.0);
    // The same tools are turned on the block, on devices of six degrees of freedom.
    let turns = "turns = [[0.1, 0.0, 0.0, 0.0], [0.6, 0.1, -0.05, 0.1]]\n";
    let text = text
        .replace("'omega3'", "'virtuose6d'")
        .replace("damping = 12.0\n", &format!("damping = 12.0\n{turns}"));
    // Their rims lie on cells of 16 mm: the bound is that of the test above.
    come_back(&load(&text), 0.2, 1e-3);
}

/// Runs a scene with two tools, of which the host stands still, or the first device is silent or gone, for a while. In the end the tick's forces
/// differ from the host's by this fraction at most, and each tool has a moment of this size at least (N m).
fn come_back(loaded: &LoadedScene, most: f64, moment: f64) {
    let world = World::new(loaded).unwrap();
    let run = |stall: Option<f64>, lost: Option<Fault>| {
        let mut options = Options::new(2.0, 1);
        options.faults = (stall.into_iter())
            .map(|duration| HostFault {
                kind: FaultKind::Stall,
                at: 0.7,
                duration,
            })
            .collect();
        let mut prepared = Prepared::new(&world, &options).unwrap();
        let mut faults = lost.map(|fault| (700_000_000..900_000_000, fault));
        let devices = prepared.tick.devices.into_iter();
        prepared.tick.devices = devices
            .map(|device| {
                Box::new(Faulty::new(device, faults.take().into_iter().collect())) as AnyDevice
            })
            .collect();
        let mut session = Session::of(prepared);
        let (mut run, mut host) = (Vec::new(), [Vec3::zeros(); 2]);
        while let Some(tick) = session.tick() {
            run.push(tick);
            for (device, patch) in session.engine().unwrap().patches() {
                host[device] = host_force(patch);
            }
        }
        (run, host)
    };
    let (whole, _) = run(None, None);
    let force = |run: &[Telemetry], at: usize, tool: usize| run[at].devices[tool].wrench.force;
    for (stall, lost) in [
        (Some(0.3), None),
        (None, Some(Fault::Silent)),
        (None, Some(Fault::Gone)),
    ] {
        let (faulty, host) = run(stall, lost);
        for tool in [0, 1] {
            // A device that was lost resumes where its tool was, and presses less deeply afterwards.
            let (wrench, host) = (faulty[1999].tools[tool].wrench, host[tool]);
            let now = wrench.force;
            assert!(wrench.moment.norm() >= moment, "{}", wrench.moment);
            let apart = (now.z - host.z).abs() / host.z;
            assert!(
                now.z > 0.4 && apart < most,
                "{stall:?} {lost:?} {tool}: {now} {host}"
            );
            let least = faulty.iter().map(|tick| tick.tools[tool].energy.least);
            assert!(
                least.fold(0.0, f64::min) > -1e-3,
                "{stall:?} {lost:?} {tool}"
            );
        }
        let other = (700..1990).map(|at| (force(&faulty, at, 1) - force(&whole, at, 1)).norm());
        let other = other.fold(0.0, f64::max);
        // The block couples the tools: the force of the one that leaves is 5 % of the other's.
        let allowed = 0.1 * force(&whole, 1990, 1).norm();
        assert!(other < allowed, "{stall:?} {lost:?}: {other}");
    }
}

#[test]
fn bad_shapes_are_refused_with_their_field() {
    let ball: String = (0..200)
        .map(|k| {
            let (z, turn) = (1.0 - f64::from(k) / 100.0, 2.4 * f64::from(k));
            let out = (1.0 - z * z).max(0.0).sqrt();
            format!("v {} {} {z}\n", out * turn.cos(), out * turn.sin())
        })
        .chain(["f 1 2 3\n".to_owned()])
        .chain((3..200).map(|k| format!("f {} {} {}\n", k - 1, k, k + 1)))
        .collect();
    let aside = "v 2 0 0\nv 3 1 0\nv 3 -1 0\nv 3 0 1\nf 1 2 3\nf 1 3 4\n";
    let files = BTreeMap::from([
        ("ball.obj".to_owned(), ball.into_bytes()),
        ("aside.obj".to_owned(), aside.as_bytes().to_vec()),
    ]);
    let cases = [
        (
            "shape = 'ball'\nradius = 0.01",
            "tool[0].shape: found 'ball', allowed: `sphere`, `capsule`, `plate`, `box`, `hull`",
        ),
        (
            "length = 0.02\nradius = 0.01",
            "tool[0].length: found 0.02, allowed: no such field: a sphere has no length",
        ),
        (
            "shape = 'capsule'\nradius = 0.01",
            "tool[0].length: found none, allowed: a `length`, which a capsule has",
        ),
        (
            "shape = 'plate'\nlength = 0.02\nradius = 0.001",
            "tool[0].width: found none",
        ),
        (
            "shape = 'box'\nsize = [0.01, 0.02, 0.03]\nradius = 0.006",
            "tool[0].radius: found 0.006, allowed: half the shortest side of the box at most",
        ),
        (
            "shape = 'box'\nsize = [0.01, -0.02, 0.03]\nradius = 0.001",
            "tool[0].size",
        ),
        ("shape = 'hull'\nradius = 0.001", "tool[0].mesh: found none"),
        (
            "shape = 'hull'\nmesh = { file = 'none_#.obj' }\nradius = 0.001",
            "tool[0].mesh.file",
        ),
        (
            "shape = 'hull'\nmesh = { file = '' }\nradius = 0.001",
            "tool[0].mesh.file",
        ),
        (
            "shape = 'hull'\nmesh = { file = 'ball.obj', scale = 0.01, merge = 1 }\nradius = 0.001",
            "tool[0].mesh.merge",
        ),
        (
            "shape = 'hull'\nmesh = { file = 'ball.obj', scale = 0.01 }\nradius = 0.001",
            "outside of a hull of 32 corners",
        ),
        (
            "shape = 'hull'\nmesh = { file = 'aside.obj', scale = 0.01 }\nradius = 0.001",
            "tool[0].mesh.file: found a hull 0.02 m beside its origin",
        ),
        (
            "shape = 'hull'\nmesh = { file = 'aside.obj', scale = 1e300 }\nradius = 0.001",
            "tool[0].mesh.file: found a vertex",
        ),
        (
            "radius = 0.01\nrotation = { axis = [0, 0, 0], degrees = 3 }",
            "tool[0].rotation.axis",
        ),
    ];
    let text = shipped("touch.toml");
    for (fields, said) in cases {
        let text = with_tool(&text, (fields, 0.02), 0.03, &press(0.0));
        let loaded = Scene::load_texts("shapes.toml", &text, &files);
        let error = match &loaded {
            Ok(loaded) => World::new(loaded).err().map(|error| error.to_string()),
            Err(error) => Some(error.to_string()),
        };
        let error = error.unwrap_or_default();
        assert!(error.contains(said), "{fields}: {error}");
    }
    // A plate that begins in the block, and one that crosses the edge of an obstacle.
    let inside = with_tool(
        &text,
        (
            "shape = 'plate'\nlength = 0.02\nwidth = 0.02\nradius = 0.002",
            -0.002,
        ),
        0.03,
        &press(0.0),
    );
    let error = World::new(&load(&inside)).unwrap_err().to_string();
    assert!(error.contains("tool[0]: found"), "{error}");
    let wall = "[[obstacle]]\nname = 'wall'\nshape = 'box'\nsize = [0.01, 0.1, 0.1]\nposition = [0.012, 0.0, 0.1]\n\n[[tool]]";
    let across = with_tool(
        &text.replace("[[tool]]", wall),
        (SHAPES[2].0, 0.03),
        0.03,
        &press(0.0),
    );
    let error = World::new(&load(&across)).unwrap_err().to_string();
    assert!(error.contains("tool[0].position: found"), "{error}");
}
