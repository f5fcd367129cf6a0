//! Panels of 16-bit numbers: the form of a large factor, whose solve waits for memory.
//!
//! A panel `[L^-1; -B L^-1]` (see `panel`) is stored as integers with a scale for each column (block floating point:
//! J. H. Wilkinson, "Rounding errors in algebraic processes", 1963). The rows of `L^-1` are first multiplied by the
//! diagonal of `L`. The panel then has no unit, and ones on its diagonal. A number errs by at most 2^-16 of the largest
//! number of its column. The two passes use the same numbers, so that the preconditioner stays symmetric and positive
//! definite. Scales and diagonal multiply the right-hand side, once for each unknown and pass.
//!
//! The error grows with the square root of the condition number. Cubes take as many iterations as with f32. A stiff bar
//! of 15 times its width, clamped at one end (10 GPa, steps of 5 ms), takes 5.6 iterations instead of 2.0, and 6.5
//! instead of 4.7 at 0.1 GPa.
//!
//! A lane of 32 bits holds the numbers of two columns. The second number is in the lower half. The lane shifted by 16
//! bits has its value. The first number is the whole lane. The upper half is chosen with the lower half in view, so
//! that the bits of the second number are no error of the first.

use super::read_ahead::{self, Share};
use super::supernodes::{Supernode, Supernodes};
use super::sweep::{
    LANES, PAIR, TRIPLE, Work, add_below, begin, collect, column_blocks, column_blocks_reversed,
    strips, sum, unpack,
};
use crate::lanes::Node;
use core::ops::Range;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// The largest number of a column in a whole lane.
const WHOLE: f64 = 32_767.0 * 65_536.0;

/// The value of a bit of the upper half.
const UPPER: f64 = 65_536.0;

/// One and a half times 2^52. A sum with this number has its integer, rounded to nearest, in the lowest bits.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// Sixteen rows of two columns.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
struct Pairs([i32; LANES]);

/// The panels of a factor.
#[derive(Clone, Debug)]
pub(super) struct Packed {
    /// The numbers, in the order of [`Panels`](super::panel::Panels), two columns at a time.
    pairs: Vec<Pairs>,
    /// By columns of the factor: the value of 1 in a lane.
    scale: Vec<f32>,
    /// By columns of the factor: the inverse of the diagonal.
    inverse: Vec<f32>,
}

/// Some of the panels, or some columns of one of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slice<'a> {
    pairs: &'a [Pairs],
    scale: &'a [f32],
    inverse: &'a [f32],
}

/// Number of cache lines of the block of `width` columns from column `first` on, in a panel of `strips` strips.
#[inline(always)]
pub(super) fn lines_of((first, width): (usize, usize), strips: usize) -> usize {
    width.div_ceil(2) * (strips - first / LANES)
}

/// Number of cache lines of a panel.
pub(super) fn lines(block: &Supernode) -> usize {
    let strips = strips(block);
    column_blocks(3 * block.width())
        .map(|columns| lines_of(columns, strips))
        .sum()
}

/// The columns of a factor that belong to `block`.
fn columns(block: &Supernode) -> Range<usize> {
    3 * block.first as usize..3 * block.end as usize
}

impl Packed {
    /// Room for panels of `lines` cache lines and `columns` columns.
    pub(super) fn new(lines: usize, columns: usize) -> Self {
        Self {
            pairs: vec![Pairs([0; LANES]); lines],
            scale: vec![0.0; columns],
            inverse: vec![0.0; columns],
        }
    }

