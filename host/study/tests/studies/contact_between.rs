//! The quick part of `palpate bench contact --part between`.

use study::contact::{Section, run};
use study::{Level, Results};

/// A sphere presses a block as Hertz says. The coarse mesh of the quick level is too stiff by a tenth at every depth.
#[test]
fn a_sphere_presses_a_block_as_hertz_says() {
    let found = run(Level::Quick, Some(Section::Between), 1, &mut |_| {}).unwrap();
    println!("{}", found.tables());
    assert_eq!(found.aims.len(), 4);
    assert!(
        found.aims.iter().all(|aim| aim.ours < 12.0),
        "{:#?}",
        found.aims
    );
}
