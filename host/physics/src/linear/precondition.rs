//! What preconditions a step: one of two kinds of frozen factor, and what makes its numbers.

use super::block_matrix::BlockMatrix;
use super::factor::Factor;
use super::incomplete::{self, Incomplete};
use super::order;
use super::panel::{self, Panels};
use super::sparse_cholesky::Kernels;
use super::supernodes::Supernodes;
use crate::Vec3;
use crate::cost::Cost;
use crate::error::CondenseError;
use crate::lanes::Node;

/// A kind of factor that preconditions steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preconditioner {
    /// The complete one: an iteration or two a step, and memory that grows with the power 1.4 of the number of
    /// tetrahedra.
    #[default]
    Complete,
    /// An incomplete one with the motions of patches: some ten to thirty iterations a step, a few hundred bytes a
    /// tetrahedron. See [`incomplete`].
    Incomplete,
}

impl Preconditioner {
    /// The order in which it eliminates the free nodes of `matrix`, which are at `rest` (m).
    pub(crate) fn order(self, matrix: &BlockMatrix, rest: &[Vec3]) -> Vec<u32> {
        match self {
            Self::Complete => order::order(matrix, rest),
            Self::Incomplete => incomplete::order::order(matrix),
        }
    }
}

/// Memory that the complete factor of a step matrix with the pattern of `matrix` would take (bytes), for nodes at `rest`
/// (m): its numbers in f64, and its panels in f32 twice, those that steps use and those made beside them. Counted from
/// the pattern, at a small part of the time that setting it up takes.
pub fn complete_bytes(matrix: &BlockMatrix, rest: &[Vec3]) -> usize {
    let order = Preconditioner::Complete.order(matrix, rest);
    let supernodes = Supernodes::new(matrix, &order);
    size_of::<f64>() * supernodes.entries() + 2 * panel::bytes_of_values(&supernodes)
}

/// A factor that steps solve with.
#[derive(Clone, Debug)]
pub(crate) enum Solves {
    Complete(Panels),
    Incomplete(Incomplete),
}

impl Solves {
    /// Solves in place, in f32: `r` holds the right-hand side by places.
    pub(crate) fn solve(&mut self, r: &mut [Node<f32>]) {
        match self {
            Self::Complete(panels) => panels.solve(r),
            Self::Incomplete(incomplete) => incomplete.solve(r),
        }
    }

    /// What a solve costs.
    pub(crate) fn cost(&self) -> Cost {
        match self {
            Self::Complete(panels) => panels.solve_cost(),
            Self::Incomplete(incomplete) => incomplete.solve_cost(),
        }
    }

    /// Memory that it holds (bytes).
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Complete(panels) => panels.bytes(),
            Self::Incomplete(incomplete) => incomplete.bytes(),
        }
    }
}

/// What makes the numbers of a factor.
#[derive(Debug)]
pub(crate) enum Makes {
    Complete(Box<Factor>),
    Incomplete(Box<incomplete::Maker>),
}

/// The step matrix on free places, `mass_factor M + stiffness_factor K`, and where it is linearized.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<'a, D> {
    pub(crate) matrix: &'a BlockMatrix,
    pub(crate) mass: &'a [f64],
    pub(crate) factors: (f64, f64),
    /// 1 where an axis is free, 0 where a support guides it.
    pub(crate) mask: Option<&'a [Vec3]>,
    /// The displacement of each place (m).
    pub(crate) d: D,
}

impl Makes {
    /// For the free places of `matrix`, all in their order, at `rest` (m); and a factor without numbers.
    pub(crate) fn new(
        kind: Preconditioner,
        matrix: &BlockMatrix,
        rest: &[Vec3],
        kernels: Kernels,
    ) -> Result<(Self, Solves), CondenseError> {
        Ok(match kind {
            Preconditioner::Complete => {
                let identity: Vec<u32> = (0..matrix.free() as u32).collect();
                let factor = Factor::with_kernels(matrix, &identity, kernels)?;
                let panels = Panels::new(&factor);
                (Self::Complete(Box::new(factor)), Solves::Complete(panels))
            }
            Preconditioner::Incomplete => {
                let maker = incomplete::Maker::new(matrix, rest, kernels)?;
                let empty = maker.empty(matrix);
                (Self::Incomplete(Box::new(maker)), Solves::Incomplete(empty))
            }
        })
    }

    /// Makes the numbers of `solves`, which must be of its kind.
    pub(crate) fn make(
        &mut self,
        solves: &mut Solves,
        step: &Step<'_, impl Fn(usize) -> Vec3>,
    ) -> Result<(), CondenseError> {
        let Step {
            matrix,
            mass,
            factors,
            mask,
            d,
        } = step;
        match (self, solves) {
            (Self::Complete(factor), Solves::Complete(panels)) => {
                factor.factorize(matrix, mass, factors.0, factors.1, *mask)?;
                panels.refresh(factor)
            }
            (Self::Incomplete(maker), Solves::Incomplete(incomplete)) => {
                maker.make(incomplete, d, matrix, mass, *factors, *mask)
            }
            _ => Err(CondenseError::Topology),
        }
    }

    /// What that costs.
    pub(crate) fn cost(&self, solves: &Solves) -> Cost {
        match (self, solves) {
            (Self::Complete(factor), Solves::Complete(panels)) => {
                factor.cost() + panels.refresh_cost()
            }
            (Self::Incomplete(maker), Solves::Incomplete(incomplete)) => maker.cost(incomplete),
            _ => Cost::default(),
        }
    }

    /// Memory that it holds (bytes).
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Complete(factor) => factor.bytes(),
            Self::Incomplete(maker) => maker.bytes(),
        }
    }
}
