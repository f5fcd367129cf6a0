//! Worlds of the stress of contact in which a light piece of a torn sheet, or a shape that moves under or over a vertex, once
//! gave energy.

use study::stress::contact::{Length, cell};

#[test]
fn torn_pieces_and_moving_shapes_give_no_energy() {
    // A light piece that hangs on pairs alone, with the loss of a device; an animated mesh with a moved cylinder; a sheet that
    // tears at a solid under all faults; and a sphere that moves over a vertex which truncation stopped.
    for (seed, number) in [(977, 1), (977, 2), (101, 4), (303, 0)] {
        let found = cell(seed, number, Length::Quick);
        assert!(found.touched > 0 && found.truncated > 0, "{seed} {number}");
        assert_eq!(found.failures, [""; 0], "{seed} {number}");
    }
}
