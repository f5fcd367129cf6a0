//! Hands that leave: a new topology may name fewer hands than the one before.
//!
//! The force of such a hand passes to zero over the blend, as every force passes to that of the new model. For the time
//! of the blend, the new model gets a handle without force, stiffness and damping for the hand. Cap and energy account
//! thus treat its force as any other force.

use super::Coupling;
use crate::geometry::{Mat6, Pose, Twist, Wrench};
use crate::local_model::{HandleReference, PairBlocks};
use crate::{MAX_DEVICES, MAX_HANDLES};

impl Coupling {
    /// Gives the pending model a handle without force for each hand that it does not name, and whose wrench `before` is
    /// not zero.
    pub(super) fn keep_leaving(
        &mut self,
        before: &[Wrench; MAX_HANDLES],
        devices: &[(Pose, Twist)],
    ) {
        let Self { to, pending, .. } = self;
        let mut named = [false; MAX_DEVICES];
        for handle in pending.handles() {
            if let Some(named) = named.get_mut(usize::from(handle.device)) {
                *named = true;
            }
        }
        for (old, wrench) in to.handles().zip(before) {
            let device = usize::from(old.device);
            let leaves = named.get(device) == Some(&false) && *wrench != Wrench::zero();
            let last = usize::from(pending.handle_count);
            let place = pending.handles.get_mut(last).filter(|_| leaves);
            let Some(place) = place else { continue };
            *place = HandleReference {
                device: old.device,
                pose: devices.get(device).map_or(old.pose, |(pose, _)| *pose),
                ..HandleReference::zero()
            };
            clear(&mut pending.stiffness, last);
            clear(&mut pending.damping, last);
            pending.handle_count = pending.handle_count.saturating_add(1);
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
