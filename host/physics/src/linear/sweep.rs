//! The forward and the backward pass through panels, for one right-hand side.
//!
//! The compiler turns the loops into vector instructions. The outer loop is over the lanes of a line, the inner loop
//! over the columns of a block, whose number is a constant.

use super::supernodes::{Supernode, Supernodes};
use crate::lanes::Node;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// Numbers in a cache line, and rows of a strip of a panel.
pub(crate) const LANES: usize = 16;

/// Columns of a block of a panel: those of two nodes.
pub(super) const PAIR: usize = 6;
/// Columns of the last block if the number of nodes is odd: those of three nodes.
pub(super) const TRIPLE: usize = 9;

/// Sixteen rows of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(crate) struct Line(pub(super) [f32; LANES]);

impl Line {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);
}

/// Number of strips of a panel.
pub(crate) fn strips(block: &Supernode) -> usize {
    (3 * (block.width() + block.height())).div_ceil(LANES)
}

/// First column and width of each block of `count` columns. A single node is padded to two.
#[inline(always)]
pub(crate) fn column_blocks(count: usize) -> impl Iterator<Item = (usize, usize)> {
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

/// The blocks of [`column_blocks`] from the last to the first.
#[inline(always)]
pub(super) fn column_blocks_reversed(count: usize) -> impl Iterator<Item = (usize, usize)> {
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

/// Number of cache lines of a panel.
pub(crate) fn lines(block: &Supernode) -> usize {
    let strips = strips(block);
    column_blocks(3 * block.width())
        .map(|(first, width)| width * (strips - first / LANES))
        .sum()
}

/// Adds a block of columns times `x` to the rows from its first strip on.
#[inline(always)]
fn forward_block<const C: usize>(lines: &[Line], x: &[f32], rows: &mut [[f32; LANES]]) {
    let x = x.first_chunk::<C>().copied().unwrap_or([0.0; C]);
    for (strip, lines) in lines.as_chunks::<C>().0.iter().enumerate() {
        let row = &mut rows[strip];
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
pub(super) fn sum(line: [f32; LANES]) -> f32 {
    let eight: [f32; 8] = core::array::from_fn(|i| line[i] + line[i + 8]);
    let four: [f32; 4] = core::array::from_fn(|i| eight[i] + eight[i + 4]);
    (four[0] + four[2]) + (four[1] + four[3])
}

/// Sets `x` to a block of columns, transposed, times the rows from its first strip on.
#[inline(always)]
fn backward_block<const C: usize>(lines: &[Line], x: &mut [f32], rows: &[[f32; LANES]]) {
    let mut sums = [[0.0_f32; LANES]; C];
    for (strip, lines) in lines.as_chunks::<C>().0.iter().enumerate().rev() {
        let row = rows[strip];
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

/// Packs the three components of each node one after the other. Each node writes four numbers, and the next node
/// overwrites the fourth.
#[inline(always)]
fn pack(nodes: &[Node<f32>], flat: &mut [f32]) {
    for (at, node) in nodes.iter().enumerate() {
        if let Some(row) = flat[3 * at..].first_chunk_mut::<4>() {
            *row = *node;
        }
    }
}

/// The inverse of [`pack`]. The fourth number of a node becomes the first number of the next node.
#[inline(always)]
pub(super) fn unpack(flat: &[f32], nodes: &mut [Node<f32>]) {
    for (at, node) in nodes.iter_mut().enumerate() {
        if let Some(row) = flat[3 * at..].first_chunk::<4>() {
            *node = *row;
        }
    }
}

/// Rows of `strips` strips, with room to begin at a cache line.
pub(super) fn rows(strips: usize) -> Vec<f32> {
    // Packing writes one number more than it packs.
    vec![0.0; LANES * (strips + 2)]
}

/// The rows and columns of the current supernode.
#[derive(Clone, Debug)]
pub(crate) struct Work {
    /// Rows, with room to begin at a cache line.
    rows: Vec<f32>,
    columns: Vec<f32>,
}

impl Work {
    /// Room for supernodes of up to `width` columns and `strips` strips.
    pub(crate) fn new(width: usize, strips: usize) -> Self {
        Self {
            rows: rows(strips),
            columns: vec![0.0; width + 4],
        }
    }

    /// The rows and the columns.
    pub(crate) fn parts(&mut self) -> (&mut [[f32; LANES]], &mut [f32]) {
        (aligned(&mut self.rows), &mut self.columns)
    }

    /// Memory of the workspace (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.rows.as_slice()) + size_of_val(self.columns.as_slice())
    }
}

/// The part of `buffer` that begins at a cache line, in strips.
#[inline(always)]
pub(super) fn aligned(buffer: &mut [f32]) -> &mut [[f32; LANES]] {
    let skip = buffer.as_ptr().align_offset(64).min(LANES - 1);
    buffer[skip..].as_chunks_mut::<LANES>().0
}

/// The forward pass through the panels `values` of `supernodes`.
#[inline(always)]
fn forward_pass(
    supernodes: &Supernodes,
    values: &[Line],
    rows: &mut [[f32; LANES]],
    columns: &mut [f32],
    r: &mut [Node<f32>],
) {
    let mut rest = values;
    for block in &supernodes.blocks {
        let width = 3 * block.width();
        let strips = strips(block);
        begin(block, r, &mut rows[..strips], columns);
        for (column, count) in column_blocks(width) {
            let strip = column / LANES;
            let lines;
            (lines, rest) = rest.split_at(count * (strips - strip));
            let (x, rows) = (&columns[column..], &mut rows[strip..strips]);
            match count {
                TRIPLE => forward_block::<TRIPLE>(lines, x, rows),
                _ => forward_block::<PAIR>(lines, x, rows),
            }
        }
        add_below(block, supernodes.below_of(block), rows, r);
    }
}

/// The backward pass through the panels `values` of `supernodes`.
#[inline(always)]
fn backward_pass(
    supernodes: &Supernodes,
    values: &[Line],
    rows: &mut [[f32; LANES]],
    columns: &mut [f32],
    r: &mut [Node<f32>],
) {
    let mut rest = values;
    for block in supernodes.blocks.iter().rev() {
        let width = 3 * block.width();
        let strips = strips(block);
        collect(block, supernodes.below_of(block), r, rows);
        for (column, count) in column_blocks_reversed(width) {
            let strip = column / LANES;
            let lines;
            (rest, lines) = rest.split_at(rest.len() - count * (strips - strip));
            let (x, rows) = (&mut columns[column..column + count], &rows[strip..strips]);
            match count {
                TRIPLE => backward_block::<TRIPLE>(lines, x, rows),
                _ => backward_block::<PAIR>(lines, x, rows),
            }
        }
        unpack(columns, &mut r[block.first as usize..block.end as usize]);
    }
}

/// Begins the forward step of a supernode: its part of `r` in `columns`, and no result in `rows` yet.
#[inline(always)]
pub(crate) fn begin(
    block: &Supernode,
    r: &[Node<f32>],
    rows: &mut [[f32; LANES]],
    columns: &mut [f32],
) {
    let width = 3 * block.width();
    pack(&r[block.first as usize..block.end as usize], columns);
    columns[width..width + 3].fill(0.0);
    rows.fill([0.0; LANES]);
}

/// Ends the forward step of a supernode: its places take the first rows, and the places `below` add the others.
#[inline(always)]
pub(crate) fn add_below(
    block: &Supernode,
    below: &[u32],
    rows: &[[f32; LANES]],
    r: &mut [Node<f32>],
) {
    let flat = rows.as_flattened();
    unpack(flat, &mut r[block.first as usize..block.end as usize]);
    let flat = &flat[3 * block.width()..];
    for (at, &place) in below.iter().enumerate() {
        if let Some(row) = flat[3 * at..].first_chunk::<4>() {
            // The fourth number belongs to the next row. It is never read.
            let node = &mut r[place as usize];
            *node = core::array::from_fn(|i| node[i] + row[i]);
        }
    }
}

/// Begins the backward step of a supernode: the rows of its places and of the places `below`.
#[inline(always)]
pub(crate) fn collect(
    block: &Supernode,
    below: &[u32],
    r: &[Node<f32>],
    rows: &mut [[f32; LANES]],
) {
    let width = 3 * block.width();
    let flat = rows.as_flattened_mut();
    pack(&r[block.first as usize..block.end as usize], flat);
    for (at, &place) in below.iter().enumerate() {
        if let Some(row) = flat[width + 3 * at..].first_chunk_mut::<4>() {
            *row = r[place as usize];
        }
    }
    flat[width + 3 * below.len()..LANES * strips(block)].fill(0.0);
}

/// Clears the padding of the places of `supernodes`.
#[inline(always)]
pub(crate) fn clear_padding(supernodes: &Supernodes, r: &mut [Node<f32>]) {
    let count = supernodes
        .blocks
        .last()
        .map_or(0, |block| block.end as usize);
    for node in &mut r[..count] {
        node[3] = 0.0;
    }
}

/// Solves in place.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2"))
)]
pub(crate) fn solve(
    supernodes: &Supernodes,
    values: &[Line],
    work: &mut Work,
    r: &mut [Node<f32>],
) {
    let (rows, columns) = work.parts();
    forward_pass(supernodes, values, rows, columns, r);
    backward_pass(supernodes, values, rows, columns, r);
    clear_padding(supernodes, r);
}