    /// The cache lines `lines`, which belong to the columns `columns` of the factor.
    pub(super) fn slice(&self, lines: Range<usize>, columns: Range<usize>) -> Slice<'_> {
        let whole = Slice {
            pairs: &self.pairs,
            scale: &self.scale,
            inverse: &self.inverse,
        };
        whole.part(lines, columns)
    }

    /// Reads a share of the numbers.
    pub(super) fn read(&self, share: Share) {
        read_ahead::read(&self.pairs, share, |pairs| {
            f32::from_bits(pairs.0[0].cast_unsigned())
        });
    }

    /// Number of stored numbers, with the zeros of the padding.
    pub(super) fn stored(&self) -> usize {
        2 * LANES * self.pairs.len()
    }

    /// Memory of the panels (bytes).
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.pairs.as_slice())
            + size_of_val(self.scale.as_slice())
            + size_of_val(self.inverse.as_slice())
    }

    /// Stores the panel of `block` from the cache line `start` on. `strips` contains the panel by strips, each by
    /// columns; its rows of `L^-1` lose their unit. `diagonal` gives an entry of the diagonal of `L`.
    pub(super) fn store(
        &mut self,
        block: &Supernode,
        start: usize,
        strips: &mut [[f64; LANES]],
        diagonal: impl Fn(usize) -> f64,
    ) {
        let width = 3 * block.width();
        for (at, strip) in strips.chunks_exact_mut(width).enumerate() {
            let mut factors = [1.0; LANES];
            for (factor, row) in factors.iter_mut().zip(LANES * at..width) {
                *factor = diagonal(row);
            }
            if LANES * at < width {
                for line in strip {
                    for lane in 0..LANES {
                        line[lane] *= factors[lane];
                    }
                }
            }
        }
        for (row, inverse) in self.inverse[columns(block)].iter_mut().enumerate() {
            *inverse = (1.0 / diagonal(row)) as f32;
        }
        let scale = &mut self.scale[columns(block)];
        round(width, strips, scale, &mut self.pairs[start..]);
    }
}

/// Finds the scale of each column of a panel, and stores the rounded numbers.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2",))
)]
fn round(width: usize, strips: &[[f64; LANES]], scale: &mut [f32], pairs: &mut [Pairs]) {
    for (column, scale) in scale.iter_mut().enumerate() {
        let mut most = [0.0_f64; LANES];
        for line in strips[column..].iter().step_by(width) {
            for lane in 0..LANES {
                most[lane] = most[lane].max(line[lane].abs());
            }
        }
        *scale = (most.into_iter().fold(0.0, f64::max) / WHOLE) as f32;
    }
    let scale = &*scale;
    let mut pairs = pairs.iter_mut();
    for (first, count) in column_blocks(width) {
        let end = (first + count).min(width);
        for strip in strips.chunks_exact(width).skip(first / LANES) {
            // A column of the padding is zero.
            let column = |column: usize| match &strip[..end].get(column) {
                Some(line) => (**line, 1.0 / f64::from(scale[column])),
                None => ([0.0; LANES], 0.0),
            };
            for at in (first..first + count).step_by(2) {
                let Some(Pairs(lanes)) = pairs.next() else {
                    return;
                };
                let ((upper, by), (lower, by_lower)) = (column(at), column(at + 1));
                let by_lower = by_lower / UPPER;
                for lane in 0..LANES {
                    let integer = |number: f64| (number + ROUND).to_bits() as i32;
                    let low = integer(lower[lane] * by_lower) & 0xffff;
                    let high = integer((upper[lane] * by - f64::from(low)) / UPPER);
                    lanes[lane] = (high << 16) | low;
                }
            }
        }
    }
}

/// Adds a block of `C` columns, which are `P` pairs, times `x` to the rows from its first strip on.
#[inline(always)]
fn forward_block<const C: usize, const P: usize>(
    pairs: &[Pairs],
    x: &[f32],
    rows: &mut [[f32; LANES]],
) {
    let x: [f32; C] = x.first_chunk::<C>().copied().unwrap_or([0.0; C]);
    for (row, pairs) in rows.iter_mut().zip(pairs.as_chunks::<P>().0) {
        for lane in 0..LANES {
            let mut sum = row[lane];
            for pair in 0..P {
                let both = pairs[pair].0[lane];
                sum += both as f32 * x[2 * pair];
                if 2 * pair + 1 < C {
                    sum += (both << 16) as f32 * x[2 * pair + 1];
                }
            }
            row[lane] = sum;
        }
    }
}

/// Sets `x` to a block of columns, which are `P` pairs, transposed, times the rows from its first strip on.
#[inline(always)]
fn backward_block<const P: usize>(pairs: &[Pairs], x: &mut [f32], rows: &[[f32; LANES]]) {
    let mut sums = [[[0.0_f32; LANES]; 2]; P];
    for (strip, pairs) in pairs.as_chunks::<P>().0.iter().enumerate().rev() {
        let row = rows[strip];
        for lane in 0..LANES {
            for pair in 0..P {
                let both = pairs[pair].0[lane];
                sums[pair][0][lane] += both as f32 * row[lane];
                sums[pair][1][lane] += (both << 16) as f32 * row[lane];
            }
        }
    }
    add_lanes(sums.as_flattened(), x);
}

