//! The quick part of `palpate bench stability`: every case passes.

use study::Level;
use study::stability::{self, Family, Report, Verdict};

/// Families of elastic motion. The other families are in [`STARTS`] and [`ENDS`]. The three lists run side by side.
const MOTION: [&str; 6] = [
    "materials and steps",
    "hard kicks",
    "long vibration",
    "contrasts",
    "slivers",
    "realtime step",
];
const STARTS: [&str; 3] = ["inverted starts", "scrambled starts", "crumpled sheets"];
const ENDS: [&str; 6] = [
    "jerked handles",
    "rest under load",
    "rest, free and turned",
    "free fall",
    "hung by one vertex",
    "refusals",
];

fn run(names: &[&str]) -> Vec<Family> {
    let mut families = Vec::new();
    for name in names {
        let report: Report = stability::run(Level::Quick, Some(name), &mut |_| ());
        let failures: Vec<String> = report
            .failures()
            .map(|(_, case)| format!("{case:?}"))
            .collect();
        assert!(failures.is_empty(), "{name}:\n{}", failures.join("\n"));
        families.extend(report.families);
    }
    assert_eq!(families.len(), names.len());
    assert!(families.iter().all(|family| !family.cases.is_empty()));
    families
}

#[test]
fn no_family_is_left_out() {
    assert_eq!([&MOTION[..], &STARTS, &ENDS].concat(), stability::names());
}

#[test]
fn bodies_in_motion_gain_no_energy() {
    let families = run(&MOTION);
    // The figure of every case in these families has a limit.
    for family in &families {
        assert_eq!(family.count(Verdict::Pass), family.cases.len());
    }
    // The guard keeps the hard kicks within their limit.
    let damped = |family: &Family| -> usize {
        let cases = family.cases.iter();
        cases.map(|case| case.account.damped).sum()
    };
    assert!(damped(&families[1]) > 0 && damped(&families[5]) > 0);
}

#[test]
fn inverted_bodies_recover_if_their_law_guarantees_it() {
    for family in &run(&STARTS[..2]) {
        let of = |law: &str, body: &str| {
            let these = family.cases.iter();
            these
                .filter(|case| case.law == law && case.body == body)
                .cloned()
                .collect::<Vec<_>>()
        };
        let recovered = of("stable neo-Hookean", "linear tetrahedra");
        assert!(!recovered.is_empty() && recovered.iter().all(|case| case.figure == 0.0));
        // Recovery is a property of the law. The St. Venant-Kirchhoff law has equilibria with inverted elements.
        let stuck = of("St. Venant-Kirchhoff", "linear tetrahedra");
        assert!(stuck.iter().any(|case| case.figure > 0.0));
    }
    run(&STARTS[2..]);
}

#[test]
fn bodies_jerked_at_rest_free_and_refused_keep_their_state() {
    let families = run(&ENDS);
    let refused: usize = families[5]
        .cases
        .iter()
        .map(|case| case.account.refused)
        .sum();
    assert!(refused >= families[5].cases.len());
}
