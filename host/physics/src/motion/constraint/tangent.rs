//! Tangents of contacts between up to four nodes, which the factor of a body takes in.

use crate::Mat3;
use crate::linear::block_matrix::BlockMatrix;

/// The tangent of a contact in the last step, on the sum of the displacements of nodes by weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tangent {
    /// The nodes and their weights. A weight of zero has no node.
    pub nodes: [(u32, f64); 4],
    /// Stiffness (N/m), symmetric and positive semidefinite.
    pub stiffness: Mat3,
}

impl Tangent {
    fn taken(&self) -> impl Iterator<Item = (u32, f64)> {
        self.nodes.into_iter().filter(|(_, weight)| *weight != 0.0)
    }

    /// The tangent with the number `place` of each node.
    pub(crate) fn renumbered(&self, place: &[u32]) -> Self {
        let renumber = |(node, weight): (u32, f64)| (place[node as usize], weight);
        Self {
            nodes: self.nodes.map(renumber),
            ..*self
        }
    }
}

/// Adds `factor` times the tangents over places to a matrix. Held places are left out. A matrix lacks the blocks
/// between the two feet of a contact of a body with itself: the feet are added each for itself, so that the sum stays positive
/// semidefinite.
pub(crate) fn assemble(tangents: &[Tangent], factor: f64, matrix: &mut BlockMatrix) {
    let free = matrix.free() as u32;
    for tangent in tangents {
        let each = || tangent.taken().filter(|(place, _)| *place < free);
        let has_all =
            each().all(|(row, _)| each().all(|(column, _)| matrix.slot(row, column).is_some()));
        for (row, own) in each() {
            for (column, other) in each() {
                if (has_all || own * other > 0.0)
                    && let Some(slot) = matrix.slot(row, column)
                {
                    matrix.add(slot, &(tangent.stiffness * (factor * own * other)));
                }
            }
        }
    }
}
