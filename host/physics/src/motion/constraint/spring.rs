//! Springs between up to four nodes, which the shapes of a local model and the factor feel, and the steps do not.
//!
//! In a step the law of a contact acts (`motion::touching`). Between two publications the local model predicts the force of
//! a hand, and the contacts of the last step hold the body meanwhile: along the normal by a stiff spring, across it as the
//! friction spring did in the step. A new factor has the tangents of the contacts in the last step: without them, conjugate
//! gradients need iterations by the root of the stiffness of a row.

use crate::lanes::{Node, Real, to_node};
use crate::linear::block_matrix::BlockMatrix;
use crate::{Mat3, Vec3};

/// A spring on the sum of the displacements of nodes, by weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// The nodes and their weights. A weight of zero has no node.
    pub nodes: [(u32, f64); 4],
    /// Stiffness (N/m), symmetric and positive semidefinite.
    pub stiffness: Mat3,
    /// The tangent of the contact in the step (N/m), symmetric and positive semidefinite.
    pub tangent: Mat3,
}

impl Spring {
    fn taken(&self) -> impl Iterator<Item = (u32, f64)> {
        self.nodes.into_iter().filter(|(_, weight)| *weight != 0.0)
    }

    /// The spring with the number `place` of each node.
    pub(crate) fn renumbered(&self, place: &[u32]) -> Self {
        let renumber = |(node, weight): (u32, f64)| (place[node as usize], weight);
        Self {
            nodes: self.nodes.map(renumber),
            ..*self
        }
    }
}

/// Adds `factor` times the product of the springs with displacements `p` (m) to `q` (N). `place` gives the place of each node.
pub(crate) fn add<T: Real>(
    springs: &[Spring],
    factor: f64,
    place: &[u32],
    p: &[Node<T>],
    q: &mut [Node<T>],
) {
    let of = |node: u32| place[node as usize] as usize;
    for spring in springs {
        let moved: Vec3 = spring
            .taken()
            .map(|(node, weight)| crate::lanes::to_vec(&p[of(node)]) * weight)
            .sum();
        let force = spring.stiffness * moved * factor;
        for (node, weight) in spring.taken() {
            let load: Node<T> = to_node(&(force * weight));
            let sum = &mut q[of(node)];
            for i in 0..4 {
                sum[i] += load[i];
            }
        }
    }
}

/// Adds `factor` times the tangents of springs over places to a matrix. Held places are left out. A matrix lacks the blocks
/// between the two feet of a contact of a body with itself: the feet are added each for itself, so that the sum stays positive
/// semidefinite.
pub(crate) fn assemble(springs: &[Spring], factor: f64, matrix: &mut BlockMatrix) {
    let free = matrix.free() as u32;
    for spring in springs {
        let each = || spring.taken().filter(|(place, _)| *place < free);
        let has_all =
            each().all(|(row, _)| each().all(|(column, _)| matrix.slot(row, column).is_some()));
        for (row, own) in each() {
            for (column, other) in each() {
                if (has_all || own * other > 0.0)
                    && let Some(slot) = matrix.slot(row, column)
                {
                    matrix.add(slot, &(spring.tangent * (factor * own * other)));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spring(nodes: [(u32, f64); 4]) -> Spring {
        let normal = Vec3::new(0.6, 0.0, 0.8);
        let tangent = normal * normal.transpose() * 5.0 + Mat3::identity();
        Spring {
            nodes,
            stiffness: tangent,
            tangent,
        }
    }

    /// The product of the assembled matrix of three nodes in a chain with `p`, and that of the springs.
    fn products(springs: &[Spring], p: &[Vec3]) -> [Vec<Vec3>; 2] {
        let chain: [&[u32]; 2] = [&[0, 1], &[1, 2]];
        let mut matrix = BlockMatrix::new(3, 3, chain.into_iter());
        assemble(springs, 0.5, &mut matrix);
        let nodes: Vec<Node<f64>> = p.iter().map(to_node).collect();
        let mut q = vec![[0.0; 4]; 3];
        add(springs, 0.5, &[0, 1, 2], &nodes, &mut q);
        let rows = (0..3).map(|row| matrix.row_product(row, p));
        [rows.collect(), q.iter().map(crate::lanes::to_vec).collect()]
    }

    const P: [Vec3; 3] = [
        Vec3::new(1.0, -2.0, 0.5),
        Vec3::new(0.3, 0.7, -1.1),
        Vec3::new(-0.4, 0.2, 0.9),
    ];

    #[test]
    fn a_contact_with_an_obstacle_is_assembled_whole() {
        let [found, exact] = products(&[spring([(0, 0.25), (1, 0.75), (0, 0.0), (0, 0.0)])], &P);
        let mut each = found.iter().zip(&exact);
        assert!(each.all(|(found, exact)| (found - exact).norm() < 1e-14));
        assert!(exact[0].norm() > 0.1);
    }

    #[test]
    fn feet_without_a_common_block_are_assembled_each_for_itself() {
        let [found, _] = products(&[spring([(0, 1.0), (2, -1.0), (0, 0.0), (0, 0.0)])], &P);
        let each = [
            spring([(0, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)]),
            spring([(2, -1.0), (0, 0.0), (0, 0.0), (0, 0.0)]),
        ];
        let [_, exact] = products(&each, &P);
        assert_eq!(found, exact);
    }
}
