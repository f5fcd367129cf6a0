//! Holds that no hand had paid for: after a stall, under a slew limit, after a fast press. The proxy slips, and the force
//! becomes that of the body at the pose of the proxy.

use host::engine::build::BuildOptions;
use host::engine::faults::{FaultKind, HostFault};
use host::log::Log;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::{Pose, Vec3};
use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write;
use support::rig::Rig;

type Outcome = Result<(), Box<dyn Error>>;

/// A block that a hand presses at its top.
fn block(young: f64, device: &str, host: &str, waypoints: &str) -> String {
    format!(
        "name = 'slip'
{host}
[[body]]
name = 'b'
damping = {{ mass = 0.5, stiffness = 0.001 }}
mesh.box = {{ size = [0.05, 0.05, 0.03], cells = [5, 5, 3] }}
material = {{ law = 'corotational', young = {young}, poisson = 0.4, density = 1000 }}
[[body.support]]
name = 's'
group = 'bottom'
[[body.handle]]
name = 'h'
box = [[-0.011, -0.011, 0.0149], [0.011, 0.011, 0.0151]]
device = 'd'
[[device]]
name = 'd'
{device}
waypoints = {waypoints}
"
    )
}

/// A net of threads that a hand presses in its middle.
const NET: &str = "name = 'net'
host = { step_rate = 30, publish_rate = 30, latency = 0.03 }
[[body]]
name = 'b'
damping = { mass = 1.0, stiffness = 0.001 }
mesh.file = 'net.vtk'
material = { young = 2e7, area = 1e-6, density = 1100 }
[[body.support]]
name = 'w'
box = [[-0.1, -0.1, -1], [-0.0359, 0.1, 1]]
[[body.support]]
name = 'e'
box = [[0.0359, -0.1, -1], [0.1, 0.1, 1]]
[[body.support]]
name = 's'
box = [[-0.1, -0.1, -1], [0.1, -0.0359, 1]]
[[body.support]]
name = 'n'
box = [[-0.1, 0.0359, -1], [0.1, 0.1, 1]]
[[body.handle]]
name = 'h'
box = [[-0.001, -0.001, -1], [0.001, 0.001, 1]]
device = 'd'
[[device]]
name = 'd'
model = 'omega3'
[device.hand]
grip = 'firm'
waypoints = [[0.5, 0, 0, 0], [0.65, 0, 0.002, 0.02]]
";

/// Seven threads along each of two axes, 12 mm apart, joined where they cross.
fn net() -> Result<Vec<u8>, Box<dyn Error>> {
    let mut text =
        "# vtk DataFile Version 3.0\nnet\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 49 double\n"
            .to_owned();
    let mut lines = Vec::new();
    for vertex in 0..49 {
        let (column, row) = (vertex % 7, vertex / 7);
        let place = |k: i32| 0.012 * f64::from(k - 3);
        writeln!(text, "{} {} 0", place(column), place(row))?;
        lines.extend((column < 6).then_some((vertex, vertex + 1)));
        lines.extend((row < 6).then_some((vertex, vertex + 7)));
    }
    writeln!(text, "CELLS {} {}", lines.len(), 3 * lines.len())?;
    for (a, b) in &lines {
        writeln!(text, "2 {a} {b}")?;
    }
    writeln!(text, "CELL_TYPES {}", lines.len())?;
    text.push_str(&"3\n".repeat(lines.len()));
    Ok(text.into_bytes())
}

/// Runs a scene with a seed, and a stall if one is given (s). Returns its summary and its log.
fn logged(
    loaded: &LoadedScene,
    seed: u64,
    duration: f64,
    stall: Option<(f64, f64)>,
) -> Result<(RunSummary, Log), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let stall = stall.map(|(at, duration)| HostFault {
        kind: FaultKind::Stall,
        at,
        duration,
    });
    let options = RunOptions {
        duration: Some(duration),
        seed: Some(seed),
        log: Some(path.clone()),
        faults: stall.into_iter().collect(),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(loaded).unwrap(), &options, &mut |_| {})?;
    Ok((summary, Log::parse(&std::fs::read(path)?)?))
}

