//! A Cholesky factor as dense panels that a solve reads once forward and once backward.
//!
//! A supernode with the diagonal block `L` and the rows `B` below it is stored as the panel `P = [L^-1; -B L^-1]`. The
//! forward substitution is a product with `P`, the backward substitution a product with `P^T`. Neither has the chain
//! of dependent divisions of a triangular solve. The inversion of diagonal blocks is known, for instance from
//! P. Raghavan, "Efficient parallel sparse triangular solution using selective inversion" (1998).
//!
//! The numbers are f32, which suffices for the preconditioner of an iteration in f64. The bandwidth of the caches
//! limits a solve. A large factor (see `subtrees`) has numbers of 16 bits (see `packed`). Below that size, half as many
//! bits gain little: bfloat16 saved 10 to 15 % of the time at 3,267 unknowns and nothing with fewer.
//!
//! No product and sum are contracted into one rounding, and lanes are summed in a fixed order. The same factor (see
//! [`FactorCode`](crate::linear::sparse_cholesky::FactorCode)) therefore gives the same result on every machine.

use super::factor::{Factor, Rows};
use super::packed::{self, Packed};
use super::read_ahead::{self, Share};
use super::subtrees::{self, Subtrees};
use super::supernodes::{Supernode, Supernodes};
use super::sweep::{self, LANES, Line, Work, column_blocks, strips};
use crate::cost::Cost;
use crate::error::CondenseError;
use crate::lanes::Node;
use crate::team::{Alone, Team};
use core::ops::Range;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// Operations of a solve for each stored number: a product and a sum in each of the two passes.
pub const SOLVE_FLOPS: usize = 4;

/// Memory of the numbers of the panels of `supernodes` (bytes).
pub(crate) fn bytes_of_values(supernodes: &Supernodes) -> usize {
    let lines = match subtrees::cut(supernodes) {
        Some(_) => packed::lines,
        None => sweep::lines,
    };
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
    /// The first cache line of the panel of each supernode.
    start: Vec<u32>,
    numbers: Numbers,
    build: Build,
}

/// The numbers of panels, with what a solve needs besides.
#[derive(Clone, Debug)]
enum Numbers {
    /// In f32.
    Single { values: Vec<Line>, work: Work },
    /// In 16 bits, in the forests of a large factor.
    Packed {
        packed: Packed,
        subtrees: Box<Subtrees>,
    },
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
    /// Computes the panel of `block`.
    fn fill(&mut self, factor: &Factor, block: &Supernode, below: &[u32]) {
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
    }

    /// Stores the panel of `block` in f32.
    fn store(&self, block: &Supernode, mut panel: &mut [Line]) {
        let width = 3 * block.width();
        for (column, block_width) in column_blocks(width) {
            for strip in column / LANES..strips(block) {
                let source = &self.strips[strip * width..][..width];
                let lines;
                (lines, panel) = core::mem::take(&mut panel).split_at_mut(block_width);
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
        let ranges = subtrees::cut(factor.supernodes());
        Self::in_forests(factor, ranges)
    }

    /// The panels of the whole `factor`, with numbers in f32 whatever the size of the factor.
    pub(crate) fn single(factor: &Factor) -> Self {
        Self::in_forests(factor, None)
    }

    /// The panels of `factor`, in 16 bits and in forests if there are any.
    fn in_forests(factor: &Factor, ranges: Option<Vec<Range<usize>>>) -> Self {
        let supernodes = factor.supernodes().clone();
        let blocks = &supernodes.blocks;
        let lines = match ranges {
            Some(_) => packed::lines,
            None => sweep::lines,
        };
        let mut start = Vec::with_capacity(blocks.len());
        let mut total = 0;
        for block in blocks {
            start.push(total as u32);
            total += lines(block);
        }
        let most = |size: fn(&Supernode) -> usize| blocks.iter().map(size).max().unwrap_or(0);
        let width = most(|block| 3 * block.width());
        let places = factor.order().len();
        let numbers = match ranges {
            Some(ranges) => Numbers::Packed {
                packed: Packed::new(total, 3 * places),
                subtrees: Box::new(Subtrees::new(&supernodes, ranges, &start)),
            },
            None => Numbers::Single {
                values: vec![Line::ZERO; total],
                work: Work::new(width, most(strips)),
            },
        };
        let mut panels = Self {
            start,
            numbers,
            build: Build {
                local: vec![u32::MAX; places],
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
            let (start, width) = (start as usize, 3 * block.width());
            let build = &mut self.build;
            build.fill(factor, block, self.supernodes.below_of(block));
            match &mut self.numbers {
                Numbers::Single { values, .. } => {
                    build.store(block, &mut values[start..][..sweep::lines(block)]);
                }
                Numbers::Packed { packed, .. } => {
                    let strips = &mut build.strips[..width * strips(block)];
                    let diagonal = &build.diagonal;
                    packed.store(block, start, strips, |row| diagonal[row * (width + 1)]);
                }
            }
        }
    }

    /// Whether the numbers have 16 bits.
    pub(crate) fn is_packed(&self) -> bool {
        matches!(self.numbers, Numbers::Packed { .. })
    }

    /// Reads a share of the numbers.
    pub(crate) fn read(&self, share: Share) {
        match &self.numbers {
            Numbers::Single { values, .. } => read_ahead::read(values, share, |line| line.0[0]),
            Numbers::Packed { packed, .. } => packed.read(share),
        }
    }

    /// Number of stored numbers, with the zeros that pad strips.
    pub fn stored(&self) -> usize {
        match &self.numbers {
            Numbers::Single { values, .. } => LANES * values.len(),
            Numbers::Packed { packed, .. } => packed.stored(),
        }
    }

    /// Memory of the panels (bytes).
    pub fn bytes(&self) -> usize {
        let Build {
            local,
            diagonal,
            strips,
        } = &self.build;
        let work = match &self.numbers {
            Numbers::Single { work, .. } => work.bytes(),
            Numbers::Packed { subtrees, .. } => subtrees.bytes(),
        };
        self.supernodes.bytes()
            + size_of_val(self.start.as_slice())
            + self.bytes_of_numbers()
            + work
            + size_of_val(local.as_slice())
            + size_of_val(diagonal.as_slice())
            + size_of_val(strips.as_slice())
    }

    /// Memory of the numbers with their scales (bytes).
    fn bytes_of_numbers(&self) -> usize {
        match &self.numbers {
            Numbers::Single { values, .. } => size_of_val(values.as_slice()),
            Numbers::Packed { packed, .. } => packed.bytes(),
        }
    }

    /// The cost of a solve. Each of the two passes reads the panels, and reads and writes the right-hand side.
    pub(crate) fn solve_cost(&self) -> Cost {
        let panels = Cost::read(self.bytes_of_numbers() + self.supernodes.bytes());
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
        let written = self.bytes_of_numbers();
        let read = self.stored() * size_of::<f64>();
        Cost::write(written) + Cost::read(read).again() + Cost::flops(flops)
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
        match &mut self.numbers {
            Numbers::Single { values, work } => sweep::solve(&self.supernodes, values, work, r),
            Numbers::Packed { packed, subtrees } => subtrees.solve(team, packed, r),
        }
    }
}
