//! Engagement in whole runs: orders and buttons, what the summary and the log say of them, and what a hand gets.

use devices::panel::{Order, TimedOrder};
use host::log::Log;
use host::run::replay::{replay, scene_of};
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::safety::SafetyState;
use std::collections::BTreeMap;
use std::error::Error;

/// A soft block under one hand, which presses it by 12 mm and holds. `DEVICE` stands for further fields of the device.
const SCENE: &str = "\
name = 'block'
gravity = [0, 0, 0]
[[body]]
name = 'block'
damping = { mass = 0.1, stiffness = 0.02 }
mesh.box = { size = [0.1, 0.1, 0.06], cells = [2, 2, 1] }
material = { young = 8e3, poisson = 0.3, density = 1000 }
[[body.support]]
name = 'table'
group = 'bottom'
[[body.handle]]
name = 'top'
group = 'top'
device = 'hand'
[[device]]
name = 'hand'
model = 'omega3'
DEVICE
[device.hand]
grip = 'firm'
waypoints = [[0, 0, 0, 0], [0.3, 0, 0, -0.004], [0.6, 0, 0, -0.012]]
HAND
";

fn scene(device: &str, hand: &str) -> Result<LoadedScene, Box<dyn Error>> {
    let text = SCENE.replace("DEVICE", device).replace("HAND", hand);
    Ok(Scene::load_texts("block.toml", &text, &BTreeMap::new())?)
}

/// Runs a scene with orders. Returns the summary, and the log after an exact replay.
fn logged(
    loaded: &LoadedScene,
    orders: &[(Order, f64)],
) -> Result<(RunSummary, Log), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let orders = orders.iter().map(|(order, at)| TimedOrder {
        order: *order,
        at: *at,
    });
    let options = RunOptions {
        duration: Some(2.0),
        log: Some(path.clone()),
        orders: orders.collect(),
        ..RunOptions::new(Clock::Virtual)
    };
    let summary = run(&World::new(loaded).unwrap(), &options, &mut |_| {})?;
    let log = Log::parse(&std::fs::read(path)?)?;
    // The log holds the orders and the buttons: a replay engages at the same ticks.
    let report = replay(&log, &scene_of(&log, "a log")?, &mut |_| {})?;
    assert!(report.is_exact());
    Ok((summary, log))
}

fn state(log: &Log, tick: usize) -> (SafetyState, f64) {
    let device = &log.rows[tick].devices[0];
    (device.safety, device.wrench.force.norm())
}

/// Whether an event of the hand with these words lasts over that time.
fn has_event(summary: &RunSummary, words: &str, time: f64) -> bool {
    summary.events.iter().any(|event| {
        event.description == format!("hand: {words}") && event.from <= time && time <= event.to
    })
}

#[test]
fn a_device_waits_to_be_armed_stops_on_an_order_and_waits_again() -> Result<(), Box<dyn Error>> {
    let loaded = scene("engage = { arm = 'command', ramp = 0.3 }", "")?;
    let orders = [(Order::Arm, 0.2), (Order::Stop, 1.0), (Order::Arm, 1.3)];
    let (summary, log) = logged(&loaded, &orders)?;
    // The hand has moved on when it arms the device: the proxy has waited at the top of the block, and continues there.
    assert_eq!(state(&log, 150), (SafetyState::Disarmed, 0.0));
    assert_eq!(state(&log, 250).0, SafetyState::Engaging);
    let (engaged, force) = state(&log, 900);
    assert_eq!(engaged, SafetyState::Normal);
    assert!(force > 0.1, "{force} N");
    assert_eq!(state(&log, 999).0, SafetyState::Normal);
    // The tick of the order renders no force.
    assert_eq!(state(&log, 1000), (SafetyState::Stopped, 0.0));
    assert_eq!(state(&log, 1299), (SafetyState::Stopped, 0.0));
    assert_eq!(state(&log, 1300).0, SafetyState::Engaging);
    assert_eq!(state(&log, 1900).0, SafetyState::Normal);
    let device = &summary.devices[0];
    assert_eq!((device.engaged, device.stopped), (2, 1));
    for (words, time) in [
        ("disarmed, no force", 0.1),
        ("engaging, force coming in", 0.3),
        ("emergency stop, no force", 1.2),
    ] {
        assert!(
            has_event(&summary, words, time),
            "{words}: {:?}",
            summary.events
        );
    }
    // Events are told in the order in which they began.
    assert!(
        summary.events.is_sorted_by(|a, b| a.from <= b.from),
        "{:?}",
        summary.events
    );
    // The bar of the project for the net energy at a hand.
    assert!(summary.energy[0].most_out < 1e-3);
    Ok(())
}