/// Sets each number of `x` to the sum of the lanes of a line. With the sums in sight of the loop over strips, LLVM
/// computes that loop number by number.
#[inline(never)]
fn add_lanes(lines: &[[f32; LANES]], x: &mut [f32]) {
    for (x, line) in x.iter_mut().zip(lines) {
        *x = sum(*line);
    }
}

/// Multiplies `x` by `factors`.
#[inline(always)]
fn scale(x: &mut [f32], factors: &[f32]) {
    for (x, factor) in x.iter_mut().zip(factors) {
        *x *= factor;
    }
}

/// Adds the product of some columns of a panel with `x` to `rows`, those of the whole panel. The columns are `count`
/// from number `first` on, with the padding of the last block. `pairs` has these columns alone.
#[inline(always)]
fn forward_range(
    mut pairs: &[Pairs],
    (first, count): (usize, usize),
    x: &[f32],
    rows: &mut [[f32; LANES]],
) {
    for (column, count) in column_blocks(count) {
        let block;
        (block, pairs) = pairs.split_at(lines_of((first + column, count), rows.len()));
        let rows = &mut rows[(first + column) / LANES..];
        let x = &x[column..];
        match count {
            TRIPLE => forward_block::<TRIPLE, { TRIPLE.div_ceil(2) }>(block, x, rows),
            _ => forward_block::<PAIR, { PAIR.div_ceil(2) }>(block, x, rows),
        }
    }
}

/// Sets `x` to the product of some columns of a panel, transposed, with `rows`. The arguments are those of
/// [`forward_range`].
#[inline(always)]
fn backward_range(
    mut pairs: &[Pairs],
    (first, count): (usize, usize),
    rows: &[[f32; LANES]],
    x: &mut [f32],
) {
    for (column, count) in column_blocks_reversed(count) {
        let block;
        let lines = lines_of((first + column, count), rows.len());
        (pairs, block) = pairs.split_at(pairs.len() - lines);
        let rows = &rows[(first + column) / LANES..];
        let x = &mut x[column..column + count];
        match count {
            TRIPLE => backward_block::<{ TRIPLE.div_ceil(2) }>(block, x, rows),
            _ => backward_block::<{ PAIR.div_ceil(2) }>(block, x, rows),
        }
    }
}

impl Slice<'_> {
    /// The cache lines `lines` of the slice, which belong to its columns `columns`.
    #[inline(always)]
    fn part(&self, lines: Range<usize>, columns: Range<usize>) -> Self {
        Self {
            pairs: &self.pairs[lines],
            scale: &self.scale[columns.clone()],
            inverse: &self.inverse[columns],
        }
    }

    /// Begins the forward step of `block`, to which the slice belongs: see [`begin`].
    #[inline(always)]
    pub(super) fn begin(
        &self,
        block: &Supernode,
        r: &[Node<f32>],
        rows: &mut [[f32; LANES]],
        x: &mut [f32],
    ) {
        begin(block, r, rows, x);
        scale(x, self.scale);
    }

    /// Ends the products of the forward step.
    #[inline(always)]
    pub(super) fn end(&self, rows: &mut [[f32; LANES]]) {
        scale(rows.as_flattened_mut(), self.inverse);
    }

    /// Begins the backward step of `block`, to which the slice belongs: see [`collect`].
    #[inline(always)]
    pub(super) fn collect(
        &self,
        block: &Supernode,
        below: &[u32],
        r: &[Node<f32>],
        rows: &mut [[f32; LANES]],
    ) {
        collect(block, below, r, rows);
        scale(rows.as_flattened_mut(), self.inverse);
    }

    /// Ends the products of the backward step. The places of `block` take the columns.
    #[inline(always)]
    pub(super) fn unpack(&self, block: &Supernode, x: &mut [f32], r: &mut [Node<f32>]) {
        scale(x, self.scale);
        unpack(x, &mut r[block.first as usize..block.end as usize]);
    }
}

/// The forward pass through the panels `panels` of `supernodes`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2"))
)]
pub(super) fn forward(
    supernodes: &Supernodes,
    panels: Slice<'_>,
    work: &mut Work,
    r: &mut [Node<f32>],
) {
    let (rows, x) = work.parts();
    let mut start = 0;
    for block in &supernodes.blocks {
        let end = start + lines(block);
        let panel = panels.part(start..end, columns(block));
        start = end;
        // The last node may read past the last strip.
        let own = &mut rows[..strips(block)];
        panel.begin(block, r, own, x);
        forward_range(panel.pairs, (0, 3 * block.width()), x, own);
        panel.end(own);
        add_below(block, supernodes.below_of(block), rows, r);
    }
}

