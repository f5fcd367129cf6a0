//! The tick that is shown, the ticks that were folded for its frame, and the sums up to it.

use host::live::Folded;
use host::log::TickRow;
use host::log::fold::{Fold, FoldFacts, Sums};

/// What is shown.
pub(super) struct Shown {
    /// The last tick.
    pub(super) row: TickRow,
    /// The ticks since the frame before.
    pub(super) piece: Folded,
    fold: Fold,
}

impl Shown {
    /// The first tick of a log.
    pub(super) fn new(facts: FoldFacts, row: TickRow) -> Self {
        let mut shown = Self {
            row: row.clone(),
            piece: Folded::default(),
            fold: Fold::new(facts),
        };
        shown.take(&row);
        shown
    }

    /// The tick after those that `fold` has taken.
    pub(super) fn after(fold: Fold, row: &TickRow) -> Self {
        let mut shown = Self {
            row: row.clone(),
            piece: Folded::default(),
            fold,
        };
        shown.take(row);
        shown
    }

    /// Forgets the ticks of the frame before.
    pub(super) fn begin_piece(&mut self) {
        self.piece = Folded::default();
    }

    /// Takes the next tick.
    pub(super) fn take(&mut self, row: &TickRow) {
        self.fold.take(row, &mut self.piece, |_| {});
        self.row.clone_from(row);
    }

    /// The sums up to the tick.
    pub(super) fn sums(&self) -> &Sums {
        self.fold.sums()
    }
}