#[test]
fn buttons_of_the_hand_arm_hold_and_stop() -> Result<(), Box<dyn Error>> {
    let buttons = "engage = { arm_button = 1, dead_man_button = 2, stop_button = 3, ramp = 0.1 }";
    let presses = "presses = [
        { button = 1, from = 0.1, to = 0.15 },
        { button = 2, from = 0.2, to = 0.8 },
        { button = 2, from = 1.0, to = 2.0 },
        { button = 3, from = 1.5, to = 1.6 },
    ]";
    let (summary, log) = logged(&scene(buttons, presses)?, &[])?;
    for (tick, expected) in [
        (50, SafetyState::Disarmed),
        (150, SafetyState::HandsOff),
        (250, SafetyState::Engaging),
        (700, SafetyState::Normal),
        (900, SafetyState::HandsOff),
        (1400, SafetyState::Normal),
        (1900, SafetyState::Stopped),
    ] {
        assert_eq!(state(&log, tick).0, expected, "tick {tick}");
    }
    // The force is gone 20 ms after the hand lets go.
    assert!(state(&log, 799).1 > 0.1);
    assert_eq!(state(&log, 822).1, 0.0);
    let device = &summary.devices[0];
    assert_eq!((device.hands_off, device.stopped), (1, 1));
    assert!(summary.energy[0].most_out < 1e-3);
    Ok(())
}

#[test]
fn motors_that_heat_keep_their_continuous_force() -> Result<(), Box<dyn Error>> {
    let (cool, _) = logged(&scene("", "")?, &[])?;
    let (summary, log) = logged(&scene("continuous_force = 0.5\nheat_time = 0.2", "")?, &[])?;
    assert!(cool.devices[0].peak_force > 1.0 && cool.devices[0].hot_ticks == 0);
    assert!(summary.devices[0].hot_ticks > 500);
    let (hot, force) = state(&log, 1999);
    assert_eq!(hot, SafetyState::Hot);
    assert!((force - 0.5).abs() < 0.02, "{force} N");
    // The mean square of the force over the run, by the time constant of the motors.
    let mut mean_square = 0.0;
    for row in &log.rows {
        let force = row.devices[0].wrench.force.norm();
        mean_square += (force * force - mean_square) * 1e-3 / 0.2;
        assert!(mean_square <= 0.25 + 1e-9);
    }
    Ok(())
}

#[test]
fn wrong_values_name_their_field() {
    for (device, hand, expected) in [
        (
            "engage = { arm = 'now' }",
            "",
            "device[0].engage.arm: found 'now'",
        ),
        (
            "engage = { arm_button = 17 }",
            "",
            "device[0].engage.arm_button: found 17",
        ),
        (
            "continuous_force = 0.5\ngrip_weight = [0, 0, -1]",
            "",
            "device[0].continuous_force: found 0.5",
        ),
        (
            "",
            "presses = [{ button = 1, from = 1, to = 0.5 }]",
            "device[0].hand.presses[0].to: found 0.5",
        ),
    ] {
        let error = scene(device, hand).expect_err("refused").to_string();
        assert!(error.contains(expected), "{error}");
    }
    let heavy = scene("grip_weight = [0, 0, -9]", "").expect("it is read");
    let error = run(
        &World::new(&heavy).unwrap(),
        &RunOptions::new(Clock::Virtual),
        &mut |_| {},
    )
    .expect_err("refused");
    let said = error.to_string();
    assert!(
        said.contains("device[0].grip_weight: found a weight of 9.0 N"),
        "{said}"
    );
}

/// A block of this modulus (Pa) and density (kg/m^3) on a table, whose hand holds a lowered handle.
fn heavy(young: f64, density: f64) -> Result<LoadedScene, Box<dyn Error>> {
    let text = format!(
        "\
name = 'press'
host = {{ step_rate = 100, publish_rate = 100 }}
[[body]]
name = 'block'
damping = {{ mass = 0.1, stiffness = 0.02 }}
mesh.box = {{ size = [0.1, 0.1, 0.06], cells = [4, 4, 3] }}
material = {{ law = 'corotational', young = {young}, poisson = 0.4, density = {density} }}
[[body.support]]
name = 'table'
group = 'bottom'
[[body.handle]]
name = 'finger'
group = 'top'
device = 'touch'
[[device]]
name = 'touch'
model = 'omega3'
max_force = 12
mounting.origin = [0, 0, 0.035]
hand = {{ grip = 'firm' }}
"
    );
    Ok(Scene::load_texts("press.toml", &text, &BTreeMap::new())?)
}

/// The force of the device in each tick (N).
fn forces(log: &Log) -> Vec<f64> {
    let rows = log.rows.iter();
    rows.map(|row| row.devices[0].wrench.force.norm()).collect()
}

/// The largest growth from one of these forces to the next (N).
fn growth(forces: &[f64]) -> f64 {
    let pairs = forces.windows(2).map(|pair| pair[1] - pair[0]);
    pairs.fold(0.0, f64::max)
}

/// One count of the omega.3 (m).
const COUNT: f64 = 1e-5;

