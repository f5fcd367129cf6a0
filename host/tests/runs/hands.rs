//! Hands of scenes: grips, tasks, and devices of six degrees of freedom.

use host::run::prepare::controls;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::{DeviceState, Freedom, Vec3};
use sim::{Arm, Wrist};
use std::collections::BTreeMap;
use std::error::Error;

type Outcome = Result<(), Box<dyn Error>>;

/// A scene with two devices and the given hands.
fn scene(model: &str, left: &str, right: &str) -> Result<LoadedScene, Box<dyn Error>> {
    let device = |name: &str, hand: &str| {
        format!("[[device]]\nname = \"{name}\"\nmodel = \"{model}\"\nhand = {{ {hand} }}\n\n")
    };
    let text = format!(
        "name = \"hands\"\n\n[[body]]\nname = \"sheet\"\n\
         mesh.sheet = {{ length = 0.2, width = 0.1, cells = [4, 2] }}\n\
         material = {{ young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }}\n\n{}{}",
        device("left", left),
        device("right", right),
    );
    Ok(Scene::load_texts("hands.toml", &text, &BTreeMap::new())?)
}

/// The readings of both devices over four seconds without force, every 10 ms.
fn shown(loaded: &LoadedScene, seed: u64) -> Result<Vec<[DeviceState; 2]>, Box<dyn Error>> {
    let (_, mut devices) = controls(&World::new(loaded).unwrap(), seed)?;
    let [left, right] = devices.as_mut_slice() else {
        return Err("not two devices".into());
    };
    (0..400)
        .map(|k| Ok([left.read(k * 10_000_000)?, right.read(k * 10_000_000)?]))
        .collect()
}

#[test]
fn grips_supply_the_numbers_that_a_scene_omits() -> Outcome {
    let loaded = scene(
        "falcon",
        "grip = \"firm\"",
        "grip = \"rigid\", damping = 10, tremor = 0",
    )?;
    let hand = |index: usize| loaded.scene.devices[index].hand.as_ref().expect("held");
    assert_eq!(hand(0).arm(), Arm::FIRM);
    assert_eq!(Some(hand(0).wrist()), Wrist::named("firm"));
    let expected = Arm {
        damping: 10.0,
        ..Arm::RIGID
    };
    assert_eq!(hand(1).arm(), expected);
    let loaded = scene("falcon", "mass = 0.2", "grip = \"relaxed\"")?;
    let hand = |index: usize| loaded.scene.devices[index].hand.as_ref().expect("held");
    let expected = Arm {
        mass: 0.2,
        ..Arm::TYPICAL
    };
    assert_eq!(hand(0).arm(), expected);
    assert_eq!(hand(1).arm(), Arm::RELAXED);
    Ok(())
}

#[test]
fn hands_perform_their_tasks_and_seeds_vary_them() -> Outcome {
    let press = "grip = \"rigid\", task = \"press_and_hold\", direction = [0, 0, -1], depth = 0.02";
    let states = shown(&scene("falcon", press, press)?, 1)?;
    let [left, right] = states[399];
    for state in [left, right] {
        let place = state.pose.position;
        // The depth varies by a tenth, and friction of 0.3 N reduces it by the deflection of a spring of 2,000 N/m.
        assert!((-0.0221..=-0.0178).contains(&place.z), "{place}");
        assert!(place.xy().norm() < 1e-4);
    }
    // Each hand varies the task, and varies it differently under another seed.
    assert_ne!(left.pose.position, right.pose.position);
    let again = shown(&scene("falcon", press, press)?, 2)?;
    assert_ne!(again[399][0].pose.position, left.pose.position);

    // The hands of `move_together` have the same motion under every seed.
    let round = "grip = \"firm\", task = \"move_together\", direction = [1, 0, 0]";
    let loaded = scene("falcon", round, round)?;
    let (a, b) = (shown(&loaded, 1)?, shown(&loaded, 2)?);
    assert!(a.iter().all(|[left, right]| left == right));
    assert_ne!(a, b);
    Ok(())
}

#[test]
fn a_task_that_no_hand_can_follow_is_refused_with_its_line() -> Outcome {
    let fast = "task = \"tap\", direction = [0, 0, 1], depth = 0.01, speed = 5, variation = 0";
    let error = controls(&World::new(&scene("falcon", fast, "")?).unwrap(), 1)
        .err()
        .ok_or("no error")?;
    assert_eq!(
        error.to_string(),
        "hands.toml:11: device[0].hand.speed: a reach of 0.01 m at 5 m/s takes less than 0.05 s, and no \
         hand is so fast: lower the speed"
    );
    let nowhere = "task = \"tap\", direction = [0, 0, 0]";
    let error = controls(&World::new(&scene("falcon", "", nowhere)?).unwrap(), 1)
        .err()
        .ok_or("no error")?;
    assert_eq!(
        error.to_string(),
        "hands.toml:16: device[1].hand.direction: a task's direction must be finite and not zero, not \
         [0.0, 0.0, 0.0]"
    );
    Ok(())
}

