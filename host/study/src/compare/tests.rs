use super::*;
use crate::stress::scene::Study;
use crate::stress::scene::draw::{Choice, Trouble};
use host::run::{Clock, RunOptions};
use host::scene::Scene;
use host::world::World;
use std::collections::BTreeMap;

const SHEET: &str = include_str!("../../../scenes/stress/sheet.toml");

fn sheet() -> LoadedScene {
    let loaded = Scene::load_texts("sheet.toml", SHEET, &BTreeMap::new());
    let mut loaded = loaded.expect("the scene is sound");
    for device in &mut loaded.scene.devices {
        // The reports of a device round to 32 bits.
        device.wire = Some(false);
    }
    loaded
}

fn compared(settings: &Settings) -> Comparison {
    compare(&sheet(), settings, &|_| ()).expect("it runs")
}

fn of<'a>(found: &'a Comparison, scheme: &str, rate: f64) -> &'a Run {
    let mut runs = found.runs.iter();
    let run = runs.find(|run| run.scheme == scheme && run.publish_rate == rate);
    run.expect("it was run")
}

#[test]
fn each_run_is_the_run_of_the_scene_under_that_scheme() {
    let settings = Settings {
        schemes: vec![SchemeName::Capped, SchemeName::Classic],
        seed: Some(7),
        duration: Some(1.2),
        without_reference: true,
        ..Settings::default()
    };
    let found = compared(&settings);
    assert_eq!(found.runs.len(), 2);
    for (run, scheme) in found
        .runs
        .iter()
        .zip([SchemeName::Classic, SchemeName::Capped])
    {
        let mut loaded = sheet();
        loaded.scene.realtime.scheme = scheme;
        let options = RunOptions {
            seed: Some(7),
            duration: Some(1.2),
            ..RunOptions::new(Clock::Virtual)
        };
        let expected =
            host::run::run(&World::new(&loaded).unwrap(), &options, &mut |_| ()).expect("it runs");
        assert_eq!(run.scheme, expected.scheme);
        for (device, expected) in run.measures.devices.iter().zip(&expected.devices) {
            // Devices are not scaled here, and no limit acts: the motors hold what the tick commands.
            assert_eq!(device.peak_force, expected.peak_force);
            // Rounding: one side divides by the rate, the other multiplies by the period.
            assert!((device.peak_time - expected.peak_time).abs() < 1e-12);
        }
        let capped = expected.energy[0].capped_ticks as f64 / expected.tick.count as f64;
        assert_eq!(run.measures.bodies[0].capped, capped);
        let age = run.measures.bodies[0].model_age.expect("models arrive");
        assert_eq!(
            age,
            [
                expected.tick.model_age[0].p50,
                expected.tick.model_age[0].max
            ]
        );
    }
}

