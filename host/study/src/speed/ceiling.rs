//! The limits of the machine on one thread: reading from memory, and multiplying and adding.

use super::clock::{Times, cpu_time};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;
use physics::Precision;
use std::hint::black_box;

/// Numbers that are read side by side: sixteen of the widest registers of `f64`, enough to hide the latency of a sum.
const SIDE: usize = 128;

/// Rounds of a measurement.
const ROUNDS: usize = 2000;

/// Number of calls of `work`, and the processor time of one call (s): the median over samples that take `time` (s)
/// together, at least three. A sample is as many calls as take 0.1 ms, so that reading the clock is negligible.
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

/// Bytes that are read in a second from a block of `bytes`, repeatedly; measured for `time` (s).
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

/// Multiplications and additions in a second, in equal numbers and not fused, as in the kernels; measured for `time`
/// (s).
///
/// Two units of either kind with a latency of three or four cycles need eight operations of each kind in flight. There
/// are 32 registers of 64 bytes. There are 16 narrower registers, of which six and six leave some for the factor. The
/// larger rate of the two is the machine's.
pub(super) fn peak<T: Precision>(time: f64) -> f64 {
    if size_of::<T>() == size_of::<f32>() {
        rate::<T, 16, 8>(0.5 * time).max(rate::<T, 8, 6>(0.5 * time))
    } else {
        rate::<T, 8, 8>(0.5 * time).max(rate::<T, 4, 6>(0.5 * time))
    }
}

/// The same with `CHAINS` chains of vectors of `LANES` lanes.
fn rate<T: Precision, const LANES: usize, const CHAINS: usize>(time: f64) -> f64 {
    let (start, one) = ([[T::of(1.0); LANES]; CHAINS], T::of(1.0));
    let (_, once) = median(time, || {
        black_box(multiply_and_add(black_box(&start), black_box(one)));
    });
    (2 * CHAINS * LANES * ROUNDS) as f64 / once
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
fn multiply_and_add<T: Precision, const LANES: usize, const CHAINS: usize>(
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
        assert_eq!(multiply_and_add(&[[1.0; 8]; 6], 1.0), [[expected; 8]; 6]);
        assert!(bandwidth(1 << 12, 0.0).is_finite() && peak::<f32>(0.0).is_finite());
    }
}
