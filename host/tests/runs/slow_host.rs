//! A host that is too slow for its scene is told early, and the telling changes no result.

use host::engine::rehearsal::Rehearsal;
use host::run::slow_host::StepTime;
use host::run::{Clock, RunOptions, run};
use host::scene::{LoadedScene, Scene};
use host::world::World;
use std::collections::BTreeMap;
use std::error::Error;

/// The built-in scene with pieces of its text replaced.
fn with(changes: &[(&str, &str)]) -> Result<LoadedScene, Box<dyn Error>> {
    let mut text = include_str!("../../scenes/stretch.toml").to_owned();
    for (piece, instead) in changes {
        assert!(text.contains(piece), "{piece} is not in the scene");
        text = text.replace(piece, instead);
    }
    Ok(Scene::load_texts("x.toml", &text, &BTreeMap::new())?)
}

#[test]
fn a_rehearsal_times_a_step_of_the_scene() -> Result<(), Box<dyn Error>> {
    let scene = with(&[])?;
    let took = Rehearsal::new(&World::new(&scene)?)?.step_time();
    let time = StepTime::new(&scene.scene, took);
    assert!(time.took_ns > 0 && time.asked_ns == 4_000_000);
    Ok(())
}

#[test]
fn a_run_whose_steps_are_too_slow_says_so() -> Result<(), Box<dyn Error>> {
    // No machine steps 7,200 elements in a millisecond, whatever its load.
    let scene = with(&[
        ("cells = [20, 12]", "cells = [60, 60]"),
        ("step_rate = 250.0", "step_rate = 1000.0"),
        ("publish_rate = 250.0", "publish_rate = 1000.0"),
        // With a latency of several steps, a host in virtual time has no time to publish after each step.
        ("latency = 0.004", "latency = 0.0"),
    ])?;
    // Under the real clock before the first tick, under virtual time after some steps.
    for (clock, latest) in [(Clock::Real, 0), (Clock::Virtual, 256)] {
        let options = RunOptions {
            duration: Some(0.3),
            ..RunOptions::new(clock)
        };
        let mut told_at = None;
        let summary = run(&World::new(&scene).unwrap(), &options, &mut |progress| {
            if progress.slow.is_some() {
                told_at.get_or_insert(progress.ticks);
            }
        })?;
        let warning = summary.warnings.last().ok_or("a warning")?;
        assert!(
            warning.contains("the scene needs a step every 1.0 ms")
                && warning.contains("Lower `host.step_rate`"),
            "{warning}"
        );
        assert!(
            told_at.is_some_and(|tick| tick <= latest),
            "{clock:?}: {told_at:?}"
        );
    }
    Ok(())
}
