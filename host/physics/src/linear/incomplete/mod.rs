//! A preconditioner whose memory grows as the mesh does: an incomplete factor, and rigid motions of patches.
//!
//! The complete factor of [`crate::linear::factor`] fills up: its memory grows with the power 1.4 of the number of tetrahedra,
//! and its time with it. Here two cheap parts are added up. [`Blocks`], an incomplete factor with the pattern of the
//! matrix, takes what changes from node to node; `coarse`, a complete factor of the matrix on the rigid motions of
//! patches of some sixty nodes, takes what moves whole patches. The first alone would need iterations in proportion to
//! the nodes along an edge; with the second their number hardly grows (R. A. Nicolaides, "Deflation of conjugate
//! gradients with applications to boundary value problems", 1987; P. Vanek, J. Mandel and M. Brezina, "Algebraic
//! multigrid by smoothed aggregation for second and fourth order elliptic problems", 1996, for rigid motions).
//!
//! Measured on cubes of 20, 64 and 197 thousand tetrahedra from a cold start to 1e-6: 38, 55 and 78 iterations with the
//! incomplete factor alone, 23, 26 and 27 with both. Natural and reverse Cuthill-McKee orders take the same number,
//! nested dissection a tenth to a sixth more: [`order`] makes the second, which does not depend on how the mesh was numbered.
//!
//! Thin sheets gain less: 40, 64 and 106 iterations for 1.5, 7 and 29 thousand triangles with bending, whose softest
//! motions are bends of whole patches. Their complete factors are small, too.
//!
//! Correcting once before and once after the factor instead of beside it ("balancing") takes 15, 16 and 16 iterations,
//! with a second coarse solve and two more products in each: a prototype took as long, and two thirds more memory for
//! the factor.

pub mod aggregates;
mod blocks;
mod coarse;
pub mod order;
mod sweep;

pub use blocks::Blocks;

use super::block_matrix::BlockMatrix;
use super::sparse_cholesky::Kernels;
use super::step_matrix::StepMatrix;
use crate::Vec3;
use crate::cost::Cost;
use crate::error::CondenseError;
use crate::lanes::Node;
use coarse::{Coarse, CoarseMaker};

/// The incomplete factor and the patches.
#[derive(Clone, Debug)]
pub struct Incomplete {
    blocks: Blocks,
    coarse: Coarse,
}

impl Incomplete {
    /// Solves roughly and in place: `r` holds the right-hand side by places and becomes what it is multiplied into.
    pub(crate) fn solve(&mut self, r: &mut [Node<f32>]) {
        self.coarse.gather(r);
        self.blocks.solve(r);
        self.coarse.add_to(r);
    }

    /// What a solve costs.
    pub(crate) fn solve_cost(&self) -> Cost {
        self.blocks.solve_cost() + self.coarse.solve_cost()
    }

    /// Memory that it holds (bytes).
    pub(crate) fn bytes(&self) -> usize {
        self.blocks.bytes() + self.coarse.bytes()
    }
}

/// What makes the numbers of an [`Incomplete`].
#[derive(Debug)]
pub(crate) struct Maker {
    coarse: CoarseMaker,
    rest: Vec<Vec3>,
}

impl Maker {
    /// For the free places of `matrix` at `rest` (m).
    pub(crate) fn new(
        matrix: &BlockMatrix,
        rest: &[Vec3],
        kernels: Kernels,
    ) -> Result<Self, CondenseError> {
        Ok(Self {
            coarse: CoarseMaker::new(matrix, rest, kernels)?,
            rest: rest[..matrix.free()].to_vec(),
        })
    }

    /// One without numbers.
    pub(crate) fn empty(&self, matrix: &BlockMatrix) -> Incomplete {
        Incomplete {
            blocks: Blocks::new(matrix),
            coarse: self.coarse.empty(),
        }
    }

    /// Makes the numbers of `made`, where the places are displaced by `d` (m). See
    /// [`Blocks::factorize`] for the rest.
    pub(crate) fn make(
        &mut self,
        made: &mut Incomplete,
        d: impl Fn(usize) -> Vec3,
        matrix: &BlockMatrix,
        mass: &[f64],
        (mass_factor, stiffness_factor): (f64, f64),
        mask: Option<&[Vec3]>,
    ) -> Result<(), CondenseError> {
        made.blocks
            .factorize(matrix, mass, mass_factor, stiffness_factor, mask)?;
        let step = StepMatrix {
            stiffness: matrix,
            mass,
            mass_factor,
            stiffness_factor,
            mask,
        };
        let rest = &self.rest;
        let at = |place: usize| rest[place] + d(place);
        self.coarse.make(&mut made.coarse, at, &step)
    }

    /// What the numbers of `made` cost.
    pub(crate) fn cost(&self, made: &Incomplete) -> Cost {
        made.blocks.factorize_cost() + self.coarse.cost()
    }

    /// Memory that it holds (bytes).
    pub(crate) fn bytes(&self) -> usize {
        self.coarse.bytes() + size_of_val(self.rest.as_slice())
    }
}