#[test]
fn stop_and_arm_bring_back_no_more_than_the_force_before() -> Result<(), Box<dyn Error>> {
    for (young, density) in [(30e3, 3000.0), (10e3, 1000.0)] {
        let orders = [(Order::Stop, 1.0), (Order::Arm, 1.5)];
        let (_, log) = logged(&heavy(young, density)?, &orders)?;
        let forces = forces(&log);
        let before = forces[999];
        assert!(before > 0.5, "{before} N");
        assert_eq!(forces[1000..1500].iter().copied().fold(0.0, f64::max), 0.0);
        // 5.6 N and 2.94 N came in the first tick. The hand, which the block pushed away, presses it again.
        let most = forces[1500..].iter().copied().fold(0.0, f64::max);
        assert!(most <= before + 0.05, "{most} N after {before} N");
        // A smooth step over the 0.2 s of the recovery, and a motion of the hand by one count against the block, whose
        // stiffness is at most that of its confined column: 2.14 E A / h at a Poisson's ratio of 0.4.
        let count = COUNT * 2.14 * young * 0.1 * 0.1 / 0.06;
        let growth = growth(&forces[1500..]);
        let most = 2.0 * 1.5 * before * 1e-3 / 0.2 + count;
        assert!(growth < most, "{growth} N, at most {most} N");
    }
    Ok(())
}

#[test]
fn a_stop_gives_no_energy_of_a_lowered_weight() -> Result<(), Box<dyn Error>> {
    let loaded = heavy(10e3, 1000.0)?;
    let energy = |orders: &[(Order, f64)]| -> Result<_, Box<dyn Error>> {
        let (summary, _) = logged(&loaded, orders)?;
        let held_back = summary.held_back.iter().any(|held| held.cause == "cap");
        Ok((summary.energy[0].clone(), held_back))
    };
    let (alone, _) = energy(&[])?;
    let (stopped, held_back) = energy(&[(Order::Stop, 1.0)])?;
    assert!(alone.raised < -2e-3, "{alone:?}");
    assert_eq!(stopped.most_out, 0.0);
    // The hand holds still when it is stopped, up to its creep.
    assert!(
        (stopped.raised - alone.raised).abs() < 0.05e-3,
        "{stopped:?}"
    );
    assert!(stopped.dissipated.is_some_and(|joules| joules >= 0.0));
    assert!(!held_back);
    Ok(())
}

#[test]
fn a_simulated_device_is_engaged_again_along_a_ramp() -> Result<(), Box<dyn Error>> {
    let button =
        "presses = [{ button = 1, from = 0.0, to = 1.2 }, { button = 1, from = 1.5, to = 2.0 }]";
    let cases = [
        ("", "", vec![(Order::Stop, 1.2), (Order::Arm, 1.5)]),
        ("engage = { dead_man_button = 1 }", button, vec![]),
    ];
    for (device, hand, orders) in cases {
        let (_, log) = logged(&scene(device, hand)?, &orders)?;
        let forces = forces(&log);
        let before = forces[1199];
        assert!(before > 0.5, "{before} N");
        assert_eq!(forces[1480], 0.0);
        let growth = growth(&forces[1480..]);
        assert!(
            growth < 2.0 * 1.5 * before * 1e-3 / 0.2,
            "{growth} N: {device:?}"
        );
        // The hand, whose grip is about 0.44 times as stiff as the block, yields. The whole force at once left 0.30 of it.
        assert!(forces[1999] > 0.3 * before, "{} N", forces[1999]);
    }
    Ok(())
}

/// While the force comes in, the proxy follows its device by a part only. The work is that on the device: the simulation
/// integrates it between ticks.
#[test]
fn the_work_while_the_force_comes_in_is_that_on_the_device() -> Result<(), Box<dyn Error>> {
    let turned = "mounting.rotation = { axis = [1, 2, 3], degrees = 40 }\n";
    for further in ["", turned, "motion_scale = 2.0\n"] {
        // The device rests 5 mm above the top of the block, and the hand holds it there.
        let device = format!("mounting.origin = [0, 0, 0.035]\nengage.arm = 'command'\n{further}");
        let text = SCENE.replace("DEVICE", &device).replace("HAND", "");
        // The weight of the block is the force that comes in.
        let text = text.replace("gravity = [0, 0, 0]\n", "");
        let hand = "waypoints = [[0, 0, 0, 0], [0.3, 0, 0, -0.004], [0.6, 0, 0, -0.012]]\n";
        let loaded = Scene::load_texts("block.toml", &text.replace(hand, ""), &BTreeMap::new())?;
        let (summary, _) = logged(&loaded, &[(Order::Arm, 0.05)])?;
        let device = &summary.devices[0];
        let integrated = device.motor_work.ok_or("a simulated device")?;
        assert!(integrated.abs() > 1e-4, "{integrated}");
        // A force that is held over a tick is late by half a tick.
        assert!(
            (device.work / integrated - 1.0).abs() < 0.05,
            "{further}: {} {integrated}",
            device.work
        );
    }
    Ok(())
}
