//! Random worlds of tools: hands get no energy from nowhere, nothing is refused, and runs repeat.

use study::stress::contact::{Length, NET_ENERGY, Study, Worlds, cell};

#[test]
fn tools_in_random_worlds_give_hands_no_energy() {
    let study = Study {
        seed: 9001,
        cells: 12,
        worlds: Worlds::Tools,
        length: Length::Quick,
    };
    let (mut pressed, mut work) = (0, 0.0);
    for number in 0..study.cells {
        let found = cell(&study, number);
        assert!(found.net_energy <= NET_ENERGY, "{number}: {found:?}");
        assert_eq!(found.failures, [""; 0], "{number}: {found:?}");
        pressed += usize::from(found.peak > 0.1);
        work += found.moved;
    }
    // The worlds are no empty ones: in most of them a tool presses, and the hands work.
    assert!(pressed >= 6 && work > 0.1, "{pressed} {work}");
}
