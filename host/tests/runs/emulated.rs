//! Scenes with emulated devices: the forces are those of simulated devices, but for the encoders and the delay.

use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::scene::{LoadedScene, Override, Scene};
use host::world::World;
use rt_core::Vec3;
use runner::link::LogRecord;
use std::collections::BTreeMap;
use std::error::Error;

const STRETCH: &str = include_str!("../../scenes/stretch.toml");
/// Length of the runs (s).
const DURATION: f64 = 4.0;

/// The default scene with two devices of a model, both with the same connection.
fn scene(model: &str, connect: &str) -> Result<LoadedScene, Box<dyn Error>> {
    let text = STRETCH.replace("model = \"falcon\"", &format!("model = \"{model}\""));
    let scene = Scene::load_texts("x.toml", &text, &BTreeMap::new())?;
    let both = ["left", "right"].map(|name| Override::connection(name, connect));
    Ok(scene.overridden(&both)?)
}

/// The force on each hand in every tick.
fn forces(scene: &LoadedScene) -> Result<Vec<Vec3>, Box<dyn Error>> {
    let built = Prepared::new(&World::new(scene).unwrap(), &Options::new(DURATION, 1))?;
    let mut forces = Vec::new();
    let sink = |record: LogRecord<'_>| {
        if let LogRecord::Tick(telemetry) = record {
            forces.extend(telemetry.devices().map(|device| device.wrench.force));
        }
    };
    Session::of(built).run(sink);
    Ok(forces)
}

fn rms(forces: impl Iterator<Item = Vec3>) -> f64 {
    let (sum, count) = forces.fold((0.0, 0), |(sum, n), f| (sum + f.norm_squared(), n + 1));
    (sum / f64::from(count)).sqrt()
}

#[test]
fn forces_in_emulated_devices_are_those_in_simulated_ones() -> Result<(), Box<dyn Error>> {
    // The states and wrenches are up to two milliseconds late, in which a hand at 0.1 m/s moves by 0.2 mm, and a count of
    // WoodenHaptics is 0.06 mm; the hands stretch the sheet by 20 mm and more.
    let limit = 0.02;
    for model in ["falcon", "woodenhaptics", "omega3"] {
        let simulated = forces(&scene(model, "sim")?)?;
        let emulated = forces(&scene(model, "emulated")?)?;
        assert_eq!(simulated.len(), emulated.len());
        let whole = rms(simulated.iter().copied());
        let off = rms(simulated.iter().zip(&emulated).map(|(a, b)| a - b));
        println!(
            "{model}: {whole:.3} N, off by {off:.4} N, {:.2} %",
            100.0 * off / whole
        );
        assert!(whole > 0.5 && off > 0.0 && off < limit * whole, "{model}");
    }
    Ok(())
}

#[test]
fn a_run_with_emulated_devices_is_a_function_of_scene_and_seed() -> Result<(), Box<dyn Error>> {
    let scene = scene("falcon", "emulated")?;
    assert_eq!(forces(&scene)?, forces(&scene)?);
    Ok(())
}

#[test]
fn an_emulated_device_is_calibrated_at_its_origin_and_has_no_other_wire() {
    let device = |fields: &str| {
        let more = format!("model = \"omega3\"\nconnect = \"emulated\"\n{fields}\n");
        let text = STRETCH.replacen("model = \"falcon\"", &more, 1);
        let own = "wire = true              # states";
        assert!(text.contains(own));
        let text = text.replacen(own, "# states", 1);
        let scene = Scene::load_texts("x.toml", &text, &BTreeMap::new())?;
        Prepared::new(&World::new(&scene).unwrap(), &Options::new(0.01, 1)).map(|_| ())
    };
    let said = |fields: &str| device(fields).expect_err("refused").to_string();
    let origin = said("mounting.origin = [0.0, 0.0, 0.2]");
    assert!(origin.contains("leave `mounting.origin` out"), "{origin}");
    let wire = said("wire = true");
    assert!(wire.contains("device[0].wire"), "{wire}");
}