/// The backward pass through the panels `panels` of `supernodes`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2"))
)]
pub(super) fn backward(
    supernodes: &Supernodes,
    panels: Slice<'_>,
    work: &mut Work,
    r: &mut [Node<f32>],
) {
    let (rows, x) = work.parts();
    let mut end = panels.pairs.len();
    for block in supernodes.blocks.iter().rev() {
        let start = end - lines(block);
        let panel = panels.part(start..end, columns(block));
        end = start;
        panel.collect(block, supernodes.below_of(block), r, rows);
        let rows = &rows[..strips(block)];
        backward_range(panel.pairs, (0, 3 * block.width()), rows, x);
        panel.unpack(block, x, r);
    }
}

/// [`forward_range`] for all of `panel`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2"))
)]
pub(super) fn forward_columns(
    panel: Slice<'_>,
    columns: (usize, usize),
    x: &[f32],
    rows: &mut [[f32; LANES]],
) {
    forward_range(panel.pairs, columns, x, rows);
}

/// [`backward_range`] for all of `panel`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl", "x86_64+avx2"))
)]
pub(super) fn backward_columns(
    panel: Slice<'_>,
    columns: (usize, usize),
    rows: &[[f32; LANES]],
    x: &mut [f32],
) {
    backward_range(panel.pairs, columns, rows, x);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A panel by strips, each by columns, of numbers up to 1/2. It is zero above the diagonal and past the last row.
    fn panel(block: &Supernode) -> Vec<[f64; LANES]> {
        let (width, rows) = (3 * block.width(), 3 * (block.width() + block.height()));
        let number = |row: usize, column: usize| {
            let at = 97 * row + column;
            if row < rows && (row >= width || row >= column) {
                f64::from((at * at * 7919 % 10_007) as u32) / 10_007.0 - 0.5
            } else {
                0.0
            }
        };
        let line =
            |at: usize| core::array::from_fn(|lane| number(at / width * LANES + lane, at % width));
        (0..width * strips(block)).map(line).collect()
    }

    fn both_passes_use_the_rounded_numbers(block: &Supernode) {
        let (width, strips) = (3 * block.width(), strips(block));
        let source = panel(block);
        let mut unitless = source.clone();
        let diagonal = |row: usize| 0.1 + row as f64;
        let mut packed = Packed::new(lines(block), width);
        packed.store(block, 0, &mut unitless, diagonal);
        let panel = packed.slice(0..lines(block), 0..width);
        for column in 0..width {
            let of_column = |at: usize| unitless[at * width + column];
            let largest = (0..strips).flat_map(of_column);
            let largest = largest.fold(0.0_f64, |most, number| most.max(number.abs()));
            let mut x = vec![0.0; width + 4];
            x[column] = 1.0;
            scale(&mut x, panel.scale);
            let mut rows = vec![[0.0; LANES]; strips];
            forward_columns(panel, (0, width), &x, &mut rows);
            panel.end(&mut rows);
            // The strips above the diagonal are not stored.
            for row in column / LANES * LANES..strips * LANES {
                let number = f64::from(rows.as_flattened()[row]);
                let expected = source[row / LANES * width + column][row % LANES];
                let unit = if row < width { diagonal(row) } else { 1.0 };
                // Half a unit of the last place, and the rounding of single precision.
                let bound = largest / unit * (0.5 / 32_767.0 + 1e-6);
                assert!(
                    (number - expected).abs() <= bound,
                    "{block:?} {row} {column}"
                );
                let mut one = vec![[0.0; LANES]; strips];
                one.as_flattened_mut()[row] = 1.0;
                panel.end(&mut one);
                let mut x = vec![0.0; width + 4];
                backward_columns(panel, (0, width), &one, &mut x);
                scale(&mut x, panel.scale);
                let transposed = f64::from(x[column]);
                let rounding = 1e-6 * number.abs();
                assert!(
                    (transposed - number).abs() <= rounding,
                    "{block:?} {row} {column}"
                );
            }
        }
    }

    #[test]
    fn both_passes_use_the_same_rounded_numbers_for_all_widths() {
        for end in [1, 2, 3, 4, 5, 8, 13] {
            // The rows of 13 + 3 and of 13 + 35 nodes end at the end of a strip.
            for below_end in [0, 1, 3, 9, 35] {
                both_passes_use_the_rounded_numbers(&Supernode {
                    first: 0,
                    end,
                    below_start: 0,
                    below_end,
                });
            }
        }
    }
}
