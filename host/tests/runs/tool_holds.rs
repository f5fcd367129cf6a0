//! Tools that take hold of what they touch, and tools that squeeze and lift.

use devices::panel::{Order, TimedOrder};
use host::engine::faults::{FaultKind, HostFault};
use host::log::Log;
use host::run::prepare::{Options, Prepared};
use host::run::replay::{replay, scene_of};
use host::run::session::Session;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::{Telemetry, Vec3};
use runner::AnyDevice;
use sim::{Fault, Faulty};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// A shipped scene with these texts in place of others.
fn changed(name: &str, changes: &[(&str, &str)]) -> LoadedScene {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let mut text = fs::read_to_string(scenes.join(name)).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Scene::load_texts(name, &text, &BTreeMap::new()).unwrap()
}

fn ticks(loaded: &LoadedScene, duration: f64) -> Vec<Telemetry> {
    let world = World::new(loaded).unwrap();
    let mut session = Session::new(&world, &Options::new(duration, 1)).unwrap();
    std::iter::from_fn(|| session.tick()).collect()
}

fn force(run: &[Telemetry], at: usize) -> Vec3 {
    run[at].devices[0].wrench.force
}

/// The hand gains nothing, whatever it holds.
fn least_energy(run: &[Telemetry]) -> f64 {
    let all = run.iter().flat_map(Telemetry::tools);
    all.map(|tool| tool.energy.least).fold(0.0, f64::min)
}

const COARSE: (&str, &str) = ("[10, 10, 5]", "[8, 8, 4]");

#[test]
fn a_held_block_is_felt_late_as_in_every_tick() {
    let every_tick = [
        COARSE,
        ("step_rate = 120.0", "step_rate = 1000.0"),
        ("publish_rate = 60.0", "publish_rate = 1000.0"),
        ("latency = 0.004", "latency = 0.0"),
    ];
    let [late, exact] = [&[COARSE][..], &every_tick].map(|changes| {
        let loaded = changed("take.toml", changes);
        ticks(&loaded, 1.9)
    });
    let (mut sum, mut peak) = (0.0, 0.0_f64);
    for at in 0..1900 {
        sum += (force(&late, at) - force(&exact, at)).norm_squared();
        peak = peak.max(force(&exact, at).norm());
    }
    let error = (sum / 1900.0).sqrt() / peak;
    // The block draws the hand back, downwards and to the side.
    let drawn = force(&exact, 1850);
    assert!(drawn.z < -1.5 && drawn.x < -1.5, "{drawn}");
    assert!(error < 0.025, "{error} of {peak}");
}

#[test]
fn neither_taking_hold_nor_letting_go_is_a_jump() {
    let run = ticks(&changed("take.toml", &[COARSE]), 3.2);
    // What the hand does by itself changes the force by less.
    let slow = 0.05;
    for at in (400..700).chain(1200..2690) {
        let jump = (force(&run, at) - force(&run, at - 1)).norm();
        assert!(jump < slow, "{at}: {jump}");
    }
    // The force of the hold goes within half a period, in equal parts.
    let held = force(&run, 2690);
    assert!(held.norm() > 2.0, "{held}");
    for at in 2695..2720 {
        let jump = (force(&run, at) - force(&run, at - 1)).norm();
        assert!(jump < 0.2 * held.norm(), "{at}: {jump} of {held}");
    }
    assert!((2730..3200).all(|at| force(&run, at).norm() == 0.0));
    assert!(least_energy(&run) > -1e-3);
}

/// The hand only strokes the block between two steps of the host, with the button down, and is gone before the host has seen it.
#[test]
fn a_touch_that_the_host_did_not_see_is_let_go() {
    let stroke = [
        COARSE,
        (
            "[0.5, 0.0, 0.0, -0.009],   # press,",
            "[0.25, 0.0, 0.0, -0.0065],",
        ),
        ("[0.7, 0.0, 0.0, -0.009],", "[0.3, 0.0, 0.0, 0.0],"),
        ("from = 0.6", "from = 0.1"),
    ];
    let strokes = (0..6).map(|by| {
        // The steps of the host come every 8.3 ms.
        let start = format!("[{:.4}, 0.0, 0.0, 0.0],", 0.2 + 0.0014 * f64::from(by));
        let later = [&stroke[..], &[("[0.2, 0.0, 0.0, 0.0],", &start)]].concat();
        ticks(&changed("take.toml", &later), 0.6)
    });
    let mut touched = 0;
    for run in strokes {
        touched += usize::from((0..600).any(|at| force(&run, at).norm() > 0.0));
        for at in 1..600 {
            let (now, before) = (force(&run, at), force(&run, at - 1));
            assert!((now - before).norm() < 0.3, "{at}: {before} {now}");
        }
        assert!(least_energy(&run) > -1e-3);
    }
    assert!(touched >= 3, "{touched}");
}

