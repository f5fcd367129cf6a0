//! A Cholesky factor as dense panels that a solve reads once forward and once backward.
//!
//! A supernode with the diagonal block `L` and the rows `B` below it is stored as the panel `P = [L^-1; -B L^-1]`. The
//! forward substitution is a product with `P`, the backward substitution a product with `P^T`. Neither has the chain
//! of dependent divisions of a triangular solve. The inversion of diagonal blocks is known, for instance from
//! P. Raghavan, "Efficient parallel sparse triangular solution using selective inversion" (1998).
//!
//! The numbers are f32, which suffices for the preconditioner of an iteration in f64. The bandwidth of the caches
//! limits a solve. Half as many bits (bfloat16) saved 10 to 15 % of the time at 3,267 unknowns and nothing below that
//! size, with an error of 2e-3 instead of 1e-7.
//!
//! No product and sum are contracted into one rounding, and lanes are summed in a fixed order. The same factor (see
//! [`FactorCode`](crate::linear::sparse_cholesky::FactorCode)) therefore gives the same result on every machine.

use super::factor::{Factor, Rows};
use super::read_ahead::{self, Share};
use super::subtrees::Subtrees;
use super::supernodes::{Supernode, Supernodes};
use super::sweep::{self, LANES, Line, Work, column_blocks, lines, strips};
use crate::cost::Cost;
use crate::error::CondenseError;
use crate::lanes::Node;
use crate::team::{Alone, Team};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// Operations of a solve for each stored number: a product and a sum in each of the two passes.
pub const SOLVE_FLOPS: usize = 4;

/// Memory of the numbers of the panels of `supernodes` (bytes).
pub(crate) fn bytes_of_values(supernodes: &Supernodes) -> usize {
    size_of::<Line>() * supernodes.blocks.iter().map(lines).sum::<usize>()
}

/// The panels of a factor.
///
/// The rows of a panel are the places of its supernode and the places below, three rows to a place, in strips of 16
/// rows. Its columns are in blocks of six; the last block has nine if the number of nodes is odd. The order in memory
/// is the order of reading: block by block, in a block strip by strip from the diagonal down, in a strip column by
/// column.
#[derive(Clone, Debug)]
pub struct Panels {
    supernodes: Supernodes,
    /// First index into `values` of the panel of each supernode.
    start: Vec<u32>,
    values: Vec<Line>,
    work: Work,
    /// The pieces of a large factor.
    subtrees: Option<Subtrees>,
    build: Build,
}

/// The workspace for the construction of panels.
#[derive(Clone, Debug, Default)]
struct Build {
    /// First row in the present panel of each place below it, `u32::MAX` for all other places.
    local: Vec<u32>,
    /// The factor's diagonal block, by columns.
    diagonal: Vec<f64>,
    /// The panel by strips, each by columns.
    strips: Vec<[f64; LANES]>,
}

/// Solves `P L = [1; -B]` for one strip. `strip` contains rows of `[1; -B]` by columns, and afterwards rows of `P`.
///
/// `diagonal` is `L` by columns of `width` entries. The rows of `P` end before column `end`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2",))
)]
fn solve_strip(strip: &mut [[f64; LANES]], diagonal: &[f64], width: usize, end: usize) {
    for column in (0..end).rev() {
        let l = &diagonal[column * width..(column + 1) * width];
        let (left, right) = strip.split_at_mut(column + 1);
        let mut sum = left[column];
        for (p, &l) in right[..end - column - 1].iter().zip(&l[column + 1..]) {
            for lane in 0..LANES {
                sum[lane] -= p[lane] * l;
            }
        }
        let inverse = 1.0 / l[column];
        left[column] = sum.map(|sum| sum * inverse);
    }
}

impl Build {
    fn fill(&mut self, factor: &Factor, block: &Supernode, below: &[u32], panel: &mut [Line]) {
        let (first, width) = (3 * block.first as usize, 3 * block.width());
        for (row, &place) in below.iter().enumerate() {
            self.local[place as usize] = (width + 3 * row) as u32;
        }
        let count = strips(block);
        let diagonal = &mut self.diagonal[..width * width];
        let strips = &mut self.strips[..count * width];
        let local = &self.local;
        diagonal.fill(0.0);
        strips.fill([0.0; LANES]);
        factor.columns(first..first + width, |column, rows, values| {
            let column = column - first;
            let mut put = |row: usize, value: f64| {
                if row < first + width {
                    diagonal[column * width + row - first] = value;
                } else {
                    let local = local[row / 3] as usize + row % 3;
                    // Rows that `faer` stores but this panel lacks contain zeros.
                    if let Some(strip) = strips.get_mut(local / LANES * width + column) {
                        strip[local % LANES] = -value;
                    }
                }
            };
            match rows {
                Rows::From(row) => {
                    for (row, &value) in (row as usize..).zip(values) {
                        put(row, value);
                    }
                }
                Rows::Listed(rows) => {
                    for (&row, &value) in rows.iter().zip(values) {
                        put(row as usize, value);
                    }
                }
            }
        });
        for &place in below {
            self.local[place as usize] = u32::MAX;
        }
        for row in 0..width {
            strips[row / LANES * width + row][row % LANES] = 1.0;
        }
        for (at, strip) in strips.chunks_exact_mut(width).enumerate() {
            // Rows of the inverse end at the diagonal.
            let rows = LANES * (at + 1);
            let end = if rows <= width { rows } else { width };
            solve_strip(strip, diagonal, width, end);
        }
        let mut panel = panel;
        for (column, block) in column_blocks(width) {
            for strip in column / LANES..count {
                let source = &strips[strip * width..][..width];
                let lines;
                (lines, panel) = core::mem::take(&mut panel).split_at_mut(block);
                for (source, line) in source[column..].iter().zip(lines) {
                    line.0 = source.map(|value| value as f32);
                }
            }
        }
    }
}

