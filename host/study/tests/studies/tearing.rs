//! The quick parts of the study of tearing against fracture mechanics.

use std::sync::LazyLock;
use study::Level;
use study::tearing::energy::Account;
use study::tearing::patterns::{Pattern, Triangles};
use study::tearing::{edits, energy, kinks, meshes, notches, running, smooth, strength, trousers};

#[test]
fn a_crack_at_an_angle_to_the_load_starts_and_turns_as_the_largest_hoop_stress_says() {
    for kink in kinks::run(Level::Quick, &|_| ()).expect("kinks") {
        // The integrals err by half a degree on these meshes.
        let [intensities, first, second] = kink.errors();
        assert!(intensities < 0.5, "{kink:?}");
        // A first edge keeps to its path. If a cut would leave thin triangles, a second edge opens up to 20 degrees off the
        // path, and the next edge turns back.
        assert!(first < 3.0 && second < 20.0, "{kink:?}");
        // Triangles act like a tip 0.4 edge behind its vertex, in sliding 0.8: 4 to 8 % if half the crack has five edges.
        // Without the factor of the turn the start is 25 to 41 % late.
        assert!(kink.start > 1.0 && kink.start < 1.085, "{kink:?}");
    }
}

#[test]
fn a_tear_starts_late_at_a_short_notch_and_less_late_at_a_longer_one() {
    for notch in notches::run(Level::Quick, &|_| ()).expect("notches") {
        // As at a crack at an angle. A notch of one edge is what `plan` warns of most.
        let most = if notch.edges < 8 { 0.35 } else { 0.06 };
        assert!(notch.error() > 0.0 && notch.error() < most, "{notch:?}");
    }
}

#[test]
fn a_strip_without_a_notch_bears_its_strength_and_parts() {
    for strip in strength::run(Level::Quick, &|_| ()).expect("strips") {
        // A tenth is what the book promises.
        assert!(strip.error().abs() < 0.1 && strip.parted, "{strip:?}");
        // A strip parts along one section at least.
        assert!(strip.torn > 0.99, "{strip:?}");
    }
}

#[test]
fn the_force_that_tears_a_cloth_is_smooth_and_does_not_depend_on_damping() {
    let cloths = smooth::run(Level::Quick, &|_| ()).expect("cloths");
    let plateaus: Vec<f64> = cloths.iter().filter_map(|cloth| cloth.plateau).collect();
    let [first, second] = plateaus[..] else {
        panic!("a cloth rests");
    };
    // Without damping a tear overshoots a little at each edge: 1.2 % on these edges of 6.25 mm, 0.3 % on 2.5 mm. It was a
    // factor of 2.1 when the first force of a pair was raised.
    assert!((first / second - 1.0).abs() < 0.02, "{plateaus:?}");
    for cloth in &cloths {
        // Without damping 2.7 % on these edges. It was 9 % on 7 mm when the first force of a pair was raised.
        let ripple = cloth.ripple.expect("a plateau");
        assert!(ripple < 0.05, "{ripple}");
    }
}

#[test]
fn the_mesh_matters_little_under_the_law_of_toughness() {
    let found = meshes::run(Level::Quick, &|_| ()).expect("tears");
    for start in &found.starts {
        // The third ring errs by -4.4 to +0.5 % in the energy release rate, so by up to 2.2 % in the strain.
        assert!(start.error().abs() < 0.03, "{start:?}");
    }
    let spread = |law: &str| {
        let found = found.spreads.iter().find(|spread| spread.law == law);
        let found = found.expect("the law");
        (found.plateau, found.energy)
    };
    // A tenth is what the book promises.
    let (plateau, energy) = spread("toughness");
    assert!(plateau < 0.1 && energy < 0.1, "{:?}", found.tears);
    let thesis = spread("thesis");
    assert!(plateau < thesis.0, "{:?}", found.tears);
}

#[test]
fn trousers_tear_at_an_even_force_along_their_axis() {
    for test in trousers::run(Level::Quick, &|_| ()).expect("trousers") {
        // Edges of 5 mm are half the radius of the bend. Pairs whose force falls evenly give 0.90 and 0.15.
        let [force, ripple] = test.relative().expect("a tear of 60 mm");
        assert!((force - 1.0).abs() < 0.03 && ripple < 0.06, "{test:?}");
    }
}

#[test]
fn swapped_hands_tear_trousers_along_the_same_path() {
    // A mesh without order, on which the tear strays from the axis.
    let drift = [1.0, -1.0].map(|up| {
        let case = trousers::Case {
            triangles: Triangles::Pattern(Pattern::Scattered(7)),
            count: 400,
            thickness: 2e-3,
            rate: 250.0,
            up,
        };
        case.run().expect("trousers").drift
    });
    // The load of swapped hands is the mirror image across the sheet. Sums round differently there, and an edge is 5 mm.
    assert!((drift[0] - drift[1]).abs() < 1e-5, "{drift:?}");
    assert!(drift[0].abs() > 1e-4, "{drift:?}");
}

#[test]
fn a_tear_runs_through_a_strip_at_the_displacement_at_which_it_starts() {
    for run in running::run(Level::Quick, &|_| ()).expect("strips") {
        let start = run.start.expect("a tear");
        // The third ring errs by -4.4 to +0.5 % in the energy release rate, so by up to 2.2 % in the displacement.
        assert!((start - 1.0).abs() < 0.022, "{run:?}");
        for displacement in run.displacement {
            // A tip advances if the flow exceeds the toughness by a hundredth, and a tear that runs needs an excess: 6
            // % is what the book promises.
            let found = displacement.unwrap_or(f64::INFINITY);
            assert!(found > start - 1e-9 && found < 1.06, "{run:?}");
        }
        // The supplied energy grows with the square of the displacement.
        let work = run.work.expect("a torn strip");
        assert!(work > 0.95 && work < 1.06 * 1.06, "{run:?}");
    }
}

static ACCOUNTS: LazyLock<Vec<Account>> =
    LazyLock::new(|| energy::run(Level::Quick, &|_| ()).expect("accounts"));

#[test]
fn the_account_of_a_whole_tear_closes() {
    for account in &*ACCOUNTS {
        // The sum of some thousand steps.
        assert!(account.rounding().abs() < 1e-6, "{account:?}");
    }
}

#[test]
fn letting_go_takes_the_toughness_times_the_torn_area() {
    for account in &*ACCOUNTS {
        let taken = (account.released + account.slackened + account.pending) / account.due;
        // The sum of some thousand steps.
        assert!((taken - 1.0).abs() < 1e-9, "{account:?}");
        // Hands hold most of this tear in balance: the pairs take most of its energy themselves. The rest goes into motion
        // when the tip comes near the border and runs.
        let alone = account.released / account.due;
        assert!(alone > 0.8 && alone < 1.001, "{account:?}");
    }
}

#[test]
fn edits_keep_mass_area_and_momentum_and_invert_no_triangle() {
    for mesh in edits::run(Level::Quick, &|_| ()).expect("meshes") {
        // Sums over some hundred vertices, rounded at each edit.
        assert!(mesh.errors.mass < 1e-12, "{mesh:?}");
        assert!(mesh.errors.area < 1e-12, "{mesh:?}");
        assert!(mesh.errors.momentum < 1e-12, "{mesh:?}");
        assert_eq!(mesh.errors.inverted, 0, "{mesh:?}");
    }
}
