//! Which part of a body's weight each of its handles bears.
//!
//! At rest handles and supports bear the whole weight together; the distribution depends on how the body hangs, and
//! changes as it moves. What a handle bears of the settled body, before a hand has moved it, is right at the start,
//! whatever supports bear, and is kept from then on, which is the point: a force that is constant is the gradient of a
//! potential, and gives back exactly the energy that it took. How the fractions change later is the elastic part's
//! business.

use super::Body;
use crate::Vec3;

impl Body {
    /// By handle, the part of its wrench on the hand, as last reported, that is weight (N): along gravity, and no more
    /// than the body weighs. To be asked of a body that has come to rest; nothing where there has been no step.
    pub fn handle_weights(&self) -> Vec<Vec3> {
        let gravity = self.model.config.gravity;
        let whole = gravity.norm() * self.model.load.iter().sum::<f64>() * self.model.load_factor;
        let down = gravity.try_normalize(0.0).unwrap_or_default();
        let each = self.constraints.handles.iter().map(|handle| {
            let borne = handle.report.wrench_on_hand.force.dot(&down);
            // A load factor below zero has no weight to share.
            down * borne.min(whole).max(0.0)
        });
        each.collect()
    }
}
