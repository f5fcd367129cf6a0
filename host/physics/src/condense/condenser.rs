//! What the hands feel of a body, as small dense matrices between handles.
//!
//! With `A = M / t^2 + C / t + K` at the publication period `t`, split into free and handle nodes, and the
//! basis `S` of the handles' motions, the body follows the hands by `Psi = [S; -A_ff^-1 A_fh S]`. The
//! published matrices are the stiffness and damping of those shapes, `Psi^T K Psi` and `Psi^T C Psi`.
//! This is Guyan's reduction ("Reduction of stiffness and mass matrices", 1965) with the dynamic stiffness
//! of the period in the place of the static one, so it exists for loose pieces and flat membranes too. It
//! is not the Schur complement of `A`: that holds `M / t^2` and `C / t` and would be felt as a spring.
//!
//! A moment is taken about the moving origin of its handle. Turning a loaded handle turns the arms at
//! which its vertices pull, which changes the moment even where every force stays: the *lever* term,
//! `d m = sum (theta x r_i) x f_i`, belongs to the stiffness. It is not symmetric, so what is published is
//! the symmetric part of both, made positive semidefinite; the raw matrices can be read beside it.
//!
//! Since `A_ff Psi_f = -A_fh S`, on the free nodes `K Psi` is a multiple of `M Psi`, and the products
//! `Psi^T K Psi` need only the handle rows of `K` and inner products with the masses.

use super::reduction::{Condensed, Reduction};
use crate::Vec3;
use crate::body::Body;
use crate::error::CondenseError;
use crate::linear::cholesky::Cholesky;
use crate::linear::sparse_cholesky::Kernels;

/// Condenses one body again and again without allocating.
#[derive(Debug)]
pub struct Condenser {
    /// The epoch of the body for which everything here is made.
    epoch: u64,
    kernels: Kernels,
    cholesky: Cholesky,
    reduction: Reduction,
}

impl Condenser {
    /// Analyzes the topology of `body` and sets all memory aside.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`].
    pub fn new(body: &Body) -> Result<Self, CondenseError> {
        Self::with_kernels(body, Kernels::default())
    }

    /// The same, with a choice of the code that factorizes.
    ///
    /// # Errors
    ///
    /// As [`Condenser::new`].
    pub fn with_kernels(body: &Body, kernels: Kernels) -> Result<Self, CondenseError> {
        let reduction = Reduction::new(body);
        Ok(Self {
            epoch: body.epoch(),
            kernels,
            cholesky: Cholesky::new(&body.assembly.stiffness, reduction.columns.len(), kernels)?,
            reduction,
        })
    }

    /// The last result; all zero before the first.
    pub fn condensed(&self) -> &Condensed {
        &self.reduction.condensed
    }

    /// The factorization of the last condensation's matrix.
    pub fn cholesky(&self) -> &Cholesky {
        &self.cholesky
    }

    /// Condenses the stiffness last assembled onto the handles where they are now, for local models
    /// published every `period` seconds.
    ///
    /// # Errors
    ///
    /// [`CondenseError`]; the last result is kept then.
    pub fn condense(&mut self, body: &Body, period: f64) -> Result<&Condensed, CondenseError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(CondenseError::Period { found: period });
        }
        let mass_factor = 1.0 / (period * period) + body.model.config.mass_damping / period;
        let stiffness_factor = 1.0 + body.model.config.stiffness_damping / period;
        self.reduce(body, (mass_factor, stiffness_factor), period)
    }

    /// Guyan's own, static condensation of the stiffness last assembled: how the body answers once it has
    /// come to rest. It replaces the last result; its damping and mass are those of the static shapes.
    ///
    /// # Errors
    ///
    /// [`CondenseError`]; where nothing but inertia holds a part of the body (a loose piece, a flat
    /// membrane), [`CondenseError::NotPositiveDefinite`].
    pub fn condense_static(&mut self, body: &Body) -> Result<&Condensed, CondenseError> {
        self.reduce(body, (0.0, 1.0), f64::INFINITY)
    }

    fn reduce(
        &mut self,
        body: &Body,
        (mass_factor, stiffness_factor): (f64, f64),
        period: f64,
    ) -> Result<&Condensed, CondenseError> {
        if !body.assembly.assembled {
            return Err(CondenseError::NotAssembled);
        }
        if self.epoch != body.epoch() {
            *self = Self::with_kernels(body, self.kernels)?;
        }
        if !self.reduction.fits(body) {
            return Err(CondenseError::Topology);
        }
        self.cholesky.factorize(
            &body.assembly.stiffness,
            &body.model.mass,
            mass_factor,
            stiffness_factor,
            body.constraints.supports.mask(),
        )?;
        self.solve_shapes(body, stiffness_factor)?;

        self.pull(body);
        Ok(self.reduction.reduce(
            body,
            mass_factor / stiffness_factor,
            period,
            &body.assembly.missed,
        ))
    }

    /// The arms, and `Psi_f = -A_ff^-1 A_fh S`.
    fn solve_shapes(&mut self, body: &Body, stiffness_factor: f64) -> Result<(), CondenseError> {
        let free = body.assembly.stiffness.free();
        self.reduction.take_arms(body);
        let Reduction {
            columns,
            holder,
            range,
            shapes,
            arms,
            ..
        } = &mut self.reduction;
        let rows = 3 * free;
        shapes.fill(0.0);
        for node in 0..free {
            for (held, block) in body.assembly.stiffness.handle_blocks(node) {
                let arm = &arms[held - free];
                for c in range[holder[held - free] as usize].clone() {
                    let force = block * columns[c].at(arm) * stiffness_factor;
                    for axis in 0..3 {
                        shapes[c * rows + 3 * node + axis] -= force[axis];
                    }
                }
            }
        }
        if let Some(mask) = body.constraints.supports.mask() {
            for column in shapes.chunks_mut(rows.max(1)) {
                for (value, free) in column.iter_mut().zip(mask.iter().flat_map(Vec3::iter)) {
                    *value *= free;
                }
            }
        }
        self.cholesky.solve(shapes);
        if shapes.iter().all(|value| value.is_finite()) {
            Ok(())
        } else {
            Err(CondenseError::NotPositiveDefinite { pivot: rows })
        }
    }

    /// `K Psi` on the held nodes.
    fn pull(&mut self, body: &Body) {
        let free = body.assembly.stiffness.free();
        let rows = 3 * free;
        let Reduction {
            columns,
            holder,
            shapes,
            pulls,
            arms,
            ..
        } = &mut self.reduction;
        for (c, column) in columns.iter().enumerate() {
            let shape = &shapes[c * rows..(c + 1) * rows];
            for held in 0..holder.len() {
                let mut force = Vec3::zeros();
                for (node, block) in body.assembly.stiffness.free_blocks(free + held) {
                    let at = 3 * node;
                    force += block * Vec3::new(shape[at], shape[at + 1], shape[at + 2]);
                }
                for (other, block) in body.assembly.stiffness.handle_blocks(free + held) {
                    if holder[other - free] as usize == column.handle {
                        force += block * column.at(&arms[other - free]);
                    }
                }
                pulls[c * holder.len() + held] = force;
            }
        }
    }
}
