//! A piece that a hand has torn off and let go lies still on the floor, and sleeps while the other hand moves.

use crate::contact_changes::Table;
use crate::touching_scenes::sheet;
use host::engine::change::Edit;
use physics::{Body, PieceSums, Vec3};

/// The sheet is torn in two, and the second hand has let its piece go.
struct Torn {
    table: Table,
    /// Where the hand is (m), aside and above the floor.
    apart: f64,
    height: f64,
}

impl Torn {
    fn new() -> Self {
        let mut table = Table::new(&sheet(true), &[[0, 0], [0, 1]]);
        let mut apart = 0.0;
        // The last edges let go some time after they have opened.
        while apart < 8e-3 {
            apart += 5e-5;
            table.step(&[-Vec3::x() * apart, Vec3::x() * apart]);
        }
        assert_eq!(Self::pieces(&table), 2);
        let edit = Edit::Release { handle: 1 };
        table.engine.change(0, vec![edit]).expect("a change");
        Self {
            table,
            apart,
            height: 0.0,
        }
    }

    fn pieces(table: &Table) -> usize {
        let tears = table.engine.bodies()[0].tears();
        tears.expect("a sheet that tears").pieces().count()
    }

    /// Makes a step in which the hand rises until its piece hangs, and swings there.
    fn step(&mut self) {
        self.height = (self.height + 2e-4).min(0.06);
        let aside = 2e-3 * (self.table.steps as f64 * 0.03).sin();
        let at = Vec3::new(-self.apart, aside, self.height);
        self.table.step(&[at, Vec3::zeros()]);
    }

    fn asleep(&self) -> usize {
        self.table.engine.bodies()[0].pieces_asleep()
    }

    /// The force of the floor on the piece without a hand, in parts of its weight.
    fn borne(&self) -> f64 {
        let tears = self.table.engine.bodies()[0].tears().expect("it tears");
        let body: &Body = self.table.body(0);
        let mut sums = [PieceSums::default(); 2];
        body.sums_of_pieces(tears.pieces(), &mut sums);
        let held = body
            .pieces_of_handle(0, tears.pieces())
            .next()
            .expect("one");
        let loose = sums[1 - held as usize].mass;
        self.table.force([0, 1]).z / (9.81 * loose)
    }
}

#[test]
fn a_piece_sleeps_through_a_pause_until_the_body_is_changed() {
    let mut torn = Torn::new();
    let mut steps = 0;
    while (torn.asleep() == 0 || torn.height < 0.06) && steps < 1000 {
        torn.step();
        steps += 1;
    }
    assert!(steps < 1000);
    assert!((torn.borne() - 1.0).abs() < 1e-6, "{}", torn.borne());
    for step in 0..150 {
        // The host pauses for two seconds, and the hand jumps.
        torn.table.steps += if step == 75 { 500 } else { 0 };
        torn.step();
        assert_eq!(torn.asleep(), 1, "{step}");
        assert!((torn.borne() - 1.0).abs() < 1e-6, "{}", torn.borne());
    }
    torn.table.assert_sound();
    // A support on the piece, which is lifted again.
    let last = torn.table.body(0).node_positions().len() as u32 - 1;
    let tears = torn.table.engine.bodies()[0].tears().expect("it tears");
    let held = torn
        .table
        .body(0)
        .pieces_of_handle(0, tears.pieces())
        .next();
    let vertex = (0..last).find(|v| Some(tears.pieces().of_vertex(*v)) != held);
    let guide = Edit::Guide {
        vertices: vec![vertex.expect("a vertex of the other piece")],
        axes: [true, true, false],
    };
    for edit in [guide, Edit::Lift { support: 0 }] {
        let is_guide = matches!(edit, Edit::Guide { .. });
        torn.table.engine.change(0, vec![edit]).expect("a change");
        let before = torn.table.engine.stats().changes;
        let mut least = 1;
        for _ in 0..300 {
            torn.step();
            least = least.min(torn.asleep());
        }
        assert_eq!(torn.table.engine.stats().changes, before + 1);
        assert_eq!((least, torn.asleep()), (0, usize::from(!is_guide)));
    }
    torn.table.assert_sound();
}
