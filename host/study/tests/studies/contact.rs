//! The quick part of `palpate bench contact`.

use study::contact::{Aim, HandCell, Section, run};
use study::{Level, Results};

/// Beginnings of the names of the aims that are not reached.
const MISSED: [&str; 4] = [
    "the same with the elastic energy",
    "iterations a step while a cloth drapes",
    "iterations a step of a worn tube of 476 rows, 99 %",
    "iterations a step of a worn tube of 1680 rows, 99 %",
];

#[test]
fn contact_holds_its_aims() {
    let mut found = run(Level::Quick, Some(Section::Aims), 1, &mut |_| {}).unwrap();
    let costs = run(Level::Quick, Some(Section::Cost), 1, &mut |_| {}).unwrap();
    assert!(costs.aims.is_empty());
    (found.machine, found.costs) = (costs.machine, costs.costs);
    let text = found.tables();
    println!("{text}");
    assert!(found.aims.len() > 20 && found.aims.iter().all(|aim| aim.ours.is_finite()));
    let known = |aim: &&Aim| !MISSED.iter().any(|name| aim.name.starts_with(name));
    let missed = found.aims.iter().filter(|aim| !aim.is_reached);
    let missed: Vec<&Aim> = missed.filter(known).collect();
    assert!(missed.is_empty(), "{missed:#?}");
    // Times are shown, and are no aims.
    assert_eq!(found.costs.len(), 15);
    assert!(text.contains("| two sheets land |") && found.picture().is_some());
}

#[test]
fn hands_feel_contact() {
    let found = run(Level::Quick, Some(Section::Hand), 1, &mut |_| {}).unwrap();
    println!("{}", found.tables());
    assert!(!found.hands.is_empty() && found.hands.iter().all(|cell| cell.faults == 0));
    // A host that makes the steps of the reference and publishes in every sixteenth of them.
    let same = |cell: &&HandCell| cell.step_rate == 1000.0 && cell.rows == "all";
    for cell in found.hands.iter().filter(same) {
        assert!(cell.hold < 1e-5, "{cell:?}");
        // The aim, which is reached where one surface closes at once.
        if ["on a floor", "on another body"].contains(&cell.pressed) {
            assert!(cell.worst < 0.05, "{cell:?}");
        }
    }
}
