//! A new factor, made in parallel with the steps: all data for this in one value that may move to another thread.
//!
//! A factorization takes many times as long as a step. For this reason a [`Refresher`] receives the state of the body
//! ([`Stepper::lend`](crate::Stepper::lend)), works on its own copies and is given back afterwards. In the meantime the
//! stepper continues with its present factor. An older factor costs an iteration or two, but never correctness.

use crate::Vec3;
use crate::cost::Cost;
use crate::element::kernel::Kernel;
use crate::element::precision::Precision;
use crate::error::CondenseError;
use crate::lanes::{Node, to_vec};
use crate::linear::block_matrix::BlockMatrix;
use crate::linear::precondition::{Factorization, Preconditioner, Solves, Step};
use crate::linear::read_ahead::Share;
use crate::linear::sparse_cholesky::FactorCode;
use crate::linear::step_matrix::StepMatrix;
use crate::motion::constraint::tangent::{self, Tangent};

/// Time over which a new factor is read ahead (s): a fraction of the time that makes the factor, so that the factor is
/// hardly older when a step takes it. Between longer steps, caches lose what was read ahead, and a factor that is a step
/// older may take an iteration more.
const READING: f64 = 2e-3;

/// The data and the working memory of a factorization.
#[derive(Debug)]
pub struct Refresher<T> {
    /// The topology epoch of the body for which the refresher is made.
    pub(crate) epoch: u64,
    kernels: Vec<Box<dyn Kernel<T>>>,
    matrix: BlockMatrix,
    factorization: Factorization,
    made: Solves,
    /// Whether `made` is the factor for `factors`.
    done: bool,
    /// Number of parts of `made` that have been read ahead.
    read: usize,
    factors: (f64, f64),
    d: Vec<Node<T>>,
    force: Vec<Node<T>>,
    mass: Vec<f64>,
    guided: Vec<Vec3>,
    /// The contacts in the next factor, over places.
    contacts: Vec<Tangent>,
}

impl<T: Precision> Refresher<T> {
    /// Makes a refresher for the free places of `matrix`, in their order, with all places at `rest` (m). `guided` is 1
    /// if an axis of a place is free and 0 if a support guides the axis; it is empty without supports. `code` is
    /// the code of the factorization.
    pub(crate) fn new(
        kernels: Vec<Box<dyn Kernel<T>>>,
        matrix: BlockMatrix,
        rest: &[Vec3],
        mass: Vec<f64>,
        guided: Vec<Vec3>,
        (kind, code): (Preconditioner, FactorCode),
        epoch: u64,
    ) -> Result<Self, CondenseError> {
        let (factorization, made) = Factorization::new(kind, &matrix, rest, code)?;
        let zeros = vec![[T::ZERO; 4]; matrix.nodes()];
        Ok(Self {
            epoch,
            kernels,
            factorization,
            made,
            done: false,
            read: 0,
            factors: (0.0, 0.0),
            d: zeros.clone(),
            force: zeros,
            matrix,
            mass,
            guided,
            contacts: Vec::new(),
        })
    }

    /// The cost of the factorization and, for a complete factor, of the panels.
    pub(crate) fn cost(&self) -> Cost {
        Cost::read(self.matrix.bytes()) + self.factorization.cost(&self.made)
    }

    /// Memory of the refresher (bytes).
    pub fn bytes(&self) -> usize {
        let kernels: usize = self.kernels.iter().map(|kernel| kernel.bytes()).sum();
        size_of::<Self>()
            + kernels
            + self.matrix.bytes()
            + self.factorization.bytes()
            + self.made.bytes()
            + size_of_val(self.d.as_slice())
            + size_of_val(self.force.as_slice())
            + size_of_val(self.mass.as_slice())
            + size_of_val(self.guided.as_slice())
    }

    /// A factor of the same kind as those that the refresher makes, without values yet.
    pub(crate) fn like_made(&self) -> Solves {
        self.made.clone()
    }

