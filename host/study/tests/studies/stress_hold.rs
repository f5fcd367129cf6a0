//! The study of holds: its cells are reproducible, its limits accept the body's own force, and it detects a scheme that
//! renders another force.

use host::run::prepare::Options;
use host::run::session::Session;
use host::scene::spec::SchemeName;
use host::scene::{LoadedScene, Scene};
use host::world::World;
use physics::Vec3;
use std::collections::BTreeMap;
use study::stress::hold::verdict::{Failure, failures};
use study::stress::hold::{CASES, CellResult, SCHEMES, Study};
use study::stress::scene::measure::Outcome;
use study::stress::specimen::{Cause, Draw, Kind};

const SEED: u64 = 1;
/// The first drawn cell.
const FIRST: u64 = CASES.len() as u64;

fn run(cell: u64, scheme: SchemeName, name: &str) -> (CellResult, Outcome) {
    let found = Study::new(SEED).cell(cell, &[(scheme, name)]);
    assert_eq!(found.failed, None, "cell {cell}");
    let outcome = found.schemes[name];
    (found, outcome)
}

/// The first cell whose draw `fits`.
fn first(fits: impl Fn(&Draw) -> bool) -> u64 {
    let study = Study::new(SEED);
    let mut cells = FIRST..FIRST + 10_000;
    let found = cells.find(|cell| study.draw(*cell).is_some_and(|draw| fits(&draw)));
    found.expect("there is one")
}

/// The forces of the motors in each tick of a run of a scene.
fn forces(loaded: &LoadedScene) -> Vec<Vec<Vec3>> {
    let world = World::new(loaded).expect("it is sound");
    let mut session = Session::new(&world, &Options::of(&world)).expect("it is sound");
    let mut forces = Vec::new();
    while session.tick().is_some() {
        let devices = session.tick_loop().devices.iter();
        let probes = devices.map(|device| device.probe().expect("it is simulated"));
        forces.push(probes.map(|probe| probe.held.force).collect());
    }
    forces
}

#[test]
fn a_cell_is_a_function_of_its_number() {
    let run = || {
        let found = Study::new(SEED).cell(FIRST + 1, &SCHEMES);
        serde_json::to_string(&found).expect("it is finite")
    };
    assert_eq!(run(), run());
}

#[test]
fn a_run_of_the_written_scene_gives_the_forces_of_the_cell() {
    let cell =
        first(|draw| draw.hands.len() == 2 && draw.ratio > 1.0 && draw.cause == Cause::Nothing);
    for scheme in [SchemeName::Linear, SchemeName::Capped] {
        let written = Study::new(SEED).written(cell, scheme).expect("it is sound");
        assert!(written.told.is_empty());
        let loaded = Scene::load_texts("cell.toml", &written.text, &BTreeMap::new());
        let again = forces(&loaded.expect("it is a scene"));
        let traces = Study::new(SEED).traces(cell, &[scheme]).expect("it runs");
        for (device, trace) in traces.runs[0].devices.iter().enumerate() {
            assert_eq!(trace.force.len(), again.len());
            for (tick, force) in trace.force.iter().enumerate() {
                assert_eq!(*force, again[tick][device], "{scheme:?} tick {tick}");
            }
        }
    }
    // What a scene file cannot say is told.
    let stalled = first(|draw| draw.cause == Cause::Stall);
    let written = Study::new(SEED).written(stalled, SchemeName::Capped);
    let told = written.expect("it is sound").told;
    assert!(
        told.len() == 1 && told[0].contains("--fault stall@"),
        "{told:?}"
    );
}

#[test]
fn a_scheme_that_renders_another_force_is_detected() {
    // The virtual coupling makes the body softer.
    let block = |draw: &Draw| draw.kind == Kind::Corotational && draw.cause == Cause::Nothing;
    let cell = first(|draw| block(draw) && (0.2..1.0).contains(&draw.ratio));
    let (found, outcome) = run(cell, SchemeName::Proxy, "proxy");
    assert!(failures(&found, "proxy").contains(&Failure::Hold));
    assert!(outcome.force_errors.hold_error > 0.05, "{outcome:?}");
    // The force of the last publication is held until the next one: on a body that is nearly as stiff as the device renders,
    // the force accelerates the hand away.
    let late = |draw: &Draw| {
        draw.rate < 60.0 && (0.7..1.0).contains(&draw.ratio) && draw.cause == Cause::Nothing
    };
    let (found, _) = run(first(late), SchemeName::Hold, "hold");
    let failures = failures(&found, "hold");
    assert!(failures.contains(&Failure::Run), "{failures:?}");
}
