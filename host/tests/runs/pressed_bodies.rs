//! Bodies that hands press on each other: the account of each body knows the energy that the contact brought, so every hand
//! feels the force of its body.

use host::run::prepare::{Options, Prepared};
use host::run::session::Session;
use host::run::summary::RunSummary;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use runner::link::LogRecord;
use std::collections::BTreeMap;
use std::error::Error;

const BLOCKS: &str = include_str!("../../scenes/pressed_blocks.toml");

fn load(text: &str) -> Result<LoadedScene, Box<dyn Error>> {
    Ok(Scene::load_texts("x.toml", text, &BTreeMap::new())?)
}

fn summary(scene: &LoadedScene) -> Result<RunSummary, Box<dyn Error>> {
    let options = RunOptions::new(Clock::Virtual);
    Ok(run(&World::new(scene)?, &options, &mut |_| {})?)
}

/// The largest sum of the forces on the two hands along z while both rest, and the largest force (N).
fn forces(scene: &LoadedScene) -> Result<[f64; 2], Box<dyn Error>> {
    let built = Prepared::new(&World::new(scene)?, &Options::new(4.0, 1))?;
    let mut found = [0.0_f64; 2];
    Session::of(built).run(|record: LogRecord<'_>| {
        if let LogRecord::Tick(telemetry) = record
            && (2300..2600).contains(&telemetry.tick)
        {
            let mut along = telemetry.devices().map(|device| device.wrench.force.z);
            if let [Some(left), Some(right)] = [along.next(), along.next()] {
                found = [
                    found[0].max((left + right).abs()),
                    found[1].max(right.abs()),
                ];
            }
        }
    });
    Ok(found)
}

#[test]
fn two_hands_feel_the_bodies_that_they_press_on_each_other() -> Result<(), Box<dyn Error>> {
    let scene = load(BLOCKS)?;
    let [difference, most] = forces(&scene)?;
    assert!(most > 1.0, "{most}");
    // The blocks still creep after the shear.
    assert!(difference < 2e-3 * most, "{difference} of {most}");
    let found = summary(&scene)?;
    for energy in &found.energy {
        assert_eq!(energy.capped_ticks, 0, "{}", energy.body);
    }
    // The moving hand pays for both bodies.
    let [lower, upper] = [0, 1].map(|body| found.energy[body].received);
    assert!(lower > 5e-4 && upper < -lower, "{lower} {upper}");
    Ok(())
}

#[test]
fn a_soft_body_without_hands_gives_back_the_work_of_the_hand_that_pressed_it()
-> Result<(), Box<dyn Error>> {
    let supported = BLOCKS
        .replace(
            "[[body.handle]]\nname = \"below\"\ngroup = \"bottom\"\ndevice = \"left\"",
            "[[body.support]]\nname = \"base\"\ngroup = \"bottom\"",
        )
        // The pressed body stores nearly all the energy.
        .replace("young = 40e3", "young = 400e3")
        .replace(
            "[[device]]\nname = \"left\"\nmodel = \"omega3\"\nhand = { grip = \"firm\" }\n",
            "",
        );
    let found = summary(&load(&supported)?)?;
    assert_eq!(found.energy[0].capped_ticks, 0);
    Ok(())
}
