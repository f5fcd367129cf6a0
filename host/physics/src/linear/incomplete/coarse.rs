//! The coarse space: the matrix on rigid motions of patches, a small matrix that is factorized completely.
//!
//! A node of a patch moves by `t + w x arm`. The arm is the position of the node relative to the patch's centre, in
//! units of the patch's size, so that translations `t` and turns `w` have the same unit. With `P` for these motions of
//! all patches the coarse matrix is `P^T A P`. It has two nodes for each patch, one for `t` and one for `w`, so that
//! the complete factor ([`Factor`]) serves it unchanged. `P` contains the rigid motions at the present positions,
//! which do not strain corotational cells.

use super::aggregates::aggregates;
use crate::cost::Cost;
use crate::error::CondenseError;
use crate::lanes::{Node, to_node};
use crate::linear::block_matrix::BlockMatrix;
use crate::linear::factor::Factor;
use crate::linear::order;
use crate::linear::panel::Panels;
use crate::linear::read_ahead::{self, Share};
use crate::linear::sparse_cholesky::FactorCode;
use crate::linear::step_matrix::StepMatrix;
use crate::team::Team;
use crate::{Mat3, Vec3};

/// The fraction by which diagonals are enlarged. A patch whose nodes lie on a line has no stiffness against turns about
/// that line.
const ENLARGED: f64 = 1e-6;

/// The factor of the coarse matrix.
#[derive(Clone, Debug)]
pub(crate) struct Coarse {
    /// The patch of each place.
    patch: Vec<u32>,
    /// The arm of each place.
    arm: Vec<Node<f32>>,
    panels: Panels,
    /// Forces and moments on patches, and after the solve translations and turns.
    motion: Vec<Node<f32>>,
}

#[inline(always)]
fn cross(a: &Node<f32>, b: &Node<f32>) -> Node<f32> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
        0.0,
    ]
}

impl Coarse {
    /// Sums the forces and moments of `r` on each patch.
    pub(crate) fn gather(&mut self, r: &[Node<f32>]) {
        self.motion.fill([0.0; 4]);
        for ((&patch, arm), r) in self.patch.iter().zip(&self.arm).zip(r) {
            let at = 2 * patch as usize;
            let Some([force, moment]) = self.motion.get_mut(at..at + 2) else {
                return;
            };
            let turn = cross(arm, r);
            for i in 0..4 {
                force[i] += r[i];
                moment[i] += turn[i];
            }
        }
    }

    /// Solves for the motions of the patches.
    pub(crate) fn solve(&mut self, team: &dyn Team) {
        self.panels.solve_with(team, &mut self.motion);
    }

    /// Adds the motions of the patches to `z`.
    pub(crate) fn add_to(&self, z: &mut [Node<f32>]) {
        for ((&patch, arm), z) in self.patch.iter().zip(&self.arm).zip(z) {
            let at = 2 * patch as usize;
            let Some([translation, turn]) = self.motion.get(at..at + 2) else {
                return;
            };
            let turned = cross(turn, arm);
            for i in 0..4 {
                z[i] += translation[i] + turned[i];
            }
        }
    }

    /// The cost of `gather`, `solve` and `add_to`.
    pub(crate) fn solve_cost(&self) -> Cost {
        let nodes = self.patch.len();
        let patches = Cost::read(size_of_val(self.patch.as_slice()))
            + Cost::read(size_of_val(self.arm.as_slice()));
        let r = size_of::<Node<f32>>() * nodes;
        patches
            + patches.again()
            + Cost::read(r).again()
            + Cost::update(r).again()
            + self.panels.solve_cost()
            + Cost::flops((15 + 15) * nodes)
    }

    /// Reads a share of the numbers.
    pub(crate) fn read(&self, share: Share) {
        self.panels.read(share);
        read_ahead::read(&self.arm, share, |arm| arm[0]);
    }

    /// Memory of the factor (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.patch.as_slice())
            + size_of_val(self.arm.as_slice())
            + size_of_val(self.motion.as_slice())
            + self.panels.bytes()
    }
}

/// The factorization that computes the numbers of a [`Coarse`].
#[derive(Debug)]
pub(crate) struct CoarseMaker {
    patch: Vec<u32>,
    /// Centre of each patch (m).
    centre: Vec<Vec3>,
    /// Number of nodes of each patch.
    count: Vec<f64>,
    /// Largest distance of a node of each patch from the centre (m).
    radius: Vec<f64>,
    arm: Vec<Vec3>,
    /// The present row: the coupling of a node to the translations and to the turns of each patch.
    row: Vec<(u32, Mat3, Mat3)>,
    matrix: BlockMatrix,
    mass: Vec<f64>,
    factor: Factor,
}

