//! The quick part of `palpate bench contact --part between`.

use study::contact::{Aim, Section, run};
use study::{Level, Results};

/// Pressed patches and the law of Hertz hold their aims.
#[test]
fn contact_between_bodies_holds_its_aims() {
    let found = run(Level::Quick, Some(Section::Between), 1, &mut |_| {}).unwrap();
    println!("{}", found.tables());
    assert_eq!(found.aims.len(), 10);
    let missed: Vec<&Aim> = found.aims.iter().filter(|aim| !aim.is_reached).collect();
    assert!(missed.is_empty(), "{missed:#?}");
}
