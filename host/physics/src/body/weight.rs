//! The part of a body's weight that each handle carries.
//!
//! At rest, handles and supports together carry the whole weight. The distribution depends on the shape in which the
//! body hangs, and changes as the body moves. The weight on each handle is read once, from the settled body, before a
//! hand has moved it, and is kept constant from then on. This value is right at the start, whatever the supports carry.
//! A constant force is the gradient of a potential, so it returns exactly the energy that it took. Later changes of the
//! distribution belong to the elastic part of the wrench.

use super::Body;
use crate::Vec3;

impl Body {
    /// The weight in the last reported wrench on the hand, by handle (N). Each weight points along gravity and is at
    /// most the weight of the whole body. The function is meant for a body that has come to rest. All weights are zero
    /// before the first step.
    pub fn handle_weights(&self) -> Vec<Vec3> {
        let gravity = self.model.config.gravity;
        let load = self.constraints.nodes().map(|node| self.model.load[node]);
        let whole = gravity.norm() * load.sum::<f64>() * self.model.load_factor;
        let down = gravity.try_normalize(0.0).unwrap_or_default();
        let each = self.constraints.handles.iter().map(|handle| {
            let weight = handle.report.wrench_on_hand.force.dot(&down);
            // With a load factor below zero there is no weight to distribute.
            down * weight.min(whole).max(0.0)
        });
        each.collect()
    }
}
