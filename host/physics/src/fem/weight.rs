//! Which part of a body's weight each of its handles is taken to bear.
//!
//! At rest handles and supports bear the whole weight together; how they share it depends on how the body hangs, and
//! changes as it moves. Here every node's weight goes to the handle or support that it is nearest to at rest. That is
//! right to the first order for bodies that hang between their handles, and it never changes, which is the point: a
//! force that is constant is the gradient of a potential, and gives back exactly the energy that it took. What the
//! handles bear beside it sums to nothing over all of them and is the elastic part's business.

use super::body::Body;
use crate::Vec3;

impl Body {
    /// By handle, the weight of the nodes that are nearest to it at rest (N).
    pub fn handle_weights(&self) -> Vec<Vec3> {
        let mut owners = vec![None; self.rest.len()];
        for (number, handle) in self.handles.iter().enumerate() {
            let nodes = handle.first..handle.first + handle.offsets.len();
            owners[nodes].fill(Some(number));
        }
        // Places that bear weight: nodes of handles, and guided nodes, which are nobody's.
        let held = (0..self.rest.len()).filter_map(|node| owners[node].map(|o| (node, Some(o))));
        let guided = self.supports.guided().map(|node| (node, None));
        let places: Vec<(Vec3, Option<usize>)> = held
            .chain(guided)
            .map(|(node, owner)| (self.rest[node], owner))
            .collect();
        let mut weights = vec![Vec3::zeros(); self.handles.len()];
        for (rest, load) in self.rest.iter().zip(&self.load) {
            let nearest = places
                .iter()
                .min_by(|(a, _), (b, _)| {
                    let squared = |x: &Vec3| (x - rest).norm_squared();
                    squared(a).total_cmp(&squared(b))
                })
                .and_then(|(_, owner)| *owner);
            if let Some(handle) = nearest {
                weights[handle] += self.config.gravity * *load;
            }
        }
        weights
    }
}
