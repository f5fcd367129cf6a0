//! The preconditioner of a step: one of two kinds of frozen factor, and the factorization that computes it.

use super::block_matrix::BlockMatrix;
use super::factor::Factor;
use super::incomplete::{self, Incomplete};
use super::order;
use super::panel::{self, Panels};
use super::read_ahead::Share;
use super::sparse_cholesky::FactorCode;
use super::step_matrix::StepMatrix;
use super::supernodes::Supernodes;
use crate::Vec3;
use crate::cost::Cost;
use crate::error::CondenseError;
use crate::lanes::{Node, to_node, to_vec};
use crate::team::Team;

/// A kind of factor that preconditions steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preconditioner {
    /// The complete factor. A step takes one or two iterations. Memory grows with the power 1.4 of the number of
    /// tetrahedra.
    #[default]
    Complete,
    /// An incomplete factor with a coarse space of rigid motions of patches. A step takes ten to thirty iterations.
    /// Memory is a few hundred bytes a tetrahedron. See [`incomplete`].
    Incomplete,
}

impl Preconditioner {
    /// The order in which the free nodes of `matrix`, which are at `rest` (m), are eliminated.
    pub(crate) fn order(self, matrix: &BlockMatrix, rest: &[Vec3]) -> Vec<u32> {
        match self {
            Self::Complete => order::order(matrix, rest),
            Self::Incomplete => incomplete::order::order(matrix),
        }
    }
}

/// Memory (bytes) that the complete factor of a step matrix with the pattern of `matrix` would take, for nodes at
/// `rest` (m).
///
/// The memory consists of the factor in f64 and of two sets of panels: the set in use and the set that is refreshed
/// beside it. The function counts from the pattern alone, which takes a small fraction of the time of the
/// analysis.
pub fn complete_bytes(matrix: &BlockMatrix, rest: &[Vec3]) -> usize {
    let order = Preconditioner::Complete.order(matrix, rest);
    let supernodes = Supernodes::new(matrix, &order);
    size_of::<f64>() * supernodes.entries() + 2 * panel::bytes_of_values(&supernodes)
}

/// The largest error of a solve with a factor in 16 bits. It is the fraction of the residual that an iteration with the
/// fresh factor leaves. Blocks have some thousandths at most. Slender, stiff bars and plates have more, because their
/// softest motion is many orders of magnitude softer than the others.
const COARSE: f64 = 0.03;

/// The error of a solve with `panels` in the norm of the energy, relative to the solution. `factor` solves exactly. The
/// right-hand side has no pattern.
fn error(panels: &mut Panels, factor: &mut Factor, matrix: &StepMatrix<'_>) -> f64 {
    let free = matrix.stiffness.free();
    // The fractional parts of the multiples of the golden ratio.
    let value = |i: usize| (i as f64 * 0.618_033_988_749_895).fract() - 0.5;
    let load = |place: usize| {
        let load = Vec3::from_fn(|axis, _| value(3 * place + axis));
        matrix
            .mask
            .map_or(load, |mask| load.component_mul(&mask[place]))
    };
    let loads: Vec<Vec3> = (0..free).map(load).collect();
    let mut exact: Vec<f64> = loads
        .iter()
        .flat_map(|load| [load.x, load.y, load.z])
        .collect();
    factor.solve(&mut exact);
    let mut found: Vec<Node<f32>> = loads.iter().map(to_node).collect();
    panels.solve(&mut found);
    let exact = exact.chunks_exact(3).map(Vec3::from_column_slice);
    let (mut errors, mut energy) = (Vec::with_capacity(free), 0.0);
    for ((exact, found), load) in exact.zip(&found).zip(&loads) {
        errors.push(to_vec(found) - exact);
        energy += exact.dot(load);
    }
    let mut forces = vec![Vec3::zeros(); free];
    (matrix.product(&errors, &mut forces) / energy).sqrt()
}

/// A factor that preconditions steps.
#[derive(Clone, Debug)]
pub(crate) enum Solves {
    Complete(Panels),
    Incomplete(Incomplete),
}

