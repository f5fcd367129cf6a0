//! The quick part of the study of random worlds in contact.

use study::stress::Study as _;
use study::stress::contact::{CELLS, Length, Study, cell};

/// The seed was not used while the study was made.
const SEED: u64 = 42_017;

#[test]
fn random_worlds_in_contact_keep_the_rules() {
    let mut found = std::collections::BTreeMap::new();
    for number in 0..CELLS[1] {
        found.insert(number, cell(SEED, number, Length::Quick));
    }
    let study = Study {
        seed: SEED,
        cells: CELLS[1],
        length: Length::Quick,
    };
    let verdict = study.verdict(&found);
    assert_eq!(verdict.lines, Vec::<String>::new());
    // The worlds show what they are for.
    assert!(found.values().any(|cell| cell.truncated > 0));
    assert!(found.values().filter(|cell| cell.touched > 0).count() > 3);
}
