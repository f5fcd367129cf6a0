//! Work that reaches the limits of the machine on one thread: reading from memory, and multiplying and adding.
//!
//! The time of the work is measured by the studies. The work is compiled here, with the kernels that are compared with it.

use crate::lanes::Real;
use core::hint::black_box;
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// Numbers that are read side by side: sixteen of the widest registers of `f64`, enough to hide the latency of a sum.
pub const SIDE: usize = 128;

/// Rounds of [`multiply_and_add`].
const ROUNDS: usize = 2000;

/// The sum of a block, whose length is a multiple of [`SIDE`].
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
pub fn sum(block: &[f32]) -> f32 {
    let mut sums = [0.0; SIDE];
    for part in block.as_chunks::<SIDE>().0 {
        for lane in 0..SIDE {
            sums[lane] += part[lane];
        }
    }
    sums.iter().sum()
}

/// Multiplies and adds, in equal numbers and not fused, as in the kernels. Returns the number of operations.
///
/// Two units of either kind with a latency of three or four cycles need eight operations of each kind in flight. There
/// are 32 registers of 64 bytes. There are 16 `narrow`er registers, of which six and six leave some for the factor.
#[inline(never)]
pub fn multiply_and_add<T: Real>(narrow: bool) -> usize {
    match (size_of::<T>() == size_of::<f32>(), narrow) {
        (true, false) => operate::<T, 16, 8>(),
        (true, true) => operate::<T, 8, 6>(),
        (false, false) => operate::<T, 8, 8>(),
        (false, true) => operate::<T, 4, 6>(),
    }
}

/// The same with `CHAINS` chains of vectors of `LANES` lanes.
fn operate<T: Real, const LANES: usize, const CHAINS: usize>() -> usize {
    let start = [[T::of(1.0); LANES]; CHAINS];
    black_box(chains(black_box(&start), black_box(T::of(1.0))));
    2 * CHAINS * LANES * ROUNDS
}

/// Independent chains of products by `one` and of sums with `one`, in registers. The compiler does not know the start
/// values; it would merge chains with equal ones. The loop over lanes encloses the loop over chains; otherwise the
/// compiler vectorizes some of the numbers only.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
fn chains<T: Real, const LANES: usize, const CHAINS: usize>(
    start: &[[T; LANES]; CHAINS],
    one: T,
) -> [[T; LANES]; CHAINS] {
    let (mut products, mut sums) = (*start, *start);
    for _ in 0..ROUNDS {
        for lane in 0..LANES {
            for chain in 0..CHAINS {
                products[chain][lane] = products[chain][lane] * one;
                sums[chain][lane] += one;
            }
        }
    }
    for lane in 0..LANES {
        for chain in 0..CHAINS {
            products[chain][lane] += sums[chain][lane];
        }
    }
    products
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measured_work_is_done() {
        assert_eq!(sum(&[1.0; 3 * SIDE]), (3 * SIDE) as f32);
        // The product of ones, the sum's initial one, and a one for each round.
        let expected = (1 + 1 + ROUNDS) as f64;
        assert_eq!(chains(&[[1.0; 8]; 6], 1.0), [[expected; 8]; 6]);
    }
}