#[test]
fn a_device_of_six_degrees_of_freedom_can_be_named() -> Outcome {
    let loaded = scene("virtuose6d", "grip = \"firm\"", "")?;
    let (config, devices) = controls(&World::new(&loaded).unwrap(), 1)?;
    for (device, config) in devices.iter().zip(&config.devices) {
        assert_eq!(device.capabilities().actuated, Freedom::Six);
        assert_eq!(config.safety.max_moment, 1.0);
    }
    // A hand that holds still does not turn its handle.
    let states = shown(&loaded, 1)?;
    assert_eq!(states[399][0].pose.rotation.scaled_axis(), Vec3::zeros());
    Ok(())
}

/// A scene whose device has these fields instead of its hand.
fn with_fields(fields: &str) -> String {
    format!(
        "name = \"drivers\"\n\n[[body]]\nname = \"sheet\"\n\
         mesh.sheet = {{ length = 0.2, width = 0.1, cells = [4, 2] }}\n\
         material = {{ young = 1e6, poisson = 0.3, thickness = 0.001, density = 1000 }}\n\n\
         [[device]]\nname = \"left\"\nmodel = \"falcon\"\n{fields}\n"
    )
}

/// The error of the scene with these fields, when it is loaded or when its devices are opened.
fn refused(fields: &str) -> Result<String, Box<dyn Error>> {
    let loaded = Scene::load_texts("x.toml", &with_fields(fields), &BTreeMap::new());
    let opened = loaded.and_then(|loaded| controls(&World::new(&loaded).unwrap(), 1));
    Ok(opened.err().ok_or("no error")?.to_string())
}

#[test]
fn a_connection_is_refused_with_its_line() -> Outcome {
    for (fields, expected) in [
        (
            "",
            "x.toml:8: device[0].hand: found none, allowed: the hand that holds this simulated device \
             (`hand = {}` suffices)",
        ),
        (
            "connect = \"hid:1209:0001\"\nhand = {}",
            "x.toml:12: device[0].hand: found the connection \"hid:1209:0001\", allowed: no such field: only a \
             simulated device has a hand",
        ),
        (
            "connect = \"hid:1209:0001\"\nwire = true",
            "x.toml:12: device[0].wire: found the connection \"hid:1209:0001\", allowed: no such field: only a \
             device with `connect = \"sim\"` has `wire`",
        ),
        (
            "firmware = \"nvent.bin\"\nhand = {}",
            "x.toml:11: device[0].firmware: found the connection \"sim\", allowed: no such field: only a real \
             device has a firmware file",
        ),
        (
            "connect = \"hdi\"",
            "x.toml:11: device[0].connect: found hdi, allowed: sim, emulated, hid, tty, tcp, woodenhaptics, falcon, plugin",
        ),
        (
            "connect = \"hid:1209:0001\"",
            "x.toml:11: device[0].connect: found hid:1209:0001, allowed: a simulated device, as this \
             command runs in virtual time: `--device left=sim` simulates the device, and `palpate run --clock real` uses \
             the real one",
        ),
        (
            "hand = {}\nconnect = \"sim:left\"",
            "x.toml:12: device[0].connect: found left, allowed: no address for this driver",
        ),
    ] {
        assert_eq!(refused(fields)?, expected, "{fields}");
    }
    Ok(())
}

#[test]
fn an_emulated_device_is_refused_under_the_real_clock() -> Outcome {
    let text = with_fields("hand = {}\nconnect = \"emulated\"");
    let loaded = Scene::load_texts("x.toml", &text, &BTreeMap::new())?;
    let mut options = RunOptions::new(Clock::Real);
    options.duration = Some(0.01);
    let error = run(&World::new(&loaded).unwrap(), &options, &mut |_| ())
        .expect_err("its protocol is computed in the tick");
    assert_eq!(
        error.to_string(),
        "x.toml:12: device[0].connect: found emulated, allowed: an emulated device needs virtual time (`--clock virtual`); \
         for the real clock, give the connection that `palpate device emulate` prints, or `--device left=sim`"
    );
    Ok(())
}

#[test]
fn an_unknown_driver_is_refused_before_anything_is_opened() {
    let load = |driver: &str| {
        let text = with_fields(&format!("connect = \"{driver}\""));
        Scene::load_texts("x.toml", &text, &BTreeMap::new())
    };
    let error = load("hdi").expect_err("no driver has this name");
    let found = error.to_string();
    let place = "x.toml:11: device[0].connect: found hdi, allowed: ";
    assert!(found.starts_with(place), "{found}");
    // A driver that is known is loaded, although it lacks an address and needs the real clock.
    assert!(load("hid").is_ok());
}
