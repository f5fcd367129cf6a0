//! The accounts of the pieces of a body, and how an account parts when a piece parts.
//!
//! A whole body has one account. When a body tears into pieces, hands on different pieces no longer pass energy to each
//! other. With one credit `H` for all pieces, a hand on one piece could get the energy that a hand on another piece has
//! supplied. Each piece therefore has its own credit, and the cap treats each piece as a body.
//!
//! **Division.** Pieces only divide. When a piece parts, its credit parts in proportion to the energy that each new
//! piece stores, as the host publishes it. If no new piece stores energy, the parts are equal. A part keeps no more
//! credit than the allowance and the energy that the rendered model stores in it at this time. The hands have supplied
//! the rest, too, but the tear has taken it. Without this bound, the hands of a piece could get back this lost energy
//! until the cap has forgotten it. The work that weights have spared belongs to a hand and follows the hand. The hands
//! of a piece can therefore get no more than the sum of three energies: the energy that the piece stored when it
//! parted, the energy that the hands have supplied since, and the allowance of the cap.
//!
//! A piece that no hand of the former model holds begins with the allowance alone, because no hand has supplied its
//! energy. Pieces that grow together add their credits. No tear can cause that.

use super::{Balance, Motion, Passivity};
use crate::MAX_HANDLES;
use crate::geometry::Vec6;
use crate::local_model::{HandleReference, LocalModel, PieceEnergy, pieces};

/// The part of the energy account that belongs to one piece.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PieceAccount {
    /// Energy that springs may give back (J): the energy that hands have supplied, minus the forgotten part.
    pub(super) credit: f64,
    /// Energy that hands got since the last model that stated a released energy (J).
    pub(super) got: f64,
    /// Energy that the piece has released so far, as the models claim (J).
    released: f64,
    /// Work that the hands were spared by weights that their devices did not render (J), signed.
    pub(super) spared: f64,
    /// Fraction of the devices' damping that takes out missing energy.
    pub(super) damped: f64,
    /// The last result of the cap.
    pub(super) balance: Balance,
}

impl PieceAccount {
    /// An account with this credit (J).
    pub(super) fn new(credit: f64) -> Self {
        Self {
            credit,
            ..Self::default()
        }
    }

    /// The credit that the cap can spend (J).
    pub(super) fn available(&self) -> f64 {
        self.credit - self.spared.max(0.0)
    }

    /// The credit that the springs of the piece do not need (J).
    pub(super) fn free(&self) -> f64 {
        (self.available() - self.balance.needed).max(0.0)
    }

    /// Takes the energy in the first model that no hand had to supply, and the released energy that this model states (J).
    pub(super) fn begin(&mut self, initial: f64, released: f64) {
        self.credit += initial;
        self.released = self.released.max(released);
    }

    /// Takes the released energy that a model states (J). See [`Passivity::release`].
    pub(super) fn release(&mut self, released: f64) {
        let more = (released - self.released).max(0.0);
        self.credit += more.min(self.got.max(0.0));
        self.released = self.released.max(released);
        self.got = 0.0;
    }
}

/// How the pieces of one model part into those of the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Division {
    /// By former piece, the fraction of its energy that goes to each new piece. The fractions of a former piece add up
    /// to one, or to zero if no part of the piece is left.
    fractions: [[f64; MAX_HANDLES]; MAX_HANDLES],
    /// Whether each new piece comes from a former one.
    continues: [bool; MAX_HANDLES],
    /// Whether each new piece comes from a former one that has parted.
    is_part: [bool; MAX_HANDLES],
    /// Number of new pieces.
    count: usize,
}