#[test]
fn results_depend_on_no_number_of_threads() {
    let [one, three] = [1, 3].map(|threads| {
        let settings = Settings {
            schemes: vec![SchemeName::Linear, SchemeName::Capped],
            duration: Some(0.7),
            threads: NonZero::new(threads),
            ..Settings::default()
        };
        let found = compared(&settings);
        (
            serde_json::to_string(&found).expect("it is finite"),
            csv(&found),
        )
    });
    assert_eq!(one, three);
    let (json, table) = one;
    assert!(
        json.starts_with(r#"{"schema":"palpate.compare/1""#),
        "{json}"
    );
    assert_eq!(table.lines().count(), 1 + 700);
    let columns = table.lines().next().expect("a head").split(',').count();
    // The time; then two quantities along three axes of two devices, in two runs and the reference.
    assert_eq!(columns, 1 + 3 * 2 * 2 * 3);
}

#[test]
fn errors_against_the_reference_fall_with_the_rate_and_separate_the_schemes() {
    let found = compared(&Settings {
        schemes: vec![SchemeName::Hold, SchemeName::Linear],
        publish_rates: vec![20.0, 250.0],
        duration: Some(2.0),
        ..Settings::default()
    });
    assert_eq!(found.runs.len(), 4);
    let error = |scheme, rate| {
        let run = of(&found, scheme, rate);
        let error = |device: &DeviceMeasures| device.error.expect("a reference").rms;
        run.measures.worst(error)
    };
    // A held force is late by half a period and by the latency. The error of `linear` at 250 Hz is that of the encoder's
    // counts.
    assert!(error("hold", 250.0) < 0.5 * error("hold", 20.0));
    assert!(error("linear", 250.0) < error("linear", 20.0));
    assert!(error("linear", 20.0) < 0.5 * error("hold", 20.0));
    // The sheet of the scene has no weight, but its hands pull from 0.5 s on: the first forces have faded in by then.
    assert!(
        (0.45..0.5).contains(&found.measured_from),
        "{}",
        found.measured_from
    );
    for run in &found.runs {
        for device in &run.measures.devices {
            let error = device.error.expect("a reference");
            assert!(error.largest_time >= found.measured_from && error.rms <= error.largest);
        }
    }
    // The reference is passive: its force is constant between ticks, which costs up to 1 uJ.
    let reference = found.reference.as_ref().expect("a reference");
    assert!(reference.net_energy < 1e-6);
    // No model is younger than the latency of the host, or older than latency and period with a tick of each.
    for run in &found.runs {
        let [median, most] = run.measures.bodies[0].model_age.expect("models arrive");
        assert!(median <= most && most <= found.latency + 1.0 / run.publish_rate + 3e-3);
    }
}

#[test]
fn a_late_held_force_throws_the_hands_and_an_extrapolated_one_does_not() {
    let mut late = sheet();
    late.scene.host.latency = 0.08;
    let settings = Settings {
        schemes: vec![SchemeName::Hold, SchemeName::Linear],
        publish_rates: vec![20.0],
        duration: Some(3.0),
        ..Settings::default()
    };
    let found = compare(&late, &settings, &|_| ()).expect("it runs");
    let [held, linear] = ["hold", "linear"].map(|scheme| of(&found, scheme, 20.0));
    // Joules, against the allowance of the stress studies.
    assert!(held.measures.net_energy > 0.1, "{:?}", held.measures);
    assert!(linear.measures.net_energy < 1e-3, "{:?}", linear.measures);
    // The oscillation drives the motors to their limit.
    assert!(held.measures.worst(|device| device.limited) > 0.0);
    assert!((held.measures.worst(|device| device.peak_force) - 8.0).abs() < 1e-9);
    assert_eq!(linear.measures.worst(|device| device.limited), 0.0);
}

#[test]
fn a_rate_at_which_the_host_cannot_publish_is_refused() {
    let settings = Settings {
        publish_rates: vec![60.0],
        ..Settings::default()
    };
    let refused = compare(&sheet(), &settings, &|_| ()).expect_err("1000 / 60 is not whole");
    assert_eq!(
        refused.to_string(),
        "--publish-rates: found 60.0, allowed: host.step_rate of the scene, 1000.0, divided by a whole number"
    );
}

#[test]
fn a_stall_ages_the_models_and_a_panic_is_a_failure() {
    let fault = |kind, at, duration| HostFault { kind, at, duration };
    let found = compared(&Settings {
        schemes: vec![SchemeName::Linear],
        duration: Some(1.5),
        without_reference: true,
        faults: vec![
            fault(host::engine::faults::FaultKind::Stall, 0.6, 0.4),
            fault(host::engine::faults::FaultKind::Panic, 1.2, 0.0),
        ],
        ..Settings::default()
    });
    let run = &found.runs[0];
    let [_, most] = run.measures.bodies[0].model_age.expect("models arrive");
    assert!(most > 0.4, "{most}");
    assert!(
        run.failures[0].contains("the host panicked"),
        "{:?}",
        run.failures
    );
    assert_eq!(run.record.out.len(), 1500);
}

/// No system gives a thread with this stack.
#[test]
fn without_threads_the_calling_thread_does_the_work() {
    let jobs = [1, 2, 3];
    for stack in [workers::STACK, usize::MAX / 2] {
        let threads = NonZero::new(2);
        let done = in_threads(threads, &jobs, stack, &|job| {
            (10 * job, std::thread::current().id())
        });
        let here = done
            .iter()
            .filter(|(_, id)| *id == std::thread::current().id());
        assert_eq!(here.count(), if stack == workers::STACK { 0 } else { 3 });
        assert!(done.iter().map(|(result, _)| *result).eq([10, 20, 30]));
    }
}

/// Two hands tear a square of cloth from a notch between them, until it is almost torn through.
const CLOTH: &str = r#"
name = "tear"
duration = 0.6
gravity = [0, 0, 0]
[host]
step_rate = 1000.0
publish_rate = 250.0
latency = 0.002
[[body]]
name = "cloth"
mesh.sheet = { length = 0.2, width = 0.2, cells = [10, 10], pattern = "alternating" }
material = { young = 8e6, poisson = 0.3, thickness = 0.0005, density = 400 }
damping = { mass = 0.5, stiffness = 0.0005 }
[body.tear]
strength = 8e5
toughness = 500.0
[[body.tear.notch]]
from = [0.0, 0.1, 0.0]
to = [0.0, 0.06, 0.0]
[[body.handle]]
name = "a"
box = [[-0.045, 0.07, -0.01], [-0.015, 0.101, 0.01]]
device = "left"
[[body.handle]]
name = "b"
box = [[0.015, 0.07, -0.01], [0.045, 0.101, 0.01]]
device = "right"
[[device]]
name = "left"
model = "omega3"
hand = { grip = "rigid", waypoints = [[0, 0, 0, 0], [0.6, -0.02, 0, 0]] }
[[device]]
name = "right"
model = "omega3"
hand = { grip = "rigid", waypoints = [[0, 0, 0, 0], [0.6, 0.02, 0, 0]] }
"#;

#[test]
fn the_reference_tears_as_the_run_does() {
    let compared = |text: &str| {
        let loaded = Scene::load_texts("cloth.toml", text, &BTreeMap::new());
        let settings = Settings {
            schemes: vec![SchemeName::Capped],
            ..Settings::default()
        };
        compare(&loaded.expect("the scene is sound"), &settings, &|_| ()).expect("it runs")
    };
    let torn = compared(CLOTH);
    let whole = compared(&CLOTH.replace("toughness = 500.0", "toughness = 5e5"));
    let peak = |found: &Comparison| {
        let reference = found.reference.as_ref().expect("a reference");
        reference.worst(|device| device.peak_force)
    };
    // The cloth that does not tear carries the largest force of the device.
    assert!(peak(&whole) > 11.0, "{} N", peak(&whole));
    // The cloth that tears lets go at half of it. The force of a tear depends on the length of the step, which is the
    // tick's in the reference, so the run's peak is not that of the reference.
    assert!(peak(&torn) < 0.6 * peak(&whole), "{} N", peak(&torn));
    let run = torn.runs[0].measures.worst(|device| device.peak_force);
    assert!(run < 0.6 * peak(&whole), "{run} N");
}

#[test]
fn scenes_in_which_a_body_tears_are_run() {
    let loaded = Scene::load_texts("cloth.toml", CLOTH, &BTreeMap::new());
    let choice = Choice {
        rates: vec![250.0],
        troubles: vec![Trouble::Nothing, Trouble::Softening, Trouble::All],
    };
    let study = Study::among(loaded.expect("the scene is sound"), 1, choice);
    let study = study.expect("the scene is sound");
    let capped = SCHEMES
        .iter()
        .filter(|(scheme, _)| *scheme == SchemeName::Capped);
    let capped: Vec<_> = capped.copied().collect();
    for cell in 0..6 {
        let found = study.cell(cell, &capped);
        assert_eq!(found.failed, None);
        // The engine keeps the material of a body that tears.
        assert_eq!(found.draw.softening, None);
    }
}

#[test]
fn the_reference_feels_what_its_bodies_touch() {
    const BLOCKS: &str = include_str!("../../../scenes/pressed_blocks.toml");
    let loaded = Scene::load_texts("pressed_blocks.toml", BLOCKS, &BTreeMap::new());
    let settings = Settings {
        schemes: vec![SchemeName::Capped],
        ..Settings::default()
    };
    let found = compare(&loaded.expect("the scene is sound"), &settings, &|_| ());
    let found = found.expect("it runs");
    for device in &found.runs[0].measures.devices {
        let error = device.error.expect("there is a reference");
        assert!(device.peak_force > 1.0, "{}", device.peak_force);
        // The host steps at 250 Hz, the reference at 1000 Hz.
        assert!(error.relative < 0.03, "{error:?}");
    }
}

/// The reference moves handles. A scene with a tool has none, and the comparison says why.
#[test]
fn a_scene_with_a_tool_has_no_reference() {
    const LIFT: &str = include_str!("../../../scenes/lift.toml");
    let loaded = Scene::load_texts("lift.toml", LIFT, &BTreeMap::new());
    let settings = Settings {
        schemes: vec![SchemeName::Capped],
        duration: Some(0.1),
        ..Settings::default()
    };
    let found = compare(&loaded.expect("the scene is sound"), &settings, &|_| ());
    let found = found.expect("it runs");
    let why = found.no_reference.as_deref().unwrap_or_default();
    assert!(why.contains("\"left ball\""), "{why}");
    let devices = found.runs[0].measures.devices.iter();
    assert!(devices.into_iter().all(|device| device.error.is_none()));
}
