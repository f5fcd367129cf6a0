//! Worlds of the stress of contact that once failed: contacts or hands got energy from nowhere, or a vertex crossed.

use study::stress::contact::{self, CellResult, Length, Study, Worlds};

#[test]
fn worlds_that_once_failed_give_no_energy_and_cross_nothing() {
    // An animated mesh with a moved cylinder; a sheet that tears at a solid under all faults; a sphere that moves over a vertex
    // which truncation stopped; hands that stretch a sheet before its first model comes; and a vertex that a sphere stops step
    // after step, until rounding takes it inside.
    for (seed, number) in [(977, 2), (101, 4), (303, 0), (14003, 3), (12003, 2)] {
        judge(seed, number, Length::Quick);
    }
    // An obstacle leaves a thread that was held back. The contacts stop the thread now, and nothing is truncated.
    let found = cell(404, 5, Length::Quick);
    assert!(found.touched > 0);
    assert_eq!(found.failures, [""; 0]);
}

#[test]
#[ignore = "two minutes: the jam takes many iterations in each step"]
fn a_light_piece_in_a_jam_gives_no_energy() {
    // A light piece that hangs on pairs alone, with the loss of a device.
    judge(977, 1, Length::Quick);
}

#[test]
fn shapes_that_move_take_along_what_is_held_back() {
    // A cylinder and a sphere passed over vertices of bodies that were held back, because they would have gained energy.
    for number in [20, 243] {
        judge(17001, number, Length::Whole);
    }
}

#[test]
fn what_is_jammed_is_not_pressed_ever_harder() {
    // A sheet between a block in two hands and the floor, a block that a moving box pushes, and a part of a body that was stopped
    // while an overlap parted.
    for number in [250, 279, 28] {
        let found = cell(17001, number, Length::Whole);
        assert!(found.touched > 0, "{number}");
        assert_eq!(found.failures, [""; 0], "{number}");
    }
}

#[test]
fn what_is_pushed_stops_with_what_pushes_it() {
    // Truncation stopped vertices whose contacts went on to push another body; and a cylinder took a vertex along.
    for (seed, number) in [(23001, 13), (27001, 124)] {
        judge(seed, number, Length::Whole);
    }
}

/// Runs a world of bodies.
fn cell(seed: u64, number: u64, length: Length) -> CellResult {
    let study = Study {
        seed,
        cells: number + 1,
        worlds: Worlds::Bodies,
        length,
    };
    contact::cell(&study, number)
}

fn judge(seed: u64, number: u64, length: Length) {
    let found = cell(seed, number, length);
    assert!(found.touched > 0 && found.truncated > 0, "{seed} {number}");
    assert_eq!(found.failures, [""; 0], "{seed} {number}");
}