#[test]
fn a_hold_outlives_a_host_that_stalls() {
    let loaded = changed("take.toml", &[COARSE]);
    let world = World::new(&loaded).unwrap();
    let undisturbed = ticks(&loaded, 2.6);
    for (at, duration) in [(0.55, 0.2), (1.5, 0.3)] {
        let mut options = Options::new(2.6, 1);
        options.faults = vec![HostFault {
            kind: FaultKind::Stall,
            at,
            duration,
        }];
        let mut session = Session::new(&world, &options).unwrap();
        let run: Vec<Telemetry> = std::iter::from_fn(|| session.tick()).collect();
        let [last, expected] = [&run, &undisturbed].map(|run| force(run, 2500));
        assert!(
            (last - expected).norm() < 0.1 * expected.norm(),
            "{at}: {last} {expected}"
        );
        assert!(least_energy(&run) > -1e-3);
    }
}

/// The device is silent, or gone, while the hand pulls the block. Whatever is held then, the hand gains nothing, and lets go in the end.
#[test]
fn a_hold_survives_the_loss_of_its_device() {
    let loaded = changed("take.toml", &[COARSE]);
    let world = World::new(&loaded).unwrap();
    for fault in [Fault::Silent, Fault::Gone] {
        let mut prepared = Prepared::new(&world, &Options::new(3.1, 1)).unwrap();
        let devices = prepared.tick.devices.into_iter();
        let lost = |device| {
            let faults = vec![(1_300_000_000..1_500_000_000, fault)];
            Box::new(Faulty::new(device, faults)) as AnyDevice
        };
        prepared.tick.devices = devices.map(lost).collect();
        let mut session = Session::of(prepared);
        let run: Vec<Telemetry> = std::iter::from_fn(|| session.tick()).collect();
        assert!(force(&run, 1290).z < -1.0, "{fault:?}");
        // The force goes with the device, and comes back.
        assert_eq!(force(&run, 1490).norm(), 0.0, "{fault:?}");
        assert!(force(&run, 2600).norm() > 0.5, "{fault:?}");
        assert!(
            (0..3100).all(|at| force(&run, at).norm() < 8.1),
            "{fault:?}"
        );
        assert!(least_energy(&run) > -1e-3, "{fault:?}");
        let tool = run[3090].tools().next().unwrap();
        assert!(
            tool.wrench.force.z >= 0.0,
            "{fault:?}: {}",
            tool.wrench.force
        );
    }
}

/// A finger takes hold of the hanging cloth, draws it back to its own side and swings it.
#[test]
fn a_finger_pulls_a_hanging_cloth() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let text = fs::read_to_string(scenes.join("finger.toml")).unwrap();
    let until = text.find("waypoints").unwrap();
    let text = text[..until].replace("friction = 0.3", "friction = 0.3\ntake_button = 2")
        + "waypoints = [[0.3, 0, 0, 0], [0.8, 0, 0.025, 0], [1.0, 0, 0.025, 0], [1.6, 0, -0.02, 0], \
           [2.1, 0.03, -0.02, 0.01]]\n\
           [[device.hand.presses]]\nbutton = 2\nfrom = 0.9\nto = 2.3\n";
    let loaded = Scene::load_texts("pull.toml", &text, &BTreeMap::new()).unwrap();
    let run = ticks(&loaded, 2.5);
    // The cloth draws the hand back, and then to the side.
    let [drawn, aside] = [1600, 2150].map(|at| force(&run, at));
    assert!(drawn.norm() > 0.3 && aside.x < -0.5, "{drawn} {aside}");
    assert!((0..2500).all(|at| force(&run, at).norm() < 10.0));
    assert!((2340..2500).all(|at| force(&run, at).norm() < 0.1));
    assert!(least_energy(&run) > -1e-3);
}

/// A cube of 300 kPa is as stiff as the device: each ball must know that the other one holds it.
#[test]
fn two_balls_lift_a_cube_and_put_it_down() {
    lift(&[]);
    lift(&[("young = 30e3", "young = 300e3")]);
}

fn lift(changes: &[(&str, &str)]) {
    let loaded = changed("lift.toml", changes);
    let world = World::new(&loaded).unwrap();
    let mut session = Session::new(&world, &Options::new(3.6, 1)).unwrap();
    let mut heights = Vec::new();
    let mut run = Vec::new();
    while let Some(tick) = session.tick() {
        let positions = session.engine().unwrap().bodies()[0]
            .body()
            .node_positions();
        let sum: Vec3 = positions.iter().sum();
        heights.push(sum.z / positions.len() as f64);
        run.push(tick);
    }
    assert!((heights[850] - 0.02).abs() < 1e-3, "{}", heights[850]);
    // 40 mm, and what the hands give way.
    assert!(heights[2050] > 0.052, "{}", heights[2050]);
    assert!((heights[3590] - 0.02).abs() < 1e-3, "{}", heights[3590]);
    // In the air each ball bears half of the weight.
    let weight = 0.04_f64.powi(3) * 780.0 * 9.81;
    let borne: f64 = run[2050].tools().map(|tool| -tool.wrench.force.z).sum();
    assert!((borne / weight - 1.0).abs() < 0.05, "{borne} {weight}");
    assert!(least_energy(&run) > -1e-3);
    for device in 0..2 {
        // The host tells late that the cube has left the table: it is 10 cm/s fast then.
        for at in 650..2900 {
            let [now, before] = [at, at - 1].map(|at| run[at].devices[device].wrench.force);
            assert!((now - before).norm() < 0.2, "{device} {at}: {before} {now}");
        }
    }
}