impl CoarseMaker {
    pub(crate) fn new(
        matrix: &BlockMatrix,
        rest: &[Vec3],
        code: FactorCode,
    ) -> Result<Self, CondenseError> {
        let (patch, patches) = aggregates(matrix);
        let pairs = |patch: &[u32]| -> Vec<[u32; 2]> {
            let mut pairs = Vec::new();
            for node in 0..matrix.free() {
                let others = matrix.free_blocks(node).map(|(other, _)| patch[other]);
                pairs.extend(others.map(|other| [patch[node], other]));
            }
            pairs.sort_unstable();
            pairs.dedup();
            pairs
        };
        let mut maker = Self {
            centre: vec![Vec3::zeros(); patches],
            count: vec![0.0; patches],
            radius: vec![0.0; patches],
            arm: vec![Vec3::zeros(); patch.len()],
            row: Vec::new(),
            matrix: BlockMatrix::new(0, 0, core::iter::empty()),
            mass: vec![0.0; 2 * patches],
            factor: Factor::with_code(&BlockMatrix::new(0, 0, core::iter::empty()), &[], code)?,
            patch,
        };
        maker.place(|node| rest[node]);
        // Patches are numbered in a fill-reducing order.
        let coupled = pairs(&maker.patch);
        let graph = BlockMatrix::new(patches, patches, coupled.iter().map(<[u32; 2]>::as_slice));
        let places = order::places(&order::order(&graph, &maker.centre));
        for patch in &mut maker.patch {
            *patch = places[*patch as usize];
        }
        let coupled: Vec<[u32; 4]> = pairs(&maker.patch)
            .iter()
            .map(|&[a, b]| [2 * a, 2 * a + 1, 2 * b, 2 * b + 1])
            .collect();
        maker.matrix = BlockMatrix::new(
            2 * patches,
            2 * patches,
            coupled.iter().map(<[u32; 4]>::as_slice),
        );
        let identity: Vec<u32> = (0..2 * patches as u32).collect();
        maker.factor = Factor::with_code(&maker.matrix, &identity, code)?;
        let most = (0..matrix.free()).map(|node| matrix.free_blocks(node).count());
        maker.row = Vec::with_capacity(most.max().unwrap_or(0));
        Ok(maker)
    }

    /// Computes centres and arms with the nodes at `at` (m).
    fn place(&mut self, at: impl Fn(usize) -> Vec3) {
        self.centre.fill(Vec3::zeros());
        self.count.fill(0.0);
        self.radius.fill(0.0);
        for (node, &patch) in self.patch.iter().enumerate() {
            self.centre[patch as usize] += at(node);
            self.count[patch as usize] += 1.0;
        }
        for (centre, count) in self.centre.iter_mut().zip(&self.count) {
            *centre /= *count;
        }
        for (node, &patch) in self.patch.iter().enumerate() {
            self.arm[node] = at(node) - self.centre[patch as usize];
            let radius = &mut self.radius[patch as usize];
            *radius = radius.max(self.arm[node].norm());
        }
        for (arm, &patch) in self.arm.iter_mut().zip(&self.patch) {
            let radius = self.radius[patch as usize];
            if radius > 0.0 {
                *arm /= radius;
            }
        }
    }

    /// A factor without numbers.
    pub(crate) fn empty(&self) -> Coarse {
        Coarse {
            patch: self.patch.clone(),
            arm: vec![[0.0; 4]; self.arm.len()],
            panels: Panels::new(&self.factor),
            motion: vec![[0.0; 4]; self.matrix.nodes()],
        }
    }

    /// Computes the numbers of `coarse` with the places at `at` (m).
    ///
    /// # Errors
    ///
    /// [`CondenseError::NotPositiveDefinite`].
    pub(crate) fn make(
        &mut self,
        coarse: &mut Coarse,
        at: impl Fn(usize) -> Vec3,
        step: &StepMatrix<'_>,
    ) -> Result<(), CondenseError> {
        self.place(at);
        self.matrix.clear();
        for node in 0..self.patch.len() {
            self.add_row(node, step);
        }
        for node in 0..self.matrix.nodes() {
            let enlarged = self.matrix.diagonal(node).diagonal().map(|diagonal| {
                // A patch whose nodes are all guided has no stiffness.
                if diagonal > 0.0 {
                    ENLARGED * diagonal
                } else {
                    1.0
                }
            });
            if let Some(slot) = self.matrix.slot(node as u32, node as u32) {
                self.matrix.add(slot, &Mat3::from_diagonal(&enlarged));
            }
        }
        self.factor
            .factorize(&self.matrix, &self.mass, 0.0, 1.0, None)?;
        coarse.panels.refresh(&self.factor)?;
        for (to, arm) in coarse.arm.iter_mut().zip(&self.arm) {
            *to = to_node(arm);
        }
        Ok(())
    }

    /// Adds the part of the coarse matrix that comes from the row of `node`.
    fn add_row(&mut self, node: usize, step: &StepMatrix<'_>) {
        self.row.clear();
        for (other, block) in step.stiffness.free_blocks(node) {
            let block = step.block(node, other, block, 0.0);
            let turned = block * -self.arm[other].cross_matrix();
            let patch = self.patch[other];
            match self.row.iter_mut().find(|(there, ..)| *there == patch) {
                Some((_, translations, turns)) => {
                    *translations += block;
                    *turns += turned;
                }
                None => self.row.push((patch, block, turned)),
            }
        }
        let arm = self.arm[node].cross_matrix();
        let patch = self.patch[node];
        for &(other, translations, turns) in &self.row {
            // The two columns of a patch are neighbours in each row.
            let rows = [
                (2 * patch, translations, turns),
                (2 * patch + 1, arm * translations, arm * turns),
            ];
            for (row, left, right) in rows {
                if let Some(slot) = self.matrix.slot(row, 2 * other) {
                    self.matrix.add(slot, &left);
                    self.matrix.add(slot + 1, &right);
                }
            }
        }
    }

    /// The cost of the factorization, without the assembly of the coarse matrix.
    pub(crate) fn cost(&self) -> Cost {
        self.factor.cost()
    }

    /// Memory of the factorization (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.patch.as_slice())
            + size_of_val(self.centre.as_slice())
            + size_of_val(self.count.as_slice())
            + size_of_val(self.radius.as_slice())
            + size_of_val(self.arm.as_slice())
            + size_of_val(self.mass.as_slice())
            + self.row.capacity() * size_of::<(u32, Mat3, Mat3)>()
            + self.matrix.bytes()
            + self.factor.bytes()
    }
}
