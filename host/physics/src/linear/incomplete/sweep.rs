//! The forward and the backward pass through an incomplete factor.
//!
//! Both read the same blocks in the order in which they lie in memory, once ascending and once descending. Rows of a
//! block are vectors of four, the last of which is the next row's first and comes to nothing: forward it meets the zero
//! that fills a node, backward it is cleared.

use super::blocks::{BLOCK, PADDING};
use crate::lanes::Node;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// A block as it is read.
type Read = [f32; BLOCK + PADDING];

/// `block . x`, lane by lane and not yet summed, added to the rows of `sums`.
#[inline(always)]
fn add_rows(sums: &mut [Node<f32>; 3], block: &Read, x: &Node<f32>) {
    for row in 0..3 {
        for i in 0..4 {
            sums[row][i] += block[3 * row + i] * x[i];
        }
    }
}

/// `block^T x`; the last is of no use.
#[inline(always)]
fn transposed(block: &Read, x: &Node<f32>) -> Node<f32> {
    core::array::from_fn(|i| (block[i] * x[0] + block[3 + i] * x[1]) + block[6 + i] * x[2])
}

/// Solves in place: `L y = r` by rows, then `L^T x = y` by rows again, each taking its part off those before it.
///
/// `row_end` and `columns` are of the blocks before the diagonal; `values` has each row's inverse diagonal block after
/// those.
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
