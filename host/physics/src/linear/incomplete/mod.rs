//! A preconditioner with memory proportional to the mesh: an incomplete factor and a coarse space of rigid motions.
//!
//! The memory of the complete factor ([`crate::linear::factor`]) grows with the power 1.4 of the number of tetrahedra,
//! and the time of a solve with the memory. The preconditioner of this module is the sum of two cheap parts.
//! [`Blocks`], an incomplete factor with the pattern of the matrix, reduces errors that vary from node to node.
//! `coarse`, a complete factor of the matrix on the rigid motions of patches of some sixty nodes, reduces errors that
//! move whole patches. With the first part alone the number of iterations is proportional to the number of nodes along
//! an edge. With both parts it hardly grows (R. A. Nicolaides, "Deflation of conjugate gradients with applications to
//! boundary value problems", 1987; P. Vanek, J. Mandel and M. Brezina, "Algebraic multigrid by smoothed aggregation for
//! second and fourth order elliptic problems", 1996, for rigid motions).
//!
//! Cubes of 20, 64 and 197 thousand tetrahedra took 38, 55 and 78 iterations from a cold start to 1e-6 with the
//! incomplete factor alone, and 23, 26 and 27 with both parts. The natural and the reverse Cuthill-McKee order take the
//! same number of iterations, nested dissection a tenth to a sixth more. [`order`] computes the reverse Cuthill-McKee
//! order, which does not depend on the numbering of the mesh.
//!
//! Thin sheets gain less: 40, 64 and 106 iterations for 1.5, 7 and 29 thousand triangles with bending. The softest
//! motions of such a sheet bend whole patches. The complete factor of a sheet is small.
//!
//! A coarse correction before and after the factor instead of beside it ("balancing") takes 15, 16 and 16 iterations.
//! Each iteration then has a second coarse solve and two more products. A prototype took the same time, and two thirds
//! more memory for the factor.

pub mod aggregates;
mod blocks;
mod coarse;
pub mod order;
mod sweep;

pub use blocks::Blocks;

use super::block_matrix::BlockMatrix;
use super::read_ahead::Share;
use super::sparse_cholesky::FactorCode;
use super::step_matrix::StepMatrix;
use crate::Vec3;
use crate::cost::Cost;
use crate::error::CondenseError;
use crate::lanes::Node;
use crate::team::Team;
use coarse::{Coarse, CoarseMaker};

/// The incomplete factor and the coarse space.
#[derive(Clone, Debug)]
pub struct Incomplete {
    blocks: Blocks,
    coarse: Coarse,
}

impl Incomplete {
    /// Applies the preconditioner in place to `r`, the residual by places. The two parts are computed beside each
    /// other.
    pub(crate) fn solve(&mut self, team: &dyn Team, r: &mut [Node<f32>]) {
        let Self { blocks, coarse } = self;
        coarse.gather(r);
        team.join(&mut || coarse.solve(team), &mut || blocks.solve(r));
        coarse.add_to(r);
    }

    /// Reads a share of the numbers.
    pub(crate) fn read(&self, share: Share) {
        self.blocks.read(share);
        self.coarse.read(share);
    }

    /// The cost of a solve.
    pub(crate) fn solve_cost(&self) -> Cost {
        self.blocks.solve_cost() + self.coarse.solve_cost()
    }

    /// Memory of both parts (bytes).
    pub(crate) fn bytes(&self) -> usize {
        self.blocks.bytes() + self.coarse.bytes()
    }
}

/// The factorization that computes the numbers of an [`Incomplete`].
#[derive(Debug)]
pub(crate) struct Maker {
    coarse: CoarseMaker,
    rest: Vec<Vec3>,
}

impl Maker {
    /// A factorization for the free places of `matrix` at `rest` (m).
    pub(crate) fn new(
        matrix: &BlockMatrix,
        rest: &[Vec3],
        code: FactorCode,
    ) -> Result<Self, CondenseError> {
        Ok(Self {
            coarse: CoarseMaker::new(matrix, rest, code)?,
            rest: rest[..matrix.free()].to_vec(),
        })
    }

    /// A preconditioner without numbers.
    pub(crate) fn empty(&self, matrix: &BlockMatrix) -> Incomplete {
        Incomplete {
            blocks: Blocks::new(matrix),
            coarse: self.coarse.empty(),
        }
    }

    /// Computes the numbers of `made` with the places displaced by `d` (m). See [`Blocks::factorize`] for the other
    /// arguments and the errors.
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

    /// The cost of the numbers of `made`.
    pub(crate) fn cost(&self, made: &Incomplete) -> Cost {
        made.blocks.factorize_cost() + self.coarse.cost()
    }

    /// Memory of the factorization (bytes).
    pub(crate) fn bytes(&self) -> usize {
        self.coarse.bytes() + size_of_val(self.rest.as_slice())
    }
}