/// Without friction nothing lifts the cube but the button.
#[test]
fn two_balls_that_take_hold_lift_a_cube_without_friction() {
    let smooth = ("friction = 0.6", "friction = 0.0");
    let takes = "stiffness = 500.0\npresses = [{ button = 1, from = 0.7, to = 3.0 }]";
    let heights = [&[smooth][..], &[smooth, ("stiffness = 500.0", takes)]].map(|changes| {
        let loaded = changed("lift.toml", changes);
        let world = World::new(&loaded).unwrap();
        let mut session = Session::new(&world, &Options::new(2.1, 1)).unwrap();
        let run: Vec<Telemetry> = std::iter::from_fn(|| session.tick()).collect();
        assert!(least_energy(&run) > -1e-3);
        let positions = session.engine().unwrap().bodies()[0]
            .body()
            .node_positions();
        let sum: Vec3 = positions.iter().sum();
        sum.z / positions.len() as f64
    });
    assert!(heights[0] < 0.021 && heights[1] > 0.055, "{heights:?}");
}

#[test]
fn a_run_that_takes_hold_replays_exactly() {
    let loaded = changed("take.toml", &[COARSE]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(1.4),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&loaded).unwrap(), &options, &mut |_| {}).unwrap();
    let log = Log::parse(&fs::read(path).unwrap()).unwrap();
    // Device, contacts, place, force: the block draws the ball down.
    let touch = &log.rows[1390].touch;
    assert!(log.patches.len() > 70 && touch[7] < -1.0, "{touch:?}");
    let report = replay(&log, &scene_of(&log, "a log").unwrap(), &mut |_| {}).unwrap();
    assert!(report.is_exact(), "{}", report.first.unwrap());
}

/// Two hands pull a block each: one takes hold by orders alone, and the other one presses its button, too.
#[test]
fn orders_take_hold_and_let_go_and_leave_what_a_hand_presses_itself() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let own = fs::read_to_string(scenes.join("take.toml")).unwrap();
    let own = own.replace(COARSE.0, "[6, 6, 3]");
    // The second block, its tool and its device, 0.2 m away, without a button of its hand.
    let (_, tables) = own.split_once("[[body]]").unwrap();
    let (ordered, _) = tables.split_once("[[device.hand.presses]]").unwrap();
    let mut ordered = format!("[[body]]{ordered}");
    for (from, to) in [
        (
            "name = \"block\"",
            "name = \"other block\"\nposition = [0.2, 0.0, 0.0]",
        ),
        ("name = \"ball\"", "name = \"other ball\""),
        ("[0.0, 0.0, 0.045]", "[0.2, 0.0, 0.045]"),
        ("\"omega\"", "\"other\""),
    ] {
        assert!(ordered.contains(from), "{from}");
        ordered = ordered.replace(from, to);
    }
    let text = format!("{own}\n{ordered}");
    let loaded = Scene::load_texts("two.toml", &text, &BTreeMap::new()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    // The first hand presses from 0.6 s to 2.7 s by itself.
    let orders = [0.55, 1.6].map(|at| TimedOrder {
        order: Order::Take,
        at,
    });
    let options = RunOptions {
        duration: Some(1.8),
        log: Some(path.clone()),
        orders: orders.to_vec(),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&loaded).unwrap(), &options, &mut |_| ()).unwrap();
    let log = Log::parse(&fs::read(path).unwrap()).unwrap();
    let buttons = |at: usize| [0, 1].map(|device| log.rows[at].devices[device].buttons);
    assert_eq!(buttons(549), [0, 0]);
    assert_eq!(buttons(550), [1, 1]);
    assert_eq!(buttons(1599), [1, 1]);
    assert_eq!(buttons(1600), [1, 0]);
    // Both pull. The force of the second one goes with its hold.
    let pull = |at: usize| [0, 1].map(|device| -log.rows[at].devices[device].wrench.force.z);
    let [pressed, ordered] = pull(1590);
    assert!(
        pressed > 1.0 && (ordered - pressed).abs() < 0.05 * pressed,
        "{pressed} {ordered}"
    );
    let [pressed, ordered] = pull(1700);
    assert!(pressed > 1.0 && ordered == 0.0, "{pressed} {ordered}");
    // The log has the buttons, so that a replay takes hold in the same ticks.
    let report = replay(&log, &scene_of(&log, "a log").unwrap(), &mut |_| {}).unwrap();
    assert!(report.is_exact());
}
