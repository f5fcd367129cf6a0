//! The scene study: its cells repeat, its reference is passive, and it tells a sound scheme from an unsound one.

use host::scene::spec::SchemeName;
use host::scene::{LoadedScene, Scene};
use std::path::Path;
use study::stress::scene::draw::{Draw, Trouble};
use study::stress::scene::measure::Outcome;
use study::stress::scene::{SCHEMES, Study};

const SEED: u64 = 1;

fn sheet() -> LoadedScene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/stress/sheet.toml");
    Scene::load(&path).expect("the scene is sound")
}

/// The first cell of this rate (Hz) and trouble.
fn cell(rate: f64, trouble: Trouble) -> u64 {
    let fits = |draw: &Draw| draw.rate == rate && draw.trouble == trouble;
    let found = (0..1000).find(|cell| fits(&Draw::new(SEED, *cell, 2)));
    found.expect("every rate meets every trouble")
}

fn outcome(study: &Study, cell: u64, scheme: SchemeName) -> Outcome {
    let (draw, reference, runs) = study.traces(cell, &[scheme]).expect("it runs");
    // The reference is stable, and gives nothing but what it was given. Its physics is held between ticks: 1 uJ.
    assert!(reference.stillness().ripple < 1e-3);
    assert!(reference.net_energy() < 1e-6, "{}", reference.net_energy());
    Outcome::of(&runs[0], &reference, &draw)
}

#[test]
fn a_cell_is_a_function_of_its_number() {
    let [hold, .., capped] = SCHEMES;
    let cell = cell(60.0, Trouble::All);
    let run = || {
        let study = Study::new(sheet(), SEED).expect("it is sound");
        serde_json::to_string(&study.cell(cell, &[hold, capped])).expect("it is finite")
    };
    assert_eq!(run(), run());
}

#[test]
fn capped_hands_come_to_rest_and_get_nothing_that_they_did_not_give() {
    let study = Study::new(sheet(), SEED).expect("it is sound");
    for (rate, trouble) in [
        (20.0, Trouble::Nothing),
        (60.0, Trouble::Stalls),
        (1000.0, Trouble::Losses),
        (30.0, Trouble::Softening),
        (250.0, Trouble::Vanishing),
        (60.0, Trouble::All),
    ] {
        let found = outcome(&study, cell(rate, trouble), SchemeName::Capped);
        println!("{rate} {trouble:?} {found:?}");
        assert!(found.bounded, "{rate} {trouble:?}");
        // The allowance.
        assert!(found.net_energy < 1e-3, "{rate} {trouble:?}");
    }
}

#[test]
fn a_hold_after_a_device_came_back_is_as_stiff_as_the_body() {
    let study = Study::new(sheet(), SEED).expect("it is sound");
    // The lightest of hands; its proxy once followed whole while the force came back, and the hold was soft for good.
    let lightest = 576;
    let draw = Draw::new(SEED, lightest, 2);
    assert!(draw.vanishing.is_some() && draw.grips.iter().any(|grip| grip.mass < 0.11));
    let found = outcome(&study, lightest, SchemeName::Capped);
    // The count of 38 um in 4 mm, and what the blends of 60 Hz are behind.
    assert!(
        found.stiffness_error < 0.01 && found.error < 0.02,
        "{found:?}"
    );
}

#[test]
fn nobody_is_blamed_for_what_no_tick_can_know() {
    let study = Study::new(sheet(), SEED).expect("it is sound");
    let cell = cell(60.0, Trouble::Softening);
    let (draw, reference, runs) = study.traces(cell, &[SchemeName::Linear]).expect("it runs");
    let softening = draw.softening.expect("it softens");
    let unaware = runs[0].unaware;
    assert_eq!(unaware.at, softening.at);
    // The step in which it softens, the next publication, its latency, and the tick after it.
    let longest = 1e-3 + 1.0 / draw.rate + draw.latency + 1e-3;
    assert!((draw.latency..longest).contains(&unaware.duration));
    let found = Outcome::of(&runs[0], &reference, &draw);
    let aware = found.error_aware.expect("it was told in time");
    // What is left is the hand, which felt the old force meanwhile and is not where that of the reference is.
    assert!(aware < 0.8 * found.error, "{found:?}");
}

#[test]
fn a_model_that_comes_every_tick_and_at_once_renders_the_reference() {
    let study = Study::new(sheet(), SEED).expect("it is sound");
    // Of the fast and untroubled hosts the one that is least late.
    let quick = |cell: &u64| {
        let draw = Draw::new(SEED, *cell, 2);
        draw.rate == 1000.0 && draw.trouble == Trouble::Nothing
    };
    let latency = |cell: &u64| Draw::new(SEED, *cell, 2).latency;
    let found = (0..10_000)
        .filter(quick)
        .min_by(|a, b| latency(a).total_cmp(&latency(b)))
        .expect("there is one");
    assert!(latency(&found) < 1e-5);
    let linear = outcome(&study, found, SchemeName::Linear);
    println!("{linear:?}");
    // A tick or two late, and blended over two: hands of 5 Hz move by a hundredth of their way meanwhile.
    assert!(linear.error < 0.02);
    // The body rests: what is left is the encoder's count of 38 um in 10 mm.
    assert!(linear.stiffness_error < 0.005);
}

#[test]
fn a_held_force_makes_energy_where_a_linear_model_makes_none() {
    let study = Study::new(sheet(), SEED).expect("it is sound");
    let cell = cell(20.0, Trouble::Nothing);
    let held = outcome(&study, cell, SchemeName::Hold);
    let linear = outcome(&study, cell, SchemeName::Linear);
    // The study of multirate schemes found joules at 20 Hz.
    assert!(!held.bounded && held.net_energy > 0.1, "{held:?}");
    assert!(linear.bounded && linear.net_energy < 1e-3, "{linear:?}");
}
