//! The quick part of `palpate bench contact --part between`.

use study::contact::{Section, run};
use study::{Level, Results};

/// A sphere presses a block by a tenth of its radius as Hertz says.
#[test]
fn a_sphere_presses_a_block_as_hertz_says() {
    let found = run(Level::Quick, Some(Section::Between), 1, &mut |_| {}).unwrap();
    println!("{}", found.tables());
    assert_eq!(found.aims.len(), 1);
    assert!(found.aims[0].is_reached, "{:#?}", found.aims);
}