impl Solves {
    /// Solves in place, in f32. `r` contains the right-hand side by places.
    pub(crate) fn solve(&mut self, team: &dyn Team, r: &mut [Node<f32>]) {
        match self {
            Self::Complete(panels) => panels.solve_with(team, r),
            Self::Incomplete(incomplete) => incomplete.solve(team, r),
        }
    }

    /// Reads a share of the numbers.
    pub(crate) fn read(&self, share: Share) {
        match self {
            Self::Complete(panels) => panels.read(share),
            Self::Incomplete(incomplete) => incomplete.read(share),
        }
    }

    /// The cost of a solve.
    pub(crate) fn cost(&self) -> Cost {
        match self {
            Self::Complete(panels) => panels.solve_cost(),
            Self::Incomplete(incomplete) => incomplete.solve_cost(),
        }
    }

    /// Memory of the factor (bytes).
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Complete(panels) => panels.bytes(),
            Self::Incomplete(incomplete) => incomplete.bytes(),
        }
    }
}

/// The factorization that computes the numbers of a [`Solves`].
#[derive(Debug)]
pub(crate) enum Factorization {
    Complete(Box<Factor>),
    Incomplete(Box<incomplete::Maker>),
}

/// The step matrix on free places, `mass_factor M + stiffness_factor K`, and the state at which it is linearized.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<'a, D> {
    pub(crate) matrix: &'a BlockMatrix,
    pub(crate) mass: &'a [f64],
    pub(crate) factors: (f64, f64),
    /// 1 if an axis is free, 0 if a support guides it.
    pub(crate) mask: Option<&'a [Vec3]>,
    /// The displacement of each place (m).
    pub(crate) d: D,
}

impl Factorization {
    /// A factorization for the free places of `matrix`, in their order, at `rest` (m); and a factor without numbers.
    pub(crate) fn new(
        kind: Preconditioner,
        matrix: &BlockMatrix,
        rest: &[Vec3],
        code: FactorCode,
    ) -> Result<(Self, Solves), CondenseError> {
        Ok(match kind {
            Preconditioner::Complete => {
                let identity: Vec<u32> = (0..matrix.free() as u32).collect();
                let factor = Factor::with_code(matrix, &identity, code)?;
                let panels = Panels::new(&factor);
                (Self::Complete(Box::new(factor)), Solves::Complete(panels))
            }
            Preconditioner::Incomplete => {
                let maker = incomplete::Maker::new(matrix, rest, code)?;
                let empty = maker.empty(matrix);
                (Self::Incomplete(Box::new(maker)), Solves::Incomplete(empty))
            }
        })
    }

    /// Computes the numbers of `solves`, which must be of the same kind.
    ///
    /// # Errors
    ///
    /// [`CondenseError`] if the matrix has another pattern or is not positive definite, or if `solves` is of the other
    /// kind.
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

    /// Replaces `solves`, which has the numbers of this factorization of `matrix`, by a factor in f32 if 16 bits are
    /// too few. Returns whether they are. This allocates memory.
    pub(crate) fn widen(&mut self, solves: &mut Solves, matrix: &StepMatrix<'_>) -> bool {
        let (Self::Complete(factor), Solves::Complete(panels)) = (self, solves) else {
            return false;
        };
        let is_coarse = panels.is_packed() && error(panels, factor, matrix) > COARSE;
        if is_coarse {
            *panels = Panels::single(factor);
        }
        is_coarse
    }

    /// The cost of [`make`](Self::make).
    pub(crate) fn cost(&self, solves: &Solves) -> Cost {
        match (self, solves) {
            (Self::Complete(factor), Solves::Complete(panels)) => {
                factor.cost() + panels.refresh_cost()
            }
            (Self::Incomplete(maker), Solves::Incomplete(incomplete)) => maker.cost(incomplete),
            _ => Cost::default(),
        }
    }

    /// Memory of the factorization (bytes).
    pub(crate) fn bytes(&self) -> usize {
        match self {
            Self::Complete(factor) => factor.bytes(),
            Self::Incomplete(maker) => maker.bytes(),
        }
    }
}
