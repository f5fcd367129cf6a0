//! A Cholesky factor as dense panels that a solve reads once forward and once backward.
//!
//! Of a supernode with the diagonal block `L` and the rows `B` below it the panel `P = [L^-1; -B L^-1]` is
//! kept: the forward substitution is a product with it, the backward one with its transpose, without the
//! chain of dependent divisions of a triangular solve. Inverting diagonal blocks is old (for instance
//! P. Raghavan, "Efficient parallel sparse triangular solution using selective inversion", 1998). Numbers
//! are f32: as the preconditioner of an iteration in f64 more are not needed, and a solve is as fast as
//! the caches give the panels.
//!
//! No two products are contracted into one rounding and lanes are summed in a fixed order: the result
//! does not depend on the machine.

use super::Node;
use super::factor::{Factor, Rows};
use super::supernodes::{Supernode, Supernodes};
use multiversion::multiversion;

/// Numbers in a line of the cache, and rows of a strip of a panel.
const LANES: usize = 16;

/// Columns of a panel that are worked on together: two nodes.
const PAIR: usize = 6;
/// Three nodes: the last block where their number is odd.
const TRIPLE: usize = 9;

/// Sixteen rows of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
struct Line([f32; LANES]);

impl Line {
    const ZERO: Self = Self([0.0; LANES]);
}

/// The factor's panels.
///
/// A panel's rows are its own places and those below, three to a place, in strips of 16; its columns are
/// in blocks of 12, then 6, then 3. Blocks follow each other, and in a block the strips from the diagonal
/// down, and in a strip the columns: the order in which they are read.
#[derive(Clone, Debug)]
pub struct Panels {
    supernodes: Supernodes,
    /// Where the panel of each supernode begins in `values`.
    start: Vec<u32>,
    values: Vec<Line>,
    /// Rows of the supernode at hand, with room to begin at a line of the cache.
    rows: Vec<f32>,
    /// Columns of the supernode at hand.
    columns: Vec<f32>,
    build: Build,
}

/// What is needed to fill panels.
#[derive(Clone, Debug, Default)]
struct Build {
    /// Row in the panel of each place below (in nodes).
    local: Vec<u32>,
    /// The factor's diagonal block, by columns.
    diagonal: Vec<f64>,
    /// The panel by strips, each by columns.
    strips: Vec<[f64; LANES]>,
}

fn strips(block: &Supernode) -> usize {
    (3 * (block.width() + block.height())).div_ceil(LANES)
}

/// First column and width of each block of `count` columns; a single node is filled up to two.
#[inline(always)]
fn column_blocks(count: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut first = 0;
    core::iter::from_fn(move || {
        let width = match count - first.min(count) {
            0 => return None,
            TRIPLE => TRIPLE,
            _ => PAIR,
        };
        let block = (first, width);
        first += width;
        Some(block)
    })
}

/// The same from the last to the first.
#[inline(always)]
fn column_blocks_reversed(count: usize) -> impl Iterator<Item = (usize, usize)> {
    let mut end = count.max(PAIR);
    let mut width = if end.is_multiple_of(PAIR) {
        PAIR
    } else {
        TRIPLE
    };
    core::iter::from_fn(move || {
        let block = (end.checked_sub(width)?, width);
        (end, width) = (block.0, PAIR);
        Some(block)
    })
}

/// Lines of a panel.
fn lines(block: &Supernode) -> usize {
    let strips = strips(block);
    column_blocks(3 * block.width())
        .map(|(first, width)| width * (strips - first / LANES))
        .sum()
}

#[inline(always)]
fn forward_block<const C: usize>(lines: &[Line], x: &[f32], rows: &mut [[f32; LANES]]) {
    let (lines, _) = lines.as_chunks::<C>();
    let Some((x, _)) = x.split_first_chunk::<C>() else {
        return;
    };
    for (lines, row) in lines.iter().zip(rows) {
        for lane in 0..LANES {
            let mut sum = row[lane];
            for c in 0..C {
                sum += lines[c].0[lane] * x[c];
            }
            row[lane] = sum;
        }
    }
}

/// The sum of all lanes, halves first.
#[inline(always)]
fn sum(line: [f32; LANES]) -> f32 {
    let eight: [f32; 8] = core::array::from_fn(|i| line[i] + line[i + 8]);
    let four: [f32; 4] = core::array::from_fn(|i| eight[i] + eight[i + 4]);
    (four[0] + four[2]) + (four[1] + four[3])
}

#[inline(always)]
fn backward_block<const C: usize>(lines: &[Line], rows: &[[f32; LANES]], x: &mut [f32]) {
    let (lines, _) = lines.as_chunks::<C>();
    let mut sums = [[0.0_f32; LANES]; C];
    for (lines, row) in lines.iter().zip(rows).rev() {
        for lane in 0..LANES {
            for c in 0..C {
                sums[c][lane] += lines[c].0[lane] * row[lane];
            }
        }
    }
    for (x, line) in x.iter_mut().zip(sums) {
        *x = sum(line);
    }
}

/// Calls the block's kernel for its width.
macro_rules! by_width {
    ($width:expr, $kernel:ident($($argument:expr),*)) => {
        match $width {
            TRIPLE => $kernel::<TRIPLE>($($argument),*),
            _ => $kernel::<PAIR>($($argument),*),
        }
    };
}