    /// Sets the state of the next factor, and the factors of mass and stiffness in its matrix. The state is given by the
    /// displacements (m) at all places, the number of free places, and the first held place.
    pub(crate) fn load(
        &mut self,
        (d, free, held): (&[Node<T>], usize, usize),
        factors: (f64, f64),
    ) {
        self.d[..free].copy_from_slice(&d[..free]);
        self.d[free..].copy_from_slice(&d[held..]);
        self.factors = factors;
        self.done = false;
        self.read = 0;
    }

    /// Sets the contacts in the next factor. `place` gives the place of each node.
    pub(crate) fn load_contacts(&mut self, contacts: &[Tangent], place: &[u32]) {
        self.contacts.clear();
        self.contacts
            .extend(contacts.iter().map(|contact| contact.renumbered(place)));
    }

    /// The displacements (m) that were loaded: those of the free places, then those of the held places.
    pub(crate) fn state(&self) -> &[Node<T>] {
        &self.d
    }

    /// Makes the factor. This takes many times as long as a step and does not allocate memory.
    ///
    /// # Errors
    ///
    /// [`CondenseError::NotPositiveDefinite`]; there is no factor to take then.
    #[inline(never)]
    pub fn work(&mut self) -> Result<(), CondenseError> {
        self.matrix.clear();
        self.force.fill([T::ZERO; 4]);
        for kernel in &mut self.kernels {
            kernel.linearize(&self.d, &mut self.force);
            kernel.add_to(&mut self.matrix);
        }
        // The matrix of the step has the elements times this factor, and the contacts as they are.
        tangent::assemble(&self.contacts, self.factors.1.recip(), &mut self.matrix);
        let d = &self.d;
        let step = Step {
            matrix: &self.matrix,
            mass: &self.mass,
            factors: self.factors,
            mask: (!self.guided.is_empty()).then_some(self.guided.as_slice()),
            d: |place| to_vec(&d[place]),
        };
        self.factorization.make(&mut self.made, &step)?;
        self.done = true;
        Ok(())
    }

    /// Number of parts in which a factor is read ahead beside steps of `h` seconds, a part after each step; 0 if a
    /// step takes a new factor at once.
    pub fn parts(h: f64) -> usize {
        // The quotient may be a rounding error below a whole number.
        (READING / h + 1e-6) as usize
    }

    /// Reads the next of `parts` parts of the new factor. Returns whether nothing is left to read; without a new factor,
    /// nothing is.
    ///
    /// The caches of the core that made the factor hold its numbers. The first step that solves with these numbers on
    /// another core would wait for all of them. Calls of this function after the steps before, on the thread of the
    /// steps, share this wait among those steps. The results do not depend on these calls.
    #[inline(never)]
    pub fn read_ahead(&mut self, parts: usize) -> bool {
        if self.done && self.read < parts {
            let part = self.read;
            self.made.read(Share { part, parts });
            self.read += 1;
        }
        !self.done || self.read >= parts
    }

    /// Replaces `solves`, the first factor, and those to come by factors in f32 if 16 bits are too few. This allocates
    /// memory.
    pub(crate) fn widen(&mut self, solves: &mut Solves) {
        let matrix = StepMatrix {
            stiffness: &self.matrix,
            mass: &self.mass,
            mass_factor: self.factors.0,
            stiffness_factor: self.factors.1,
            mask: (!self.guided.is_empty()).then_some(self.guided.as_slice()),
        };
        if self.factorization.widen(solves, &matrix) {
            self.made = solves.clone();
        }
    }

    /// Exchanges the new factor, if there is one, for `solves`. Returns the factors of mass and stiffness in its
    /// matrix.
    pub(crate) fn exchange(&mut self, solves: &mut Solves) -> Option<(f64, f64)> {
        if !self.done {
            return None;
        }
        core::mem::swap(&mut self.made, solves);
        self.done = false;
        Some(self.factors)
    }
}
