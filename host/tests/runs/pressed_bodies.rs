//! Bodies that hands press on each other: the account of each body knows the energy that the contact brought, so every hand
//! feels the force of its body.

use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use rt_core::Telemetry;
use std::collections::BTreeMap;
use std::error::Error;
use support::watched;

const BLOCKS: &str = include_str!("../../scenes/pressed_blocks.toml");

fn load(text: &str) -> Result<LoadedScene, Box<dyn Error>> {
    Ok(Scene::load_texts("x.toml", text, &BTreeMap::new())?)
}

/// The largest sum of the forces on the two hands along z while both rest, and the largest force (N).
fn forces(ticks: &[Telemetry]) -> [f64; 2] {
    let mut found = [0.0_f64; 2];
    for tick in &ticks[2300..2600] {
        let [left, right] = [0, 1].map(|device| tick.devices[device].wrench.force.z);
        found = [
            found[0].max((left + right).abs()),
            found[1].max(right.abs()),
        ];
    }
    found
}

#[test]
fn two_hands_feel_the_bodies_that_they_press_on_each_other() -> Result<(), Box<dyn Error>> {
    let scene = load(BLOCKS)?;
    let options = RunOptions::new(Clock::Virtual);
    let (found, ticks) = watched::ticks(&World::new(&scene)?, &options)?;
    let [difference, most] = forces(&ticks);
    assert!(most > 1.0, "{most}");
    // The blocks still creep after the shear.
    assert!(difference < 2e-3 * most, "{difference} of {most}");
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
    let scene = load(&supported)?;
    let options = RunOptions::new(Clock::Virtual);
    let found = run(&World::new(&scene)?, &options, &mut |_| {})?;
    assert_eq!(found.energy[0].capped_ticks, 0);
    Ok(())
}