impl Panels {
    /// The panels of `factor`, with its present numbers.
    pub fn new(factor: &Factor) -> Self {
        let supernodes = factor.supernodes().clone();
        let blocks = &supernodes.blocks;
        let mut start = Vec::with_capacity(blocks.len());
        let mut total = 0;
        for block in blocks {
            start.push(total as u32);
            total += lines(block);
        }
        let most = |size: fn(&Supernode) -> usize| blocks.iter().map(size).max().unwrap_or(0);
        let width = most(|block| 3 * block.width());
        let mut panels = Self {
            subtrees: Subtrees::new(&supernodes, &start),
            start,
            values: vec![Line::ZERO; total],
            work: Work::new(width, most(strips)),
            build: Build {
                local: vec![u32::MAX; factor.order().len()],
                diagonal: vec![0.0; width * width],
                strips: vec![[0.0; LANES]; most(|block| 3 * block.width() * strips(block))],
            },
            supernodes,
        };
        panels.take_over(factor);
        panels
    }

    /// Recomputes the panels from the numbers of `factor`.
    ///
    /// # Errors
    ///
    /// [`CondenseError::Topology`] if `factor` has another pattern than the factor given to `new`. The panels are then
    /// unchanged.
    pub fn refresh(&mut self, factor: &Factor) -> Result<(), CondenseError> {
        if self.supernodes != *factor.supernodes() {
            return Err(CondenseError::Topology);
        }
        self.take_over(factor);
        Ok(())
    }

    fn take_over(&mut self, factor: &Factor) {
        for (block, &start) in self.supernodes.blocks.iter().zip(&self.start) {
            let panel = &mut self.values[start as usize..][..lines(block)];
            let below = block.below_start as usize..block.below_end as usize;
            self.build
                .fill(factor, block, &self.supernodes.below[below], panel);
        }
    }

    /// Reads a share of the numbers.
    pub(crate) fn read(&self, share: Share) {
        read_ahead::read(&self.values, share, |line| line.0[0]);
    }

    /// Number of stored numbers, with the zeros that pad strips.
    pub fn stored(&self) -> usize {
        LANES * self.values.len()
    }

    /// Memory of the panels (bytes).
    pub fn bytes(&self) -> usize {
        let Build {
            local,
            diagonal,
            strips,
        } = &self.build;
        self.supernodes.bytes()
            + size_of_val(self.start.as_slice())
            + size_of_val(self.values.as_slice())
            + self.work.bytes()
            + self.subtrees.as_ref().map_or(0, Subtrees::bytes)
            + size_of_val(local.as_slice())
            + size_of_val(diagonal.as_slice())
            + size_of_val(strips.as_slice())
    }

    /// The cost of a solve. Each of the two passes reads the panels, and reads and writes the right-hand side.
    pub(crate) fn solve_cost(&self) -> Cost {
        let panels = Cost::read(size_of_val(self.values.as_slice()) + self.supernodes.bytes());
        let r = Cost::update(size_of::<Node<f32>>() * self.build.local.len());
        let flops = Cost::flops(SOLVE_FLOPS * self.stored());
        panels + panels.again() + r + r.again() + flops
    }

    /// The cost of [`refresh`](Self::refresh). A strip takes a product and a sum for each pair of its columns, and a
    /// product for each column. The number of entries read from the factor counts as that of the panels, which is
    /// exact if no strip is padded.
    pub(crate) fn refresh_cost(&self) -> Cost {
        let mut flops = 0;
        for block in &self.supernodes.blocks {
            let width = 3 * block.width();
            for at in 0..strips(block) {
                let rows = LANES * (at + 1);
                let end = if rows <= width { rows } else { width };
                flops += LANES * end * end + end;
            }
        }
        let written = size_of_val(self.values.as_slice());
        let read = self.stored() * size_of::<f64>();
        Cost::write(written) + Cost::read(read).again() + Cost::flops(flops)
    }

    /// The supernodes.
    pub fn supernodes(&self) -> &Supernodes {
        &self.supernodes
    }

    /// Solves in place, in f32. `r` contains the right-hand side by places and becomes the solution.
    ///
    /// Places past those of the factor are not changed. If `r` is shorter than the factor, the function does nothing.
    pub fn solve(&mut self, r: &mut [Node<f32>]) {
        self.solve_with(&Alone, r);
    }

    /// [`solve`](Self::solve) with a team, which gives the same result.
    pub fn solve_with(&mut self, team: &dyn Team, r: &mut [Node<f32>]) {
        if r.len() < self.build.local.len() {
            return;
        }
        match &mut self.subtrees {
            Some(subtrees) => subtrees.solve(team, &self.values, r),
            None => sweep::solve(&self.supernodes, &self.values, &mut self.work, r),
        }
    }

    /// [`solve`](Self::solve) for three right-hand sides. Each pass reads the panels of a small factor once for all
    /// three.
    pub fn solve_three(&mut self, r: [&mut [Node<f32>]; 3]) {
        if r.iter().any(|r| r.len() < self.build.local.len()) {
            return;
        }
        if self.subtrees.is_some() {
            for r in r {
                self.solve(r);
            }
            return;
        }
        sweep::solve_three(&self.supernodes, &self.values, &mut self.work, r);
    }
}