impl Division {
    /// From the pieces of `old` to those of `new`. Hands tell which new piece comes from which former piece. Before the
    /// first model there is one piece.
    pub(crate) fn between(old: &LocalModel, new: &LocalModel) -> Self {
        let mut fractions = [[0.0; MAX_HANDLES]; MAX_HANDLES];
        let mut continues = [false; MAX_HANDLES];
        let mut is_part = [false; MAX_HANDLES];
        let mut mark = |from: u8, to: u8| {
            if let Some(continues) = continues.get_mut(usize::from(to)) {
                *continues = true;
            }
            let row = fractions.get_mut(usize::from(from));
            if let Some(place) = row.and_then(|row| row.get_mut(usize::from(to))) {
                *place = 1.0;
            }
        };
        for handle in new.handles() {
            if old.head.handle_count == 0 {
                mark(0, handle.piece);
            }
            let before = old.handles().find(|before| before.device == handle.device);
            if let Some(before) = before {
                mark(before.piece, handle.piece);
            }
        }
        for row in &mut fractions {
            let parts = row.iter().sum::<f64>();
            for (is_part, part) in is_part.iter_mut().zip(row.iter()) {
                *is_part |= parts > 1.0 && *part > 0.0;
            }
            let weights = new.head.pieces.iter().map(|piece| piece.stored.max(0.0));
            let whole = row
                .iter()
                .zip(weights.clone())
                .map(|(part, weight)| part * weight);
            let whole = whole.sum::<f64>();
            for (part, weight) in row.iter_mut().zip(weights) {
                if whole > 0.0 && whole.is_finite() {
                    *part *= weight / whole;
                } else if parts > 0.0 {
                    *part /= parts;
                }
            }
        }
        Self {
            fractions,
            continues,
            is_part,
            count: usize::from(new.piece_count()),
        }
    }

    /// Divides an amount of each former piece among the new pieces.
    pub(crate) fn of(&self, amounts: &[f64; MAX_HANDLES]) -> [f64; MAX_HANDLES] {
        let mut divided = [0.0; MAX_HANDLES];
        for (row, amount) in self.fractions.iter().zip(amounts) {
            for (sum, fraction) in divided.iter_mut().zip(row) {
                *sum += amount * fraction;
            }
        }
        divided
    }

    /// The new piece with the largest part of a former piece; zero if there is none.
    fn heir(&self, piece: usize) -> usize {
        let row = self.fractions.get(piece).into_iter().flatten();
        let (mut heir, mut most) = (0, 0.0);
        for (to, fraction) in (0..MAX_HANDLES).zip(row) {
            if *fraction > most {
                (heir, most) = (to, *fraction);
            }
        }
        heir
    }
}

