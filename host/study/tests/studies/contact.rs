//! The quick part of `palpate bench contact`.

use study::contact::{Aim, Section, run};
use study::{Level, Results};

/// Beginnings of the names of the aims that are not reached.
const MISSED: [&str; 1] = ["iterations a step while a cloth drapes"];

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
    let floor = found.hands.iter();
    for cell in floor.filter(|cell| cell.pressed == "on a floor") {
        assert!(cell.hold < 0.01 && cell.worst < 0.2, "{cell:?}");
    }
    for cell in found.hands.iter().filter(|cell| cell.rows == "all") {
        // The hold is the aim. The largest error, 20 %, is that of a contact of which a host of 60 Hz learns a step late. A host that
        // steps 60 times a second stops the handle at another place on the sphere.
        let hold = if cell.step_rate == 60.0 { 0.06 } else { 0.01 };
        // Of the hosts that make the steps of the reference, two still miss the aim: along a floor and on a sphere.
        let misses = ["along a floor", "on a sphere"].contains(&cell.pressed);
        let worst = if cell.step_rate == 1000.0 && !misses {
            0.05
        } else {
            0.25
        };
        assert!(cell.hold < hold && cell.worst < worst, "{cell:?}");
    }
}
