//! The matrix of a step, read by entries, blocks or rows and never formed: one definition for every solver.

use super::block_matrix::BlockMatrix;
use crate::{Mat3, Vec3};

/// `mass_factor M + stiffness_factor K` on free nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepMatrix<'a> {
    pub(crate) stiffness: &'a BlockMatrix,
    /// By node (kg).
    pub(crate) mass: &'a [f64],
    pub(crate) mass_factor: f64,
    pub(crate) stiffness_factor: f64,
    /// By free node and axis: 1 if it is free, 0 if a support guides it.
    pub(crate) mask: Option<&'a [Vec3]>,
}

impl StepMatrix<'_> {
    /// Whether every free node has its mass and, if any has, its mask.
    pub(crate) fn is_whole(&self) -> bool {
        let free = self.stiffness.free();
        self.mass.len() >= free && self.mask.is_none_or(|mask| mask.len() >= free)
    }

    #[inline(always)]
    fn is_guided(&self, (node, axis): (usize, usize)) -> bool {
        self.mask.is_some_and(|mask| mask[node][axis] == 0.0)
    }

    /// Its entry between two axes of nodes, if the stiffness has `value`. Guided axes are uncoupled, with 1 on the
    /// diagonal.
    #[inline(always)]
    pub(crate) fn entry(&self, row: (usize, usize), column: (usize, usize), value: f64) -> f64 {
        let diagonal = row == column;
        if self.is_guided(row) || self.is_guided(column) {
            return if diagonal { 1.0 } else { 0.0 };
        }
        let value = self.stiffness_factor * value;
        if diagonal {
            value + self.mass_factor * self.mass[row.0]
        } else {
            value
        }
    }

    /// Its block at (`row`, `column`), if the stiffness has `block`; `alone` is put on the diagonal of guided axes.
    #[inline(always)]
    pub(crate) fn block(&self, row: usize, column: usize, block: &Mat3, alone: f64) -> Mat3 {
        let mut block = block * self.stiffness_factor;
        if row == column {
            let inertia = self.mass_factor * self.mass[row];
            for i in 0..3 {
                block[(i, i)] += inertia;
            }
        }
        if let Some(mask) = self.mask {
            let (left, right) = (mask[row], mask[column]);
            block = Mat3::from_fn(|i, j| block[(i, j)] * left[i] * right[j]);
            if row == column {
                for i in 0..3 {
                    block[(i, i)] += alone * (1.0 - left[i]);
                }
            }
        }
        block
    }

    /// `y = A_ff x`; returns `x . y`. What supports guide is left out.
    pub(crate) fn product(&self, x: &[Vec3], y: &mut [Vec3]) -> f64 {
        let mut dot = 0.0;
        for (row, y) in y.iter_mut().enumerate() {
            *y = self.stiffness.free_product(row, x) * self.stiffness_factor
                + x[row] * (self.mass_factor * self.mass[row]);
            if let Some(mask) = self.mask {
                y.component_mul_assign(&mask[row]);
            }
            dot += x[row].dot(y);
        }
        dot
    }
}
