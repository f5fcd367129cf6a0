//! Tears in whole runs: random tears keep the limits of the study, and a cell is a function of its number.

use study::stress::tearing::{NET_ENERGY, cell};

#[test]
fn random_tears_stay_finite_repeat_and_give_the_hands_no_energy() {
    for number in 0..3 {
        let found = cell(1, number);
        assert!(found.failures.is_empty(), "{number}: {found:?}");
        assert!(found.net_energy <= NET_ENERGY);
    }
}
