//! A new factor beside the steps: all that it takes, in one piece that may go to another thread.
//!
//! A factorization takes many times as long as a step. So a [`Refresher`] is told where the body is
//! ([`Stepper::lend`](crate::Stepper::lend)), works on its own copies for as long as it takes, and is given back.
//! Between the two the stepper goes on with the factor that it has: a somewhat older factor costs an iteration or
//! two, never correctness.

use crate::Vec3;
use crate::cost::Cost;
use crate::element::kernel::Kernel;
use crate::error::CondenseError;
use crate::lanes::{Node, Real, to_vec};
use crate::linear::block_matrix::BlockMatrix;
use crate::linear::precondition::{Makes, Preconditioner, Solves, Step};
use crate::linear::sparse_cholesky::FactorCode;

/// What makes a factor.
#[derive(Debug)]
pub struct Refresher<T> {
    /// The epoch of the body for which it is made.
    pub(crate) epoch: u64,
    kernels: Vec<Box<dyn Kernel<T>>>,
    matrix: BlockMatrix,
    makes: Makes,
    made: Solves,
    /// Whether `made` is that of `factors`.
    done: bool,
    factors: (f64, f64),
    d: Vec<Node<T>>,
    force: Vec<Node<T>>,
    mass: Vec<f64>,
    guided: Vec<Vec3>,
}

impl<T: Real> Refresher<T> {
    /// For the free places of `matrix`, all in their order, at `rest` (m); `guided` is 1 where an axis of one is free,
    /// 0 where a support guides it, and empty without supports. `code` is what factorizes.
    pub(crate) fn new(
        kernels: Vec<Box<dyn Kernel<T>>>,
        matrix: BlockMatrix,
        rest: &[Vec3],
        mass: Vec<f64>,
        guided: Vec<Vec3>,
        (kind, code): (Preconditioner, FactorCode),
        epoch: u64,
    ) -> Result<Self, CondenseError> {
        let (makes, made) = Makes::new(kind, &matrix, rest, code)?;
        let zeros = vec![[T::ZERO; 4]; matrix.nodes()];
        Ok(Self {
            epoch,
            kernels,
            makes,
            made,
            done: false,
            factors: (0.0, 0.0),
            d: zeros.clone(),
            force: zeros,
            matrix,
            mass,
            guided,
        })
    }

    /// What the factorization and, of a complete factor, the panels cost.
    pub(crate) fn cost(&self) -> Cost {
        Cost::read(self.matrix.bytes()) + self.makes.cost(&self.made)
    }

    /// Memory that it holds (bytes).
    pub fn bytes(&self) -> usize {
        let kernels: usize = self.kernels.iter().map(|kernel| kernel.bytes()).sum();
        size_of::<Self>()
            + kernels
            + self.matrix.bytes()
            + self.makes.bytes()
            + self.made.bytes()
            + size_of_val(self.d.as_slice())
            + size_of_val(self.force.as_slice())
            + size_of_val(self.mass.as_slice())
            + size_of_val(self.guided.as_slice())
    }

    /// A factor like those that it makes, of nothing yet.
    pub(crate) fn like_made(&self) -> Solves {
        self.made.clone()
    }

    /// Where the next factor is to be made, and of which multiples of mass and stiffness.
    pub(crate) fn load(&mut self, d: &[Node<T>], factors: (f64, f64)) {
        self.d.copy_from_slice(d);
        self.factors = factors;
        self.done = false;
    }

    /// Makes the factor; many times as long as a step. Does not allocate.
    ///
    /// # Errors
    ///
    /// [`CondenseError::NotPositiveDefinite`]; there is nothing to take then.
    pub fn work(&mut self) -> Result<(), CondenseError> {
        self.matrix.clear();
        self.force.fill([T::ZERO; 4]);
        for kernel in &mut self.kernels {
            kernel.linearize(&self.d, &mut self.force);
            kernel.add_to(&mut self.matrix);
        }
        let d = &self.d;
        let step = Step {
            matrix: &self.matrix,
            mass: &self.mass,
            factors: self.factors,
            mask: (!self.guided.is_empty()).then_some(self.guided.as_slice()),
            d: |place| to_vec(&d[place]),
        };
        self.makes.make(&mut self.made, &step)?;
        self.done = true;
        Ok(())
    }

    /// Exchanges the factor made, if it is, for `solves`; returns the factors for which it is.
    pub(crate) fn exchange(&mut self, solves: &mut Solves) -> Option<(f64, f64)> {
        if !self.done {
            return None;
        }
        core::mem::swap(&mut self.made, solves);
        self.done = false;
        Some(self.factors)
    }
}
