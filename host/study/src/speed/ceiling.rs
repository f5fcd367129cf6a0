//! What the machine can do at most, on one thread: read from memory, and multiply and add.

use super::clock::{Times, cpu_time};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;
use physics::Real;
use std::hint::black_box;

/// Numbers read side by side: sixteen of the widest registers of `f64`, enough to hide what a sum waits.
const SIDE: usize = 128;

/// Rounds of a measurement.
const ROUNDS: usize = 2000;

/// Processor time of `work` (s): the median of so many samples as take `time` (s) together, at least three. A sample
/// is as many calls as take 0.1 ms, so that reading the clock does not count.
pub(super) fn median(time: f64, mut work: impl FnMut()) -> (usize, f64) {
    let start = cpu_time();
    work();
    let once = (cpu_time() - start).max(1e-9);
    let calls = (1e-4 / once).ceil().clamp(1.0, 1e5) as usize;
    let mut times = Vec::new();
    let begin = cpu_time();
    while times.len() < 3 || cpu_time() - begin < time {
        let start = cpu_time();
        for _ in 0..calls {
            work();
        }
        times.push((cpu_time() - start) / calls as f64);
    }
    (calls * times.len(), Times::of(times).median)
}

/// Bytes that are read in a second from a block of `bytes`, again and again; measured for `time` (s).
pub(super) fn bandwidth(bytes: usize, time: f64) -> f64 {
    let count = (bytes / size_of::<f32>()).next_multiple_of(SIDE);
    let block = vec![1.0_f32; count];
    let (_, once) = median(time, || {
        black_box(sum(black_box(&block)));
    });
    (count * size_of::<f32>()) as f64 / once
}

/// The sum of a block, whose length is a multiple of [`SIDE`].
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
fn sum(block: &[f32]) -> f32 {
    let mut sums = [0.0; SIDE];
    for part in block.as_chunks::<SIDE>().0 {
        for lane in 0..SIDE {
            sums[lane] += part[lane];
        }
    }
    sums.iter().sum()
}

/// Multiplications and additions that are made in a second, as many of one as of the other and none of them fused, as
/// the kernels'; measured for `time` (s).
///
/// Two units of either kind that take three or four cycles want eight of each in flight. Registers of 64 bytes come by
/// the 32; of narrower ones there are 16, of which those six and six leave some for the factor. The better of the two
/// is this machine's.
pub(super) fn peak<T: Real>(time: f64) -> f64 {
    if size_of::<T>() == size_of::<f32>() {
        rate::<T, 16, 8>(0.5 * time).max(rate::<T, 8, 6>(0.5 * time))
    } else {
        rate::<T, 8, 8>(0.5 * time).max(rate::<T, 4, 6>(0.5 * time))
    }
}

/// The same with so many chains of vectors of so many lanes.
fn rate<T: Real, const LANES: usize, const CHAINS: usize>(time: f64) -> f64 {
    let (start, one) = ([[T::of(1.0); LANES]; CHAINS], T::of(1.0));
    let (_, once) = median(time, || {
        black_box(multiply_and_add(black_box(&start), black_box(one)));
    });
    (2 * CHAINS * LANES * ROUNDS) as f64 / once
}

/// Independent chains of products by `one` and of sums with it, in registers. Where they start is not known to the
/// compiler, which would make one chain of equal ones; and lanes are outside of chains, for otherwise it makes vectors
/// of some numbers of them only.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets(
        "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi1+bmi2",
        "x86_64+avx2+bmi1+bmi2"
    ))
)]
fn multiply_and_add<T: Real, const LANES: usize, const CHAINS: usize>(
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
    fn what_is_measured_is_done() {
        assert_eq!(sum(&[1.0; 3 * SIDE]), (3 * SIDE) as f32);
        // Products of ones, and as many ones added as there are rounds.
        let expected = (1 + 1 + ROUNDS) as f64;
        assert_eq!(multiply_and_add(&[[1.0; 8]; 6], 1.0), [[expected; 8]; 6]);
        assert!(bandwidth(1 << 12, 0.0).is_finite() && peak::<f32>(0.0).is_finite());
    }
}
