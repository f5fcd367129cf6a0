//! Processor time of the calling thread, and the distribution of the times of one step.

use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

/// Processor time of this thread (s). The time of other programs is not included. A reading takes a system call, some
/// 0.3 us.
pub(crate) fn cpu_time() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

/// The distribution of the times of a step (s).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// Number of times.
    pub count: usize,
    /// Median.
    pub median: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile; the longest of fewer than 1000 times.
    pub p999: f64,
    /// The longest time.
    pub worst: f64,
}

impl Times {
    /// The distribution of `times`; not a number if there are none.
    pub(crate) fn of(mut times: Vec<f64>) -> Self {
        times.sort_unstable_by(f64::total_cmp);
        let at = |fraction: f64| {
            // The least time that the fraction `fraction` of all times does not exceed.
            let rank = libm::ceil(fraction * times.len() as f64) as usize;
            times
                .get(rank.saturating_sub(1))
                .copied()
                .unwrap_or(f64::NAN)
        };
        Self {
            count: times.len(),
            median: at(0.5),
            p99: at(0.99),
            p999: at(0.999),
            worst: at(1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_ranks() {
        let times = Times::of((1..=1000).rev().map(f64::from).collect());
        assert_eq!(times.count, 1000);
        assert_eq!(
            [times.median, times.p99, times.p999, times.worst],
            [500.0, 990.0, 999.0, 1000.0]
        );
        let one = Times::of(vec![3.0]);
        assert_eq!([one.median, one.p999], [3.0, 3.0]);
        assert!(Times::of(Vec::new()).median.is_nan());
    }

    #[test]
    fn the_clock_runs_forward_while_the_thread_works() {
        let start = cpu_time();
        // The loop ends when the clock has advanced. It would not end with a clock that stands still.
        while cpu_time() <= start {}
    }
}
