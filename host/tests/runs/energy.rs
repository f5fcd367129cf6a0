//! The energy account in whole runs: it equals the work at the devices, a cap without cause changes nothing, and every
//! trip is reported.

use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::{Telemetry, Vec3};
use sim::DeviceModel;
use std::collections::BTreeMap;
use std::error::Error;
use support::watched;

const STRETCH: &str = include_str!("../../scenes/stretch.toml");

/// A shipped scene in which each of the given pieces of text is replaced.
fn with(text: &str, changes: &[(&str, &str)]) -> Result<LoadedScene, Box<dyn Error>> {
    let mut text = text.to_owned();
    for (piece, instead) in changes {
        assert!(text.contains(piece), "{piece} is not in the scene");
        text = text.replace(piece, instead);
    }
    Ok(Scene::load_texts("x.toml", &text, &BTreeMap::new())?)
}

fn summary(scene: &LoadedScene, duration: f64) -> Result<RunSummary, Box<dyn Error>> {
    Ok(seen(scene, duration)?.0)
}

/// The summary of a run, and the force on every hand in every tick.
fn seen(scene: &LoadedScene, duration: f64) -> Result<(RunSummary, Vec<Vec3>), Box<dyn Error>> {
    let options = RunOptions {
        duration: Some(duration),
        ..RunOptions::new(Clock::Virtual)
    };
    let (summary, ticks) = watched::ticks(&World::new(scene)?, &options)?;
    let each = ticks.iter().flat_map(Telemetry::devices);
    Ok((summary, each.map(|device| device.wrench.force).collect()))
}

fn rms(forces: impl Iterator<Item = Vec3>) -> f64 {
    let (sum, count) = forces.fold((0.0, 0), |(sum, n), f| (sum + f.norm_squared(), n + 1));
    (sum / f64::from(count)).sqrt()
}

#[test]
fn without_faults_the_cap_changes_the_force_by_less_than_a_hand_can_notice()
-> Result<(), Box<dyn Error>> {
    // A model arrives in every tick without latency. The largest stiffness, some 100 N/m, is far below 2 b / T = 1,000
    // N/m.
    let healthy = [
        ("step_rate = 250.0", "step_rate = 1000.0"),
        ("publish_rate = 250.0", "publish_rate = 1000.0"),
        ("latency = 0.004", "latency = 0.0"),
    ];
    let of = |scheme: &str| {
        let named = format!("scheme = \"{scheme}\"");
        let linear = [("scheme = \"capped\"", named.as_str())];
        let scene = with(STRETCH, &[&healthy[..], &linear[..]].concat())?;
        Ok::<_, Box<dyn Error>>(seen(&scene, 6.0)?.1)
    };
    let (linear, capped) = (of("linear")?, of("capped")?);
    assert_eq!(linear.len(), 2 * 6000);
    let off = rms(linear.iter().zip(&capped).map(|(a, b)| a - b)) / rms(linear.iter().copied());
    println!("off by {:.3} %", 100.0 * off);
    // The limit is a tenth of the just-noticeable difference.
    assert!(off < 0.01, "{off}");
    assert!(off > 0.0, "the two schemes were the same");
    Ok(())
}

#[test]
fn the_work_of_the_hands_is_the_work_taken_by_the_motors() -> Result<(), Box<dyn Error>> {
    let falcon = DeviceModel::named("falcon").ok_or("no falcon")?;
    for scheme in ["hold", "linear", "classic", "capped"] {
        let named = format!("scheme = \"{scheme}\"");
        let scene = with(STRETCH, &[("scheme = \"capped\"", &named)])?;
        let (found, forces) = seen(&scene, 6.0)?;
        let motors: f64 = found.devices.iter().filter_map(|d| d.motor_work).sum();
        let port: f64 = found.devices.iter().filter_map(|d| d.port_work).sum();
        // At the port the work lacks the losses of the mechanisms. The cap relies on two fifths of them at most; the
        // handles rest at both ends.
        let credited: f64 = found.energy.iter().map(|body| body.credited).sum();
        assert!(
            motors - port > credited / 0.4,
            "{scheme}: {motors} {port} {credited}"
        );
        let supplied: f64 = found.energy.iter().map(|body| body.supplied).sum();
        // Encoders have an error of at most half a count, so every change of the force changes the work by that
        // displacement. The account does not yet contain the last tick, of some newtons at some centimetres a second.
        let changes = forces
            .iter()
            .zip(&forces[2..])
            .map(|(a, b)| (b - a).abs().sum());
        let tolerance = 0.5 * falcon.position_step * changes.sum::<f64>() + 2e-4;
        let off = (supplied + motors).abs();
        println!("{scheme}: {supplied:.6} {motors:.6}, off by {off:.1e} of {tolerance:.1e}");
        assert!(off < tolerance, "{scheme}: {supplied} {motors}");
        for body in &found.energy {
            let reported = body.dissipated.is_some();
            assert_eq!(reported, scheme == "capped" || scheme == "classic");
        }
    }
    Ok(())
}

#[test]
fn every_trip_is_counted_and_reported_with_its_cause() -> Result<(), Box<dyn Error>> {
    let limits = "model = \"falcon\"\nmax_speed = 0.02\nmax_reach = 0.01\nmax_slew = 20.0";
    let scene = with(STRETCH, &[("model = \"falcon\"", limits)])?;
    let found = summary(&scene, 6.0)?;
    for device in &found.devices {
        assert!(device.too_fast > 0, "{device:?}");
        assert!(device.out_of_reach > 0, "{device:?}");
        assert!(device.slewed_ticks > 0, "{device:?}");
        let trip = device.first_trip.as_ref().ok_or("nothing tripped")?;
        assert!(trip.found > trip.limit, "{trip:?}");
        let limit = match trip.unit {
            "N/s" => 20.0,
            "m/s" => 0.02,
            _ => 0.01,
        };
        assert_eq!(trip.limit, limit);
    }
    let text = found.to_string();
    for part in [
        "too fast",
        "out of reach",
        "at its slew limit",
        "first trip at",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
    assert!(
        found
            .events
            .iter()
            .any(|event| event.description.contains("force fading"))
    );
    Ok(())
}
