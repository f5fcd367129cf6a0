//! Worlds of the stress of contact that once gave energy: by a light piece of a torn sheet, by a shape that moves under or over a
//! vertex, or by hands that moved before the first local model.

use study::stress::contact::{Length, cell};

#[test]
fn torn_pieces_moving_shapes_and_early_hands_give_no_energy() {
    // A light piece that hangs on pairs alone, with the loss of a device; an animated mesh with a moved cylinder; a sheet that
    // tears at a solid under all faults; a sphere that moves over a vertex which truncation stopped;
    // and hands that stretch a sheet before its first model comes.
    for (seed, number) in [(977, 1), (977, 2), (101, 4), (303, 0), (14003, 3)] {
        let found = cell(seed, number, Length::Quick);
        assert!(found.touched > 0 && found.truncated > 0, "{seed} {number}");
        assert_eq!(found.failures, [""; 0], "{seed} {number}");
    }
}