/// The part of `buffer` that begins at a line of the cache, in strips.
#[inline(always)]
fn aligned(buffer: &mut [f32]) -> &mut [[f32; LANES]] {
    let skip = buffer.as_ptr().align_offset(64).min(LANES - 1);
    buffer[skip..].as_chunks_mut::<LANES>().0
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2",))]
fn solve(
    supernodes: &Supernodes,
    values: &[Line],
    rows: &mut [f32],
    columns: &mut [f32],
    r: &mut [Node<f32>],
) {
    let rows = aligned(rows);
    let mut rest = values;
    for block in &supernodes.blocks {
        let (first, end) = (block.first as usize, block.end as usize);
        let below = &supernodes.below[block.below_start as usize..block.below_end as usize];
        let width = 3 * block.width();
        let strips = strips(block);
        pack(&r[first..end], columns);
        columns[width..width + 3].fill(0.0);
        rows[..strips].fill([0.0; LANES]);
        for (column, count) in column_blocks(width) {
            let strip = column / LANES;
            let lines;
            (lines, rest) = rest.split_at(count * (strips - strip));
            by_width!(
                count,
                forward_block(lines, &columns[column..], &mut rows[strip..strips])
            );
        }
        let flat = rows.as_flattened();
        unpack(flat, &mut r[first..end]);
        for (at, &place) in below.iter().enumerate() {
            if let Some(row) = flat[width + 3 * at..].first_chunk::<4>() {
                // The fourth is the next node's; it is never read.
                let node = &mut r[place as usize];
                *node = core::array::from_fn(|i| node[i] + row[i]);
            }
        }
    }
    let mut rest = values;
    for block in supernodes.blocks.iter().rev() {
        let (first, end) = (block.first as usize, block.end as usize);
        let below = &supernodes.below[block.below_start as usize..block.below_end as usize];
        let width = 3 * block.width();
        let strips = strips(block);
        let flat = rows.as_flattened_mut();
        pack(&r[first..end], flat);
        for (at, &place) in below.iter().enumerate() {
            if let Some(row) = flat[width + 3 * at..].first_chunk_mut::<4>() {
                *row = r[place as usize];
            }
        }
        flat[width + 3 * below.len()..LANES * strips].fill(0.0);
        for (column, count) in column_blocks_reversed(width) {
            let strip = column / LANES;
            let lines;
            (rest, lines) = rest.split_at(rest.len() - count * (strips - strip));
            by_width!(
                count,
                backward_block(
                    lines,
                    &rows[strip..strips],
                    &mut columns[column..column + count]
                )
            );
        }
        unpack(columns, &mut r[first..end]);
    }
}

/// Nodes' three numbers one after the other; each writes four, the next overwrites the last.
#[inline(always)]
fn pack(nodes: &[Node<f32>], flat: &mut [f32]) {
    for (at, node) in nodes.iter().enumerate() {
        if let Some(row) = flat[3 * at..].first_chunk_mut::<4>() {
            *row = *node;
        }
    }
}

/// The reverse of [`pack`].
#[inline(always)]
fn unpack(flat: &[f32], nodes: &mut [Node<f32>]) {
    for (at, node) in nodes.iter_mut().enumerate() {
        if let Some(row) = flat[3 * at..].first_chunk::<4>() {
            *node = [row[0], row[1], row[2], 0.0];
        }
    }
}

/// `P L = [1; -B]` for one strip: `strip` holds rows of `[1; -B]` by columns, then of `P`.
///
/// `diagonal` is `L` by columns of `width` entries; rows of `P` end with column `end`.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2",))]
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
                    // Rows that `faer` stores and this panel does not hold zeros.
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
    /// The panels of `factor`, with the numbers that it has.
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
            start,
            values: vec![Line::ZERO; total],
            rows: vec![0.0; LANES * (most(strips) + 2)],
            columns: vec![0.0; width + 4],
            build: Build {
                local: vec![u32::MAX; factor.order().len()],
                diagonal: vec![0.0; width * width],
                strips: vec![[0.0; LANES]; most(|block| 3 * block.width() * strips(block))],
            },
            supernodes,
        };
        panels.refresh(factor);
        panels
    }

    /// Takes over the numbers of `factor`, which must be of the same order and pattern.
    pub fn refresh(&mut self, factor: &Factor) {
        for (block, &start) in self.supernodes.blocks.iter().zip(&self.start) {
            let panel = &mut self.values[start as usize..][..lines(block)];
            let below = block.below_start as usize..block.below_end as usize;
            self.build
                .fill(factor, block, &self.supernodes.below[below], panel);
        }
    }

    /// Numbers stored, with the zeros that fill strips.
    pub fn stored(&self) -> usize {
        LANES * self.values.len()
    }

    /// The supernodes.
    pub fn supernodes(&self) -> &Supernodes {
        &self.supernodes
    }

    /// Solves in place, in f32: `r` holds the right-hand side by places and becomes the solution.
    ///
    /// Places past those of the factor are left as they are; with fewer, nothing is done.
    pub fn solve(&mut self, r: &mut [Node<f32>]) {
        if r.len() < self.build.local.len() {
            return;
        }
        solve(
            &self.supernodes,
            &self.values,
            &mut self.rows,
            &mut self.columns,
            r,
        );
    }
}
