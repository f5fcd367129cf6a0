//! The forces and motions of the hands are the same under every solver of a scene.

use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::Path;

const SCENES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes");

/// A shipped scene with an additional line under `[host]`.
fn with(name: &str, line: &str) -> Result<LoadedScene, Box<dyn Error>> {
    let text = fs::read_to_string(Path::new(SCENES).join(name))?;
    let text = text.replacen("[host]\n", &format!("[host]\n{line}\n"), 1);
    assert!(text.contains(line));
    Ok(Scene::load_texts(name, &text, &BTreeMap::new())?)
}

fn summary(scene: &LoadedScene, duration: f64) -> Result<RunSummary, Box<dyn Error>> {
    let options = RunOptions {
        duration: Some(duration),
        ..RunOptions::new(Clock::Virtual)
    };
    Ok(run(&World::new(scene).unwrap(), &options, &mut |_| {})?)
}

#[test]
fn forces_are_the_same_under_every_solver() -> Result<(), Box<dyn Error>> {
    for (scene, duration) in [("stretch.toml", 2.0), ("press.toml", 2.5)] {
        let of = |solver: &str| summary(&with(scene, &format!("solver = \"{solver}\""))?, duration);
        let frozen = of("frozen")?;
        for solver in ["auto", "incomplete"] {
            let found = of(solver)?;
            assert_eq!(found.host.faults + found.host.unconverged_steps, 0);
            assert_eq!(found.host.steps, frozen.host.steps);
            for (ours, other) in found.devices.iter().zip(&frozen.devices) {
                // Both solve to the same tolerance. A hundredth is a tenth of the just-noticeable difference.
                let off = (ours.peak_force - other.peak_force).abs();
                assert!(off < 0.01 * other.peak_force, "{scene} {solver}: {off}");
                let off = (ours.reach - other.reach).abs();
                assert!(off < 0.01 * other.reach, "{scene} {solver}: {off}");
            }
        }
    }
    Ok(())
}

/// At 1 kHz, factors are read ahead before steps take them.
#[test]
fn factors_arrive_at_every_rate() -> Result<(), Box<dyn Error>> {
    let text = fs::read_to_string(Path::new(SCENES).join("stretch.toml"))?;
    for rate in ["100.0", "500.0", "1000.0"] {
        let text = text.replace("_rate = 250.0", &format!("_rate = {rate}"));
        let scene = Scene::load_texts("stretch.toml", &text, &BTreeMap::new())?;
        let [one, two] = [summary(&scene, 1.5)?, summary(&scene, 1.5)?];
        assert!(one.host.factors > 1, "{rate}: {}", one.host.factors);
        assert_eq!(one.host.faults + one.host.unconverged_steps, 0);
        assert_eq!(one.host.factors, two.host.factors);
        for (one, two) in one.devices.iter().zip(&two.devices) {
            assert_eq!(one.peak_force.to_bits(), two.peak_force.to_bits());
        }
    }
    Ok(())
}

#[test]
fn a_budget_ends_steps_early_and_the_summary_reports_it() -> Result<(), Box<dyn Error>> {
    // The budget is a nanosecond, so every step ends after its first iteration.
    let scene = with("stretch.toml", "solver = \"frozen\"\nbudget = 1e-9")?;
    let options = RunOptions {
        duration: Some(0.5),
        ..RunOptions::new(Clock::Real)
    };
    let real = run(&World::new(&scene).unwrap(), &options, &mut |_| {})?;
    assert_eq!(real.host.iterations[2], 1, "one iteration, never more");
    assert!(real.host.unconverged_steps > 0);
    // Virtual time has no budget, so the two runs are the same.
    let exact = summary(&scene, 0.5)?;
    assert_eq!(exact.host.unconverged_steps, 0);
    Ok(())
}