impl Passivity {
    /// Parts the accounts as the pieces part. `stored` (J) is the energy that the model rendered so far stores in each new
    /// piece; `None` for a scheme without a cap. `handles` are those of the new model.
    pub(crate) fn part<'a>(
        &mut self,
        division: &Division,
        stored: Option<&[f64; MAX_HANDLES]>,
        handles: impl Iterator<Item = &'a HandleReference>,
    ) {
        let former = self.pieces;
        let credits = division.of(&former.map(|piece| piece.credit));
        let gots = division.of(&former.map(|piece| piece.got));
        let mut parts = [PieceAccount::default(); MAX_HANDLES];
        let sums = credits.into_iter().zip(gots).zip(division.continues);
        for (((credit, got), continues), part) in sums.zip(&mut parts) {
            (part.credit, part.got) = if continues {
                (credit, got)
            } else {
                (self.config.allowance, 0.0)
            };
        }
        for hand in &mut self.hands {
            hand.piece = division.heir(hand.piece);
        }
        for handle in handles {
            if let Some(hand) = self.hands.get_mut(usize::from(handle.device)) {
                hand.piece = usize::from(handle.piece);
            }
        }
        for hand in &self.hands {
            if let Some(part) = parts.get_mut(hand.piece) {
                part.spared += hand.spared;
            }
        }
        let each = parts.iter_mut().zip(division.is_part);
        for ((part, is_part), stored) in each.zip(stored.into_iter().flatten()) {
            if is_part {
                let backed = stored + self.config.allowance + part.spared.max(0.0);
                part.credit = part.credit.min(backed);
            }
        }
        for (former, row) in former.iter().zip(&division.fractions) {
            for (part, fraction) in parts.iter_mut().zip(row) {
                if *fraction > 0.0 {
                    // The damper that takes out missing energy continues in each part.
                    part.damped = part.damped.max(former.damped);
                }
            }
        }
        self.pieces = parts;
        self.piece_count = division.count;
        self.total();
    }

    /// Begins the sums of released energy at the values that the first model after a parting states.
    pub(crate) fn begin_released(&mut self, energies: &[PieceEnergy; MAX_HANDLES]) {
        for (piece, energy) in self.pieces.iter_mut().zip(energies) {
            piece.released = energy.released;
        }
    }

    /// Takes the energy that each piece has released so far, as the model claims.
    pub(crate) fn release_by_piece(&mut self, energies: &[PieceEnergy; MAX_HANDLES]) {
        let each = self.pieces.iter_mut().zip(energies);
        for (piece, energy) in each.take(self.piece_count) {
            piece.release(energy.released);
        }
    }

    /// Keeps the first `count` pieces. The hands have left the other pieces.
    pub(crate) fn keep_pieces(&mut self, count: usize) {
        self.piece_count = count;
        for hand in &mut self.hands {
            if hand.piece >= count {
                hand.piece = 0;
            }
        }
    }

    /// Caps the wrenches on the handles of each piece by the account of that piece. `stored` (J) is the energy that
    /// hands could get back, by piece.
    pub(crate) fn cap_by_piece(
        &mut self,
        model: &LocalModel,
        motions: &[Motion; MAX_HANDLES],
        stored: &[f64; MAX_HANDLES],
        elastic: &mut [Vec6; MAX_HANDLES],
        viscous: &mut [Vec6; MAX_HANDLES],
    ) {
        let mut accounts = self.pieces;
        let count = usize::from(pieces::count(model.handles()));
        let (mut withheld, mut capped) = (super::Withheld::default(), false);
        let each = accounts.iter_mut().zip(stored).zip(0..MAX_HANDLES);
        for ((account, stored), piece) in each.take(count) {
            // The handles of the piece, one after another.
            let on_piece = |handle: &&HandleReference| usize::from(handle.piece) == piece;
            let own_motions = gathered(model, piece, motions, Motion::none());
            let mut own_elastic = gathered(model, piece, elastic, Vec6::zeros());
            let mut own_viscous = gathered(model, piece, viscous, Vec6::zeros());
            let devices = model.handles().filter(on_piece).map(|handle| handle.device);
            let found = self.cap_piece(
                account,
                devices,
                &own_motions,
                *stored,
                &mut own_elastic,
                &mut own_viscous,
            );
            for (all, own) in [(&mut *elastic, &own_elastic), (&mut *viscous, &own_viscous)] {
                let all = model.handles().zip(all);
                let all = all.filter(|(handle, _)| on_piece(handle));
                for ((_, wrench), own) in all.zip(own) {
                    *wrench = *own;
                }
            }
            capped |= found.is_some();
            withheld = found
                .filter(|found| found.force > withheld.force)
                .unwrap_or(withheld);
        }
        self.pieces = accounts;
        self.withheld = withheld;
        if capped {
            crate::count_one(&mut self.account.capped);
        }
    }

    /// Sums the credit that the cap can spend.
    pub(super) fn total(&mut self) {
        let pieces = self.pieces.iter().take(self.piece_count);
        self.account.available = pieces.fold(0.0, |sum, piece| sum + piece.available());
    }
}

/// The values of the handles on a `piece`, one after another.
fn gathered<T: Copy>(
    model: &LocalModel,
    piece: usize,
    all: &[T; MAX_HANDLES],
    none: T,
) -> [T; MAX_HANDLES] {
    let mut own = [none; MAX_HANDLES];
    let all = model.handles().zip(all);
    let all = all.filter(|(handle, _)| usize::from(handle.piece) == piece);
    for (own, (_, value)) in own.iter_mut().zip(all) {
        *own = *value;
    }
    own
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_heir_of_a_piece_is_its_largest_part_the_first_of_equal_ones_and_the_first_piece_where_none_is_left()
     {
        let heir = |row: [f64; 4]| {
            let mut fractions = [[0.0; MAX_HANDLES]; MAX_HANDLES];
            fractions[1][..4].copy_from_slice(&row);
            let division = Division {
                fractions,
                continues: [true; MAX_HANDLES],
                is_part: [false; MAX_HANDLES],
                count: 4,
            };
            division.heir(1)
        };
        assert_eq!(heir([0.1, 0.2, 0.6, 0.1]), 2);
        assert_eq!(heir([0.0, 0.5, 0.0, 0.5]), 1);
        assert_eq!(heir([0.0; 4]), 0);
    }
}
