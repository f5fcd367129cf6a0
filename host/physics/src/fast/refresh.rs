//! A new factor beside the steps: all that it takes, in one piece that may go to another thread.
//!
//! A factorization takes many times as long as a step. So a [`Refresher`] is told where the body is
//! ([`Stepper::lend`](super::Stepper::lend)), works on its own copies for as long as it takes, and is given back.
//! Between the two the stepper goes on with the factor that it has: a somewhat older factor costs an iteration or
//! two, never correctness.

use super::cost::Cost;
use super::factor::Factor;
use super::kernel::Kernel;
use super::panel::Panels;
use super::{Node, Real};
use crate::Vec3;
use crate::fem::cholesky::Kernels;
use crate::fem::{BlockMatrix, CondenseError};

/// What makes a factor.
#[derive(Debug)]
pub struct Refresher<T> {
    kernels: Vec<Box<dyn Kernel<T>>>,
    matrix: BlockMatrix,
    factor: Factor,
    panels: Panels,
    /// Whether `panels` are those of `factors`.
    done: bool,
    factors: (f64, f64),
    d: Vec<Node<T>>,
    force: Vec<Node<T>>,
    mass: Vec<f64>,
    guided: Vec<Vec3>,
}

impl<T: Real> Refresher<T> {
    /// For the free places of `matrix`, all in their order; `guided` is 1 where an axis of one is free, 0 where a
    /// support guides it, and empty without supports. `code` is what factorizes.
    pub(super) fn new(
        kernels: Vec<Box<dyn Kernel<T>>>,
        matrix: BlockMatrix,
        mass: Vec<f64>,
        guided: Vec<Vec3>,
        code: Kernels,
    ) -> Result<Self, CondenseError> {
        let identity: Vec<u32> = (0..matrix.free() as u32).collect();
        let factor = Factor::with_kernels(&matrix, &identity, code)?;
        let panels = Panels::new(&factor);
        let zeros = vec![[T::ZERO; 4]; matrix.nodes()];
        Ok(Self {
            kernels,
            factor,
            panels,
            done: false,
            factors: (0.0, 0.0),
            d: zeros.clone(),
            force: zeros,
            matrix,
            mass,
            guided,
        })
    }

    /// What the factorization and the panels cost.
    pub(super) fn cost(&self) -> Cost {
        Cost::read(self.matrix.bytes()) + self.factor.cost() + self.panels.refresh_cost()
    }

    /// Memory that it holds (bytes).
    pub fn bytes(&self) -> usize {
        let kernels: usize = self.kernels.iter().map(|kernel| kernel.bytes()).sum();
        size_of::<Self>()
            + kernels
            + self.matrix.bytes()
            + self.factor.bytes()
            + self.panels.bytes()
            + size_of_val(self.d.as_slice())
            + size_of_val(self.force.as_slice())
            + size_of_val(self.mass.as_slice())
            + size_of_val(self.guided.as_slice())
    }

    /// Panels like those that it makes, of nothing yet.
    pub(super) fn panels(&self) -> Panels {
        self.panels.clone()
    }

    /// Where the next factor is to be made, and of which multiples of mass and stiffness.
    pub(super) fn load(&mut self, d: &[Node<T>], factors: (f64, f64)) {
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
        let (mass_factor, stiffness_factor) = self.factors;
        let mask = (!self.guided.is_empty()).then_some(self.guided.as_slice());
        self.factor.factorize(
            &self.matrix,
            &self.mass,
            mass_factor,
            stiffness_factor,
            mask,
        )?;
        self.panels.refresh(&self.factor)?;
        self.done = true;
        Ok(())
    }

    /// Exchanges the panels made, if they are, for `panels`; returns the factors for which they are.
    pub(super) fn exchange(&mut self, panels: &mut Panels) -> Option<(f64, f64)> {
        if !self.done {
            return None;
        }
        core::mem::swap(&mut self.panels, panels);
        self.done = false;
        Some(self.factors)
    }
}
