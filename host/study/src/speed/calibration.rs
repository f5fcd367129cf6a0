//! A small kernel by which times of one machine are scaled to another machine.
//!
//! The kernel is the product of a symmetric block-sparse matrix with a vector: 3 x 3 blocks on the edges of a grid of
//! 10 x 10 x 10 cells that are cut into tetrahedra, in double precision, on one thread. A C program of the same
//! arithmetic ran on the machine on which the times of the other programs were taken (gcc -O3 -march=native).

use super::clock::cpu_time;
use std::hint::black_box;

/// The time of the C program divided by the time of this translation, both taken in the same minute on one machine
/// (26.2 and 22.0 microseconds, AMD EPYC with AVX-512). Rust knows that the vectors do not overlap, and the wide
/// gathers of gcc do not pay.
const C_OVER_RUST: f64 = 1.19;

const NODES_ALONG: usize = 11;
const NODES: usize = NODES_ALONG * NODES_ALONG * NODES_ALONG;
const ATTEMPTS: usize = 300;
const REPEATS: usize = 20;

/// A vector that begins at a cache line, as in the C program. Otherwise the time depends by a fifth on the address at
/// which the heap begins.
#[repr(align(64))]
struct Aligned([[f64; 3]; NODES]);

struct Kernel {
    edges: Vec<[u32; 2]>,
    blocks: Vec<[f64; 9]>,
    diagonal: Vec<[f64; 9]>,
    x: Box<Aligned>,
    y: Box<Aligned>,
}

impl Kernel {
    fn new() -> Self {
        let number = |i: usize, j: usize, k: usize| (k * NODES_ALONG + j) * NODES_ALONG + i;
        let mut edges = Vec::new();
        for node in 0..NODES {
            let (i, j) = (node % NODES_ALONG, node / NODES_ALONG % NODES_ALONG);
            let k = node / (NODES_ALONG * NODES_ALONG);
            // The seven edges of a cell in Kuhn's split that start at the cell's corner.
            for side in 1..8 {
                let [a, b, c] = [i + (side & 1), j + (side >> 1 & 1), k + (side >> 2)];
                if [a, b, c].iter().all(|&at| at < NODES_ALONG) {
                    edges.push([node as u32, number(a, b, c) as u32]);
                }
            }
        }
        let block = |e: usize| core::array::from_fn(|r| 1e-3 * ((e * 31 + r * 17) % 101) as f64);
        Self {
            blocks: (0..edges.len()).map(block).collect(),
            edges,
            diagonal: vec![core::array::from_fn(|r| 1.0 + r as f64); NODES],
            x: Box::new(Aligned(core::array::from_fn(|n| {
                core::array::from_fn(|r| 1.0 / (1 + n + r) as f64)
            }))),
            y: Box::new(Aligned(core::array::from_fn(|_| [0.0; 3]))),
        }
    }

    /// `y = A x`.
    fn product(&mut self) {
        product(
            &self.diagonal,
            &self.blocks,
            &self.edges,
            &self.x.0,
            &mut self.y.0,
        );
    }
}

/// A function of its own, so that it is compiled identically for every caller.
#[inline(never)]
fn product(
    diagonal: &[[f64; 9]],
    blocks: &[[f64; 9]],
    edges: &[[u32; 2]],
    x: &[[f64; 3]],
    y: &mut [[f64; 3]],
) {
    for ((d, x), y) in diagonal.iter().zip(x).zip(y.iter_mut()) {
        for r in 0..3 {
            y[r] = d[3 * r] * x[0] + d[3 * r + 1] * x[1] + d[3 * r + 2] * x[2];
        }
    }
    for (b, &[from, to]) in blocks.iter().zip(edges) {
        let (from, to) = (from as usize, to as usize);
        let (u, v) = (x[from], x[to]);
        let p = &mut y[from];
        for r in 0..3 {
            p[r] += b[3 * r] * v[0] + b[3 * r + 1] * v[1] + b[3 * r + 2] * v[2];
        }
        let q = &mut y[to];
        for r in 0..3 {
            q[r] += b[r] * u[0] + b[3 + r] * u[1] + b[6 + r] * u[2];
        }
    }
}

/// The least time of one product on this machine, scaled to the C program (s).
pub(super) fn measure() -> f64 {
    let mut kernel = Kernel::new();
    let mut least = f64::INFINITY;
    for _ in 0..ATTEMPTS {
        let start = cpu_time();
        for _ in 0..REPEATS {
            kernel.product();
            black_box(&mut kernel.y.0);
        }
        least = least.min((cpu_time() - start) / REPEATS as f64);
    }
    least * C_OVER_RUST
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_is_the_c_program_s() {
        let mut kernel = Kernel::new();
        // The number of edges and the sum that the C program prints: in every attempt, one entry after each repeat.
        assert_eq!(kernel.edges.len(), 7930);
        kernel.product();
        let entries = (0..ATTEMPTS).map(|attempt| kernel.y.0[attempt % NODES][0]);
        let sum = REPEATS as f64 * entries.sum::<f64>();
        assert!((sum - SUM).abs() < 5e-4, "{sum}");
    }

    /// The sum of the C program, to the three decimals that it prints.
    const SUM: f64 = 770.254;
}
