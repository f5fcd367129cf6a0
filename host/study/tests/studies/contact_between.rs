//! The quick part of `palpate bench contact --part between`.

use study::contact::{Section, run};
use study::{Level, Results};

/// A block presses a block evenly, and a sphere presses a block by a tenth of its radius as Hertz says.
#[test]
fn bodies_in_equilibrium_press_as_exact_solutions_say() {
    let found = run(Level::Quick, Some(Section::Between), 1, &mut |_| {}).unwrap();
    println!("{}", found.tables());
    assert_eq!(found.aims.len(), 9);
    let reached = found.aims.iter().all(|aim| aim.is_reached);
    assert!(reached, "{:#?}", found.aims);
}
