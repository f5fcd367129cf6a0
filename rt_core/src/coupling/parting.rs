//! A body that parts into pieces. The energy of the rendered model and the account part with the body, and weights
//! change.
//!
//! The energy of the rendered model parts in the same proportions as the account ([`Division`]), so neither the energy
//! nor the credit of a hand jumps against the other. A body that was whole and stays whole is not treated here.
//!
//! **Weights.** The weight on a handle is found anew when the topology changes. The tick passes from the former weight to
//! the new one with the blend. If the handle is away from the place where it was lifted, a change of its weight changes
//! the potential. The account charges or credits the hand with the difference, as for a weight that comes and goes
//! ([`crate::passivity`]).

use super::Coupling;
use crate::MAX_HANDLES;
use crate::geometry::{Pose, Twist, Vec6};
use crate::local_model::{Lead, LocalModel, PieceEnergy};
use crate::passivity::Division;

impl LocalModel {
    /// The piece of `newer` to which a piece of this model went, by the hands that both models name; `None` if no
    /// hand of the piece is left.
    pub(super) fn successor_of(&self, piece: u8, newer: &Self) -> Option<u8> {
        if self.piece_count() == 1 && newer.piece_count() == 1 {
            return Some(0);
        }
        let mut own = self.handles().filter(|handle| handle.piece == piece);
        own.find_map(|old| {
            let successor = newer.handles().find(|handle| handle.device == old.device);
            successor.map(|successor| successor.piece)
        })
    }

    /// States the energies of a whole body as those of its only piece.
    fn state_only_piece(&mut self) {
        let [only, ..] = &mut self.head.pieces;
        *only = PieceEnergy {
            stored: self.head.energy,
            released: self.head.released,
        };
    }
}

impl Coupling {
    /// Whether the body consists of several pieces in the model in use.
    pub(super) fn is_torn(&self) -> bool {
        self.to.piece_count() > 1
    }

    /// Prepares the energies of the pending model. If its pieces differ from those in use, this returns how the
    /// pieces part. Call it before the hands that leave get their handles.
    pub(super) fn prepare_pieces(&mut self) {
        if self.pending.piece_count() == 1 {
            self.pending.state_only_piece();
        }
    }

    /// How the pieces in use part into those of the pending model; `None` if the pieces stay.
    pub(super) fn division(&self) -> Option<Division> {
        let (to, pending) = (&self.to, &self.pending);
        let torn = to.piece_count() > 1 || pending.piece_count() > 1;
        let mut pairs = to.handles().zip(pending.handles());
        let same = to.head.handle_count == pending.head.handle_count
            && pairs.all(|(a, b)| a.device == b.device && a.piece == b.piece);
        (torn && !same).then(|| Division::between(to, pending))
    }

    /// Energy that hands at rest could get back from each piece (J), blended as the whole model is.
    pub(super) fn stored_by_piece(&self, devices: &[(Pose, Twist)]) -> [f64; MAX_HANDLES] {
        if !self.is_torn() {
            let (still, at_rest) = ([Lead::none(); MAX_HANDLES], [Vec6::zeros(); MAX_HANDLES]);
            let mut stored = [0.0; MAX_HANDLES];
            let [only, ..] = &mut stored;
            *only = self.parts(devices, &still, &at_rest).stored;
            return stored;
        }
        let deviations = self.to.deviations(devices);
        let mut stored = self.to.stored_by_piece(&deviations, self.ahead);
        if self.blend < 1.0 {
            let old = self.from.stored_by_piece(&deviations, self.ahead);
            for (stored, old) in stored.iter_mut().zip(old) {
                *stored = old * (1.0 - self.blend) + *stored * self.blend;
            }
        }
        // An energy that overflowed exceeds any energy that the hands can have supplied.
        stored.map(|stored| if stored.is_finite() { stored } else { f64::MAX })
    }

    /// Sets the energies of the model rendered so far, whose reference is that of the pending model now, such that each
    /// piece stores `stored` (J) at the present poses.
    pub(super) fn keep_stored(
        &mut self,
        stored: &[f64; MAX_HANDLES],
        ahead: f64,
        devices: &[(Pose, Twist)],
    ) {
        let from = &mut self.from;
        let works = from.works(&from.deviations(devices), ahead);
        for (piece, stored) in from.head.pieces.iter_mut().zip(stored) {
            piece.stored = *stored;
        }
        let handles = from
            .handles
            .iter()
            .take(usize::from(self.pending.head.handle_count));
        for (handle, work) in handles.zip(works) {
            if let Some(piece) = from.head.pieces.get_mut(usize::from(handle.piece)) {
                piece.stored += work;
            }
        }
    }

    /// Parts the account as the pieces part, and takes the released energy that the newest model states. `stored` (J) is
    /// the energy that the model rendered so far stores in each new piece.
    pub(super) fn part_account(
        &mut self,
        division: Option<&Division>,
        stored: Option<&[f64; MAX_HANDLES]>,
    ) {
        if let Some(division) = division {
            self.passivity.part(division, stored, self.to.handles());
            self.passivity.begin_released(&self.to.head.pieces);
        } else if self.is_torn() {
            self.passivity.release_by_piece(&self.to.head.pieces);
        } else {
            self.passivity.release(self.to.head.released);
        }
    }

    /// Finds the weight on each handle as rendered now.
    pub(super) fn weigh(&mut self) {
        let handles = self.to.handles().zip(&self.from.handles);
        for (weight, (to, from)) in self.weights.iter_mut().zip(handles) {
            // A weight that stays keeps its bytes.
            *weight = if self.blend >= 1.0 || from.weight == to.weight {
                to.weight
            } else {
                from.weight * (1.0 - self.blend) + to.weight * self.blend
            };
        }
    }
}
