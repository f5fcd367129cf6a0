//! The condensation of a body onto its handles by a factorization.
//!
//! With `A = M / t^2 + C / t + K` at the publication period `t`, split into free and handle nodes, and the
//! basis `S` of the handles' motions, the body follows the handles by the shapes `Psi = [S; -A_ff^-1 A_fh S]`. The
//! published matrices are the stiffness and damping of these shapes, `Psi^T K Psi` and `Psi^T C Psi`.
//! This is Guyan's reduction ("Reduction of stiffness and mass matrices", 1965) with the dynamic stiffness
//! of the period in place of the static stiffness, so it exists for loose pieces and flat membranes as well. It
//! is not the Schur complement of `A`, which contains `M / t^2` and `C / t`: a hand would feel these terms as a spring.
//!
//! A moment is taken about the moving origin of its handle. A turn of a loaded handle turns the arms of its vertices
//! and so changes the moment even if every force is constant. The *lever* term, `d m = sum (theta x r_i) x f_i`, is
//! part of the stiffness. It is not symmetric. The published matrices are the symmetric parts, made positive
//! semidefinite; the raw matrices are available as well.
//!
//! Since `A_ff Psi_f = -A_fh S`, on the free nodes `K Psi` is a multiple of `M Psi`, and the products
//! `Psi^T K Psi` need only the handle rows of `K` and inner products with the masses.

use super::reduction::{Condensed, Reduction};
use crate::Vec3;
use crate::body::Body;
use crate::error::CondenseError;
use crate::linear::cholesky::Cholesky;
use crate::linear::sparse_cholesky::FactorCode;

/// Condenses one body repeatedly without allocation.
#[derive(Debug)]
pub struct Condenser {
    /// The epoch of the body for which everything here is made.
    epoch: u64,
    code: FactorCode,
    cholesky: Cholesky,
    reduction: Reduction,
}

impl Condenser {
    /// Analyzes the topology of `body` and allocates all memory.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Symbolic`].
    pub fn new(body: &Body) -> Result<Self, CondenseError> {
        Self::with_code(body, FactorCode::default())
    }

    /// [`new`](Self::new) with a choice of the code of the factorization.
    ///
    /// # Errors
    ///
    /// As [`Condenser::new`].
    pub fn with_code(body: &Body, code: FactorCode) -> Result<Self, CondenseError> {
        let reduction = Reduction::new(body);
        Ok(Self {
            epoch: body.epoch(),
            code,
            cholesky: Cholesky::new(&body.assembly.stiffness, reduction.columns.len(), code)?,
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

    /// Condenses the latest assembled stiffness onto the handles at their present poses, for local models
    /// published every `period` seconds.
    ///
    /// # Errors
    ///
    /// [`CondenseError`]. The last result is then kept.
    pub fn condense(&mut self, body: &Body, period: f64) -> Result<&Condensed, CondenseError> {
        if !(period > 0.0 && period.is_finite()) {
            return Err(CondenseError::Period { found: period });
        }
        let mass_factor = 1.0 / (period * period) + body.model.config.mass_damping / period;
        let stiffness_factor = 1.0 + body.model.config.stiffness_damping / period;
        self.reduce(body, (mass_factor, stiffness_factor), period)
    }

    /// Guyan's static condensation of the latest assembled stiffness: the response of the body at rest. It replaces
    /// the last result. Its damping and mass are those of the static shapes.
    ///
    /// # Errors
    ///
    /// [`CondenseError`]. If only inertia supports a part of the body (a loose piece, a flat membrane), it is
    /// [`CondenseError::NotPositiveDefinite`].
    pub fn condense_static(&mut self, body: &Body) -> Result<&Condensed, CondenseError> {
        self.reduce(body, (0.0, 1.0), f64::INFINITY)
    }

    fn reduce(
        &mut self,
        body: &Body,
        (mass_factor, stiffness_factor): (f64, f64),
        period: f64,
    ) -> Result<&Condensed, CondenseError> {
        if body.assembly.at.is_none() {
            return Err(CondenseError::NotAssembled);
        }
        if self.epoch != body.epoch() {
            *self = Self::with_code(body, self.code)?;
        }
        if !self.reduction.fits(body) {
            return Err(CondenseError::Topology);
        }
        self.cholesky.factorize(
            &body.assembly.stiffness,
            &body.assembly.mass,
            mass_factor,
            stiffness_factor,
            body.assembly.mask(),
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

    /// Computes the arms and `Psi_f = -A_ff^-1 A_fh S`.
    fn solve_shapes(&mut self, body: &Body, stiffness_factor: f64) -> Result<(), CondenseError> {
        let free = body.assembly.places.free();
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
        for place in 0..free {
            for (held, block) in body.assembly.stiffness.handle_blocks(place) {
                let arm = &arms[held - free];
                for c in range[holder[held - free] as usize].clone() {
                    let force = block * columns[c].at(arm) * stiffness_factor;
                    for axis in 0..3 {
                        shapes[c * rows + 3 * place + axis] -= force[axis];
                    }
                }
            }
        }
        if let Some(mask) = body.assembly.mask() {
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

    /// Computes `K Psi` on the handle nodes.
    fn pull(&mut self, body: &Body) {
        let free = body.assembly.places.free();
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
                for (place, block) in body.assembly.stiffness.free_blocks(free + held) {
                    let at = 3 * place;
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
