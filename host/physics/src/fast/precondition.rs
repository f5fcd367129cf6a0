//! What preconditions a step: one of two kinds of frozen factor, and what makes its numbers.

use super::cost::Cost;
use super::factor::Factor;
use super::incomplete::{self, Incomplete};
use super::panel::{self, Panels};
use super::supernodes::Supernodes;
use super::{Node, order};
use crate::Vec3;
use crate::fem::cholesky::Kernels;
use crate::fem::{BlockMatrix, Body, CondenseError};

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
    /// The order in which it eliminates the free nodes of `body`.
    pub(super) fn order(self, body: &Body) -> Vec<u32> {
        match self {
            Self::Complete => order::order(&body.stiffness, &body.rest),
            Self::Incomplete => incomplete::order::order(&body.stiffness),
        }
    }
}

/// Memory that the complete factor of `body`'s step matrix would take (bytes): its numbers in f64, and its panels in f32
/// twice, those that steps use and those made beside them. Counted from the pattern, at a small part of the time that
/// setting it up takes.
pub fn complete_bytes(body: &Body) -> usize {
    let order = Preconditioner::Complete.order(body);
    let supernodes = Supernodes::new(&body.stiffness, &order);
    size_of::<f64>() * supernodes.entries() + 2 * panel::bytes_of_values(&supernodes)
}

/// A factor that steps solve with.
#[derive(Clone, Debug)]
pub(super) enum Solves {
    Complete(Panels),
    Incomplete(Incomplete),
}

impl Solves {
    /// Solves in place, in f32: `r` holds the right-hand side by places.
    pub(super) fn solve(&mut self, r: &mut [Node<f32>]) {
        match self {
            Self::Complete(panels) => panels.solve(r),
            Self::Incomplete(incomplete) => incomplete.solve(r),
        }
    }

    /// What a solve costs.
    pub(super) fn cost(&self) -> Cost {
        match self {
            Self::Complete(panels) => panels.solve_cost(),
            Self::Incomplete(incomplete) => incomplete.solve_cost(),
        }
    }

    /// Memory that it holds (bytes).
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Complete(panels) => panels.bytes(),
            Self::Incomplete(incomplete) => incomplete.bytes(),
        }
    }
}

/// What makes the numbers of a factor.
#[derive(Debug)]
pub(super) enum Makes {
    Complete(Box<Factor>),
    Incomplete(Box<incomplete::Maker>),
}

/// The step matrix on free places, `mass_factor M + stiffness_factor K`, and where it is linearized.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step<'a, D> {
    pub(super) matrix: &'a BlockMatrix,
    pub(super) mass: &'a [f64],
    pub(super) factors: (f64, f64),
    /// 1 where an axis is free, 0 where a support guides it.
    pub(super) mask: Option<&'a [Vec3]>,
    /// The displacement of each place (m).
    pub(super) d: D,
}

impl Makes {
    /// For the free places of `matrix`, all in their order, at `rest` (m); and a factor without numbers.
    pub(super) fn new(
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
    pub(super) fn make(
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
    pub(super) fn cost(&self, solves: &Solves) -> Cost {
        match (self, solves) {
            (Self::Complete(factor), Solves::Complete(panels)) => {
                factor.cost() + panels.refresh_cost()
            }
            (Self::Incomplete(maker), Solves::Incomplete(incomplete)) => maker.cost(incomplete),
            _ => Cost::default(),
        }
    }

    /// Memory that it holds (bytes).
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Complete(factor) => factor.bytes(),
            Self::Incomplete(maker) => maker.bytes(),
        }
    }
}
