//! Tangents of contacts between up to four nodes, which the factor of a body takes in: without them, conjugate gradients need
//! iterations by the root of the stiffness of a row.

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;

    const NONE: (u32, f64) = (0, 0.0);
    const P: [Vec3; 3] = [
        Vec3::new(1.0, -2.0, 0.5),
        Vec3::new(0.3, 0.7, -1.1),
        Vec3::new(-0.4, 0.2, 0.9),
    ];

    fn tangent(one: (u32, f64), other: (u32, f64)) -> Tangent {
        let normal = Vec3::new(0.6, 0.0, 0.8);
        Tangent {
            nodes: [one, other, NONE, NONE],
            stiffness: normal * normal.transpose() * 5.0 + Mat3::identity(),
        }
    }

    /// The product of the assembled matrix of three nodes in a chain with [`P`].
    fn assembled(tangent: Tangent) -> Vec<Vec3> {
        let chain: [&[u32]; 2] = [&[0, 1], &[1, 2]];
        let mut matrix = BlockMatrix::new(3, 3, chain.into_iter());
        assemble(&[tangent], 0.5, &mut matrix);
        (0..3).map(|row| matrix.row_product(row, &P)).collect()
    }

    /// Half the product of the tangent itself.
    fn exact(tangent: &Tangent) -> Vec<Vec3> {
        let moved: Vec3 = tangent
            .taken()
            .map(|(node, weight)| P[node as usize] * weight)
            .sum();
        let force = tangent.stiffness * moved * 0.5;
        let mut all = vec![Vec3::zeros(); 3];
        for (node, weight) in tangent.taken() {
            all[node as usize] += force * weight;
        }
        all
    }

    #[test]
    fn a_contact_with_an_obstacle_is_assembled_whole() {
        let contact = tangent((0, 0.25), (1, 0.75));
        let (found, exact) = (assembled(contact), exact(&contact));
        assert!(
            found
                .iter()
                .zip(&exact)
                .all(|(found, exact)| (found - exact).norm() < 1e-14)
        );
        assert!(exact[0].norm() > 0.1);
    }

    #[test]
    fn feet_without_a_common_block_are_assembled_each_for_itself() {
        let found = assembled(tangent((0, 1.0), (2, -1.0)));
        let [first, second] =
            [tangent((0, 1.0), NONE), tangent((2, -1.0), NONE)].map(|foot| exact(&foot));
        let each = first.iter().zip(&second).map(|(one, other)| one + other);
        assert!(
            found
                .iter()
                .zip(each)
                .all(|(found, exact)| (found - exact).norm() < 1e-14)
        );
    }
}
