//! Hands that leave: a new topology may name fewer hands than the one before, because a hand released its handle or
//! because the piece of the body that it held was dropped.
//!
//! The force of such a hand fades to zero along a smooth step, in the time in which the force of an old model fades
//! ([`CouplingConfig::decay`](super::CouplingConfig::decay)). Until then, the newest model has a handle without stiffness
//! and damping for the hand. Cap and energy account thus treat its force as any other force. The stiffness that the hand
//! felt passes to zero with the blend, as every stiffness passes to that of the new model.
//!
//! Such a handle belongs to the piece of the body that continues its former piece. If no piece continues it, the handle gets a
//! piece of its own, and the account of that piece pays for its force.

use super::Coupling;
use crate::geometry::{Mat6, Pose, Twist, Vec3, Wrench, smooth_step};
use crate::local_model::{HandleReference, PairBlocks, PieceEnergy};
use crate::{MAX_DEVICES, MAX_HANDLES};

/// A force or moment that a faded handle may keep by rounding (N, N m).
const RESIDUE: f64 = 1e-9;

/// The force of a hand that leaves.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fade {
    /// Wrench, and the weight in it, when the hand left.
    wrench: Wrench,
    weight: Vec3,
    /// The part of the fade that is left, from one to zero.
    left: f64,
}

impl Fade {
    /// No force.
    pub(super) fn none() -> Self {
        Self {
            wrench: Wrench::zero(),
            weight: Vec3::zeros(),
            left: 0.0,
        }
    }
}

impl Coupling {
    /// Gives the pending model a handle for each hand that it does not name, and whose wrench `before` is not zero.
    pub(super) fn keep_leaving(
        &mut self,
        before: &[Wrench; MAX_HANDLES],
        devices: &[(Pose, Twist)],
    ) {
        let Self {
            to,
            pending,
            named_before,
            weights,
            fades,
            ..
        } = self;
        let mut named = [false; MAX_DEVICES];
        for handle in pending.handles() {
            if let Some(named) = named.get_mut(usize::from(handle.device)) {
                *named = true;
            }
        }
        let leaves = |device: usize| named.get(device) == Some(&false);
        let each = to.handles().zip(before).zip(weights.iter());
        for ((old, wrench), weight) in each.take(usize::from(*named_before)) {
            let device = usize::from(old.device);
            if let Some(fade) = fades.get_mut(device).filter(|_| leaves(device)) {
                *fade = Fade {
                    wrench: *wrench,
                    weight: *weight,
                    left: 1.0,
                };
            }
        }
        let mut pieces = pending.piece_count();
        for (old, wrench) in to.handles().zip(before) {
            let device = usize::from(old.device);
            let Some(fade) = fades.get(device) else {
                continue;
            };
            let has_force = wrench.is_finite()
                && *wrench != Wrench::zero()
                && (fade.left > 0.0 || wrench.stacked().amax() > RESIDUE);
            let last = usize::from(pending.head.handle_count);
            let successor = to.successor_of(old.piece, pending).unwrap_or(pieces);
            let place = pending.handles.get_mut(last);
            let Some(place) = place.filter(|_| leaves(device) && has_force) else {
                continue;
            };
            let part = smooth_step(fade.left);
            *place = HandleReference {
                device: old.device,
                piece: successor,
                pose: devices.get(device).map_or(old.pose, |(pose, _)| *pose),
                wrench: fade.wrench.scaled(part),
                weight: fade.weight * part,
                ..HandleReference::zero()
            };
            if successor == pieces {
                if let Some(energy) = pending.head.pieces.get_mut(usize::from(successor)) {
                    *energy = PieceEnergy::default();
                }
                pieces = pieces.saturating_add(1);
            }
            clear(&mut pending.stiffness, last);
            clear(&mut pending.damping, last);
            pending.head.handle_count = pending.head.handle_count.saturating_add(1);
        }
    }

    /// Fades the force of hands that leave by a tick, and forgets these hands once they have no force.
    pub(super) fn fade_leaving(&mut self) {
        if self.to.head.handle_count <= self.named {
            return;
        }
        let step = self.config.period / self.config.decay;
        let mut fading = false;
        let used = usize::from(self.to.head.handle_count);
        let leaving = self.to.handles.iter_mut().zip(&mut self.from.handles);
        for (handle, from) in leaving.take(used).skip(usize::from(self.named)) {
            let Some(fade) = self.fades.get_mut(usize::from(handle.device)) else {
                continue;
            };
            fading |= fade.left > 0.0;
            fade.left = (fade.left - step).max(0.0);
            let part = smooth_step(fade.left);
            let (wrench, weight) = (fade.wrench.scaled(part), fade.weight * part);
            // The former model loses as much, so that the blend of the two does not lag behind.
            let change = wrench.plus(&handle.wrench.scaled(-1.0));
            from.wrench = from.wrench.plus(&change);
            from.weight += weight - handle.weight;
            (handle.wrench, handle.weight) = (wrench, weight);
        }
        if !fading && self.blend >= 1.0 {
            self.to.head.handle_count = self.named;
            self.passivity
                .keep_pieces(usize::from(self.to.piece_count()));
        }
    }
}

/// Clears the blocks between the handle of this index and the handles up to it.
fn clear(blocks: &mut PairBlocks, handle: usize) {
    for (i, row) in blocks.iter_mut().enumerate() {
        for (j, block) in row.iter_mut().enumerate() {
            if i.max(j) == handle {
                *block = Mat6::zeros();
            }
        }
    }
}