/// The force (N) that the body of a scene exerts on its handle once it rests at `pose`. Another hand moves it there within
/// two seconds.
fn at_rest(loaded: &LoadedScene, pose: &Pose) -> Result<Vec3, Box<dyn Error>> {
    let mut rig = Rig::new(loaded, BuildOptions::default());
    let from = rig.rest[0];
    let ticks = (1000.0 / loaded.scene.host.step_rate).round() as u64;
    for _ in 0..6000 / ticks {
        rig.follow(ticks, |tick, hands| {
            let part = (tick as f64 / 2000.0).min(1.0);
            hands[0].position = from.position + (pose.position - from.position) * part;
        });
        rig.step();
    }
    let report = rig.engine.bodies()[0]
        .body()
        .handle_report(0)
        .ok_or("a handle")?;
    Ok(report.wrench_on_hand.force)
}

#[test]
fn a_hold_that_was_not_paid_for_is_felt_at_the_slipped_pose() -> Outcome {
    let late = |rate: u32, latency: f64| {
        format!("host = {{ step_rate = {rate}, publish_rate = {rate}, latency = {latency} }}")
    };
    let rigid = |model: &str| format!("model = '{model}'\n[device.hand]\ngrip = 'rigid'");
    let stirs = |depth: f64| {
        let rows = [
            [0.5, 0.0, 0.0],
            [1.4, 0.0, 8.0],
            [1.9, 4.0, 5.0],
            [2.4, 0.0, 9.0],
            [2.9, 3.0, 6.0],
        ];
        let rows = rows.map(|[t, x, z]| format!("[{t}, {}, 0, {}]", x * depth, -z * depth));
        format!("[{}]", rows.join(", "))
    };
    let slewed = "model = 'omega3'\nmax_slew = 40.0\n[device.hand]\ngrip = 'rigid'";
    let press = "[[0.5, 0, 0, 0], [0.7, 0, 0, -0.014], [1.5, 0, 0, -0.014], [3.5, 0, 0, -0.007]]";
    // Scene, duration (s), stall, and the force without slips as a fraction of the body's.
    let cases = [
        (
            "stall, omega3",
            block(2e5, &rigid("omega3"), &late(250, 0.004), &stirs(3.3e-4)),
            6.0,
            Some((1.5, 2.5)),
        ),
        (
            "stall, touch",
            block(
                1e4,
                "model = 'touch'\n[device.hand]\ngrip = 'typical'",
                &late(60, 0.016),
                &stirs(1e-3),
            ),
            6.0,
            Some((1.5, 2.5)),
        ),
        (
            "slew limit",
            block(2e4, slewed, &late(125, 0.008), press),
            6.0,
            None,
        ),
        ("fast press", NET.to_owned(), 3.0, None),
    ];
    let files = BTreeMap::from([("net.vtk".to_owned(), net()?)]);
    for (name, text, duration, stall) in cases {
        let loaded = Scene::load_texts("slip.toml", &text, &files)?;
        for seed in [1, 700_511] {
            let (summary, log) = logged(&loaded, seed, duration, stall)?;
            let case = format!("{name}, seed {seed}");
            let last = log.rows.last().ok_or("rows")?;
            let device = &last.devices[0];
            let right = at_rest(&loaded, &device.pose)?;
            let felt = device.wrench.force;
            // The hands of these scenes do not tremble. They rest for more than a second.
            let error = (felt - right).norm() / right.norm();
            assert!(
                error < 1e-3 && right.norm() > 0.3,
                "{felt} of {right} N: {case}"
            );
            assert_eq!(last.bodies[0].withheld.force, 0.0, "{case}");
            let slip = summary.devices[0].slip;
            assert!(slip > 2e-4 && slip < 8e-3, "{slip} m: {case}");
            assert!(device.slip.norm() <= slip, "{case}");
            let told = summary.to_string();
            let mm = format!("slipped by up to {:.2} mm", slip * 1e3);
            assert!(
                summary
                    .events
                    .iter()
                    .any(|event| event.description.contains(&mm)),
                "{told}"
            );
            assert!(summary.energy[0].most_out < 1e-3, "{case}");
        }
    }
    Ok(())
}
