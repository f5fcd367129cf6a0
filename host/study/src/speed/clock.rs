//! Processor time of the calling thread, and what many times of one step say.

use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

/// Processor time of this thread (s): what other programs take meanwhile does not count. Reading it takes
/// a system call, some 0.3 us.
pub(super) fn cpu_time() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

/// Times of one step, taken many times (s).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Times {
    /// How many were taken.
    pub count: usize,
    /// Half are shorter.
    pub median: f64,
    /// 99 of 100 are shorter.
    pub p99: f64,
    /// 999 of 1000 are shorter; the longest where fewer were taken.
    pub p999: f64,
    /// The longest.
    pub worst: f64,
}

impl Times {
    /// Of any number of times; not a number where there are none.
    pub(super) fn of(mut times: Vec<f64>) -> Self {
        times.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| {
            // The least time that `share` of all do not exceed.
            let rank = libm::ceil(share * times.len() as f64) as usize;
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
        // Until it has: a clock that stands still would never let this end.
        while cpu_time() <= start {}
    }
}
