//! A square wave of force: its edges are in known ticks, the limits of the device hold, and a log of it replays.

use host::log::Log;
use host::run::replay::{replay, scene_of};
use host::run::{Clock, RunOptions, run};
use host::scene::{Override, Scene};
use host::world::World;
use std::error::Error;

type Outcome = Result<(), Box<dyn Error>>;
/// The force on a hand in each tick (N).
type Forces = Vec<[f64; 3]>;

/// The forces of the ticks of a tenth of a second (scene axes), and whether their log replays exactly.
fn forces(fields: &[(&str, &str)]) -> Result<(Forces, bool), Box<dyn Error>> {
    let values: Result<Vec<_>, Box<dyn Error>> = fields
        .iter()
        .map(|(field, value)| Ok(Override::value(field.parse()?, value)))
        .collect();
    let loaded = Scene::embedded_default()?.overridden(&values?)?;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("run.mcap");
    let options = RunOptions {
        duration: Some(0.1),
        log: Some(path.clone()),
        ..RunOptions::new(Clock::Virtual)
    };
    run(&World::new(&loaded)?, &options, &mut |_| {})?;
    let log = Log::parse(&std::fs::read(&path)?)?;
    let report = replay(&log, &scene_of(&log, "a log")?, &mut |_| {})?;
    let ticks = log.rows.iter();
    let forces = ticks
        .map(|row| row.devices[1].wrench.force.into())
        .collect();
    Ok((forces, report.is_exact()))
}

#[test]
fn the_force_changes_its_sign_in_the_ticks_that_the_scene_names() -> Outcome {
    let (without, _) = forces(&[])?;
    let wave = (
        "device[right].square_wave",
        "{ force = [0.0, 0.0, 0.5], half_period = 0.02 }",
    );
    let (with, exact) = forces(&[wave])?;
    assert!(exact, "a log of a square wave replays bit for bit");
    for (tick, (with, without)) in with.iter().zip(&without).enumerate().take(20) {
        // The hand has not moved yet by the wave, so the body's force is the same in the first ticks.
        let expected = if tick < 20 { 0.5 } else { -0.5 };
        let added = with[2] - without[2];
        assert!((added - expected).abs() < 0.1, "{tick}: {added}");
    }
    // The change is that of one tick; the body's force changes little in it.
    for tick in [20, 40, 60, 80] {
        let change = with[tick][2] - with[tick - 1][2];
        let sign = if tick % 40 == 20 { -1.0 } else { 1.0 };
        assert!((change - sign).abs() < 0.1, "{tick}: {change}");
    }
    Ok(())
}

#[test]
fn the_limits_of_the_device_hold_for_the_wave() -> Outcome {
    let wave = (
        "device[right].square_wave",
        "{ force = [0.0, 0.0, 50.0], half_period = 0.02 }",
    );
    let (limited, exact) = forces(&[wave, ("device[right].max_force", "2.0")])?;
    assert!(exact);
    let norms = limited
        .iter()
        .map(|[x, y, z]| (x * x + y * y + z * z).sqrt());
    // The record rounds nothing: the limit scales the whole force.
    assert!(norms.clone().all(|norm| norm <= 2.0 + 1e-12));
    assert!(
        norms.filter(|norm| *norm > 1.999).count() > 90,
        "the wave is at the limit"
    );
    Ok(())
}

#[test]
fn a_wave_faster_than_the_ticks_is_refused() {
    let wave = (
        "device[right].square_wave",
        "{ force = [0.0, 0.0, 1.0], half_period = 0.0001 }",
    );
    let error = forces(&[wave])
        .expect_err("shorter than a tick")
        .to_string();
    assert!(
        error.contains("square_wave.half_period") && error.contains("a tick at least"),
        "{error}"
    );
    let error =
        forces(&[("device[right].square_wave", "{ half_period = 0.1 }")]).expect_err("no force");
    assert!(error.to_string().contains("force"), "{error}");
}
