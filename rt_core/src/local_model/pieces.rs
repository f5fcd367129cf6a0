//! The pieces of a torn body. A torn body is still one body with one local model. A **piece** is a connected part of
//! the body. Each handle has the number of its piece ([`HandleReference::piece`](super::HandleReference::piece)). Hands
//! on different pieces cannot pass energy to each other. The model therefore states the energies of each piece
//! separately ([`ModelHead::pieces`](super::ModelHead::pieces)), and each piece has its own account
//! ([`crate::passivity`]).
//!
//! In a whole body, the number of every piece is zero. The model's energies are then those of the body, and this module
//! computes nothing.

use super::{Deviation, HandleReference, LocalModel, clip};
use crate::MAX_HANDLES;
use crate::geometry::Vec3;

/// The energies of one piece of a torn body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PieceEnergy {
    /// Energy that hands at rest could get back from the piece at the reference state, without the weight (J). The
    /// energies of all pieces add up to [`ModelHead::energy`](super::ModelHead::energy). Zero is always safe.
    pub stored: f64,
    /// Energy that the piece itself has released since the body parted into these pieces (J). The value only grows.
    /// Zero is always safe.
    pub released: f64,
}

impl PieceEnergy {
    pub(super) fn is_finite(&self) -> bool {
        self.stored.is_finite() && self.released.is_finite()
    }
}

/// Number of pieces that the handles name: one more than the largest number of a piece. One without handles.
pub(crate) fn count<'a>(handles: impl Iterator<Item = &'a HandleReference>) -> u8 {
    let largest = handles.fold(0, |largest, handle| handle.piece.max(largest));
    largest.saturating_add(1)
}

impl LocalModel {
    /// Number of pieces that the handles name; one for a whole body.
    pub fn piece_count(&self) -> u8 {
        count(self.handles())
    }

    /// Energy that hands at rest could get back from each piece (J), after the drift has acted for `ahead` (s). This is
    /// [`Parts::stored`](super::Parts::stored) for each piece alone.
    pub(crate) fn stored_by_piece(
        &self,
        deviations: &[Deviation; MAX_HANDLES],
        ahead: f64,
    ) -> [f64; MAX_HANDLES] {
        let mut stored = self.head.pieces.map(|piece| piece.stored);
        let works = self.works(deviations, ahead);
        for (handle, work) in self.handles().zip(works) {
            if let Some(stored) = stored.get_mut(usize::from(handle.piece)) {
                *stored -= work;
            }
        }
        stored = stored.map(|stored| stored.max(0.0));
        if self.handles().all(|handle| handle.contact == Vec3::zeros()) {
            return stored;
        }
        let falls = self.springs(deviations);
        for (handle, fall) in self.handles().zip(&falls) {
            let elastic = handle.unweighted() + handle.drift.stacked() * ahead - fall;
            let mut force = Vec3::new(elastic.x, elastic.y, elastic.z);
            let whole = force.norm_squared();
            if handle.contact != Vec3::zeros()
                && clip(&mut force, &handle.contact)
                && let Some(stored) = stored.get_mut(usize::from(handle.piece))
            {
                // The clipped part of the force gives no energy back.
                *stored *= force.norm_squared() / whole;
            }
        }
        stored
    }
}
