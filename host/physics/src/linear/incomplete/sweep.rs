//! The forward and the backward pass through an incomplete factor.
//!
//! Both passes read the blocks in their order in memory, once ascending and once descending. The rows of a block are
//! read as vectors of four. The fourth number is the first of the next row and has no effect: the forward pass
//! multiplies it by the zero that pads a node, and the backward pass clears its result.

use super::blocks::{BLOCK, PADDING};
use crate::lanes::Node;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// A block with the numbers that are read past its end.
type Read = [f32; BLOCK + PADDING];

/// Adds the products of `block` and `x` to the rows of `sums`, lane by lane. The caller sums the lanes.
#[inline(always)]
fn add_rows(sums: &mut [Node<f32>; 3], block: &Read, x: &Node<f32>) {
    for row in 0..3 {
        for i in 0..4 {
            sums[row][i] += block[3 * row + i] * x[i];
        }
    }
}

/// `block^T x`. The fourth component is meaningless.
#[inline(always)]
fn transposed(block: &Read, x: &Node<f32>) -> Node<f32> {
    core::array::from_fn(|i| (block[i] * x[0] + block[3 + i] * x[1]) + block[6 + i] * x[2])
}

/// Solves in place: first `L y = r` by rows, then `L^T x = y` by rows in reverse, where each row is subtracted from the
/// rows before it.
///
/// `row_end` and `columns` describe the blocks before the diagonal. In `values`, the inverse diagonal block of a row
/// follows the blocks of that row.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx2", "x86_64+avx2"))
)]
pub(crate) fn solve(row_end: &[u32], columns: &[u32], values: &[f32], r: &mut [Node<f32>]) {
    let mut rest = values;
    let mut start = 0;
    for (row, &end) in row_end.iter().enumerate() {
        let end = end as usize;
        let mut sums = [[0.0; 4]; 3];
        for &column in &columns[start..end] {
            let Some(block) = rest.first_chunk() else {
                return;
            };
            add_rows(&mut sums, block, &r[column as usize]);
            rest = &rest[BLOCK..];
        }
        let Some(inverse) = rest.first_chunk::<{ BLOCK + PADDING }>() else {
            return;
        };
        rest = &rest[BLOCK..];
        let mut left = [0.0; 4];
        for i in 0..3 {
            left[i] = r[row][i] - ((sums[i][0] + sums[i][1]) + sums[i][2]);
        }
        let mut sums = [[0.0; 4]; 3];
        add_rows(&mut sums, inverse, &left);
        for i in 0..3 {
            r[row][i] = (sums[i][0] + sums[i][1]) + sums[i][2];
        }
        r[row][3] = 0.0;
        start = end;
    }
    let mut end = columns.len();
    for row in (0..row_end.len()).rev() {
        let start = row.checked_sub(1).map_or(0, |row| row_end[row] as usize);
        let blocks = &values[BLOCK * (start + row)..BLOCK * (end + row + 1) + PADDING];
        let columns = &columns[start..end];
        let Some(inverse) = blocks.last_chunk() else {
            return;
        };
        let mut x = transposed(inverse, &r[row]);
        x[3] = 0.0;
        r[row] = x;
        for (at, &column) in columns.iter().enumerate() {
            let Some(block) = blocks[BLOCK * at..].first_chunk() else {
                return;
            };
            let part = transposed(block, &x);
            let y = &mut r[column as usize];
            for i in 0..4 {
                y[i] -= part[i];
            }
        }
        end = start;
    }
}
