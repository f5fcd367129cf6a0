//! The limits of the machine on one thread: reading from memory, and multiplying and adding.

use super::clock::{Times, cpu_time};
use physics::Precision;
use physics::cost::ceiling::{SIDE, multiply_and_add, sum};
use std::hint::black_box;

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

/// Multiplications and additions in a second; measured for `time` (s). The larger rate of wide and narrow registers is the
/// machine's.
pub(super) fn peak<T: Precision>(time: f64) -> f64 {
    let rate = |narrow| {
        let (_, once) = median(0.5 * time, || {
            multiply_and_add::<T>(narrow);
        });
        multiply_and_add::<T>(narrow) as f64 / once
    };
    rate(false).max(rate(true))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limits_are_numbers() {
        assert!(bandwidth(1 << 12, 0.0).is_finite() && peak::<f32>(0.0).is_finite());
    }
}
