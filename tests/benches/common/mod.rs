//! Common parts of the benchmarks: a clock that counts this thread alone, and medians with their spread.
#![allow(dead_code)]

use rustix::time::{ClockId, clock_gettime};
use std::fmt;

/// Whether to print the tables beside divan's. Only a plain `cargo bench` prints them: with a filter or any other
/// argument divan runs alone, and a test run measures no times.
pub(crate) fn tables_wanted() -> bool {
    std::env::args().skip(1).eq(["--bench"])
}

/// Processor time of this thread (s). The time of other programs is not included. A reading takes a system call, some
/// 0.3 us.
pub(crate) fn cpu_time() -> f64 {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + 1e-9 * now.tv_nsec as f64
}

/// Processor time of `body` (s), and the result of `body`.
pub(crate) fn timed<R>(body: impl FnOnce() -> R) -> (f64, R) {
    let start = cpu_time();
    let result = body();
    (cpu_time() - start, result)
}

/// A median, with the tenth and the ninetieth percentile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub(crate) p10: f64,
    pub(crate) median: f64,
    pub(crate) p90: f64,
}

impl Spread {
    /// The spread of `values`; not a number if there are none.
    pub(crate) fn of(mut values: Vec<f64>) -> Self {
        values.sort_unstable_by(f64::total_cmp);
        let at = |fraction: f64| {
            let last = values.len().saturating_sub(1) as f64;
            values
                .get((fraction * last).round() as usize)
                .copied()
                .unwrap_or(f64::NAN)
        };
        Self {
            p10: at(0.1),
            median: at(0.5),
            p90: at(0.9),
        }
    }

    /// The spread in a unit that is `factor` times smaller.
    pub(crate) fn times(&self, factor: f64) -> Self {
        Self {
            p10: self.p10 * factor,
            median: self.median * factor,
            p90: self.p90 * factor,
        }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(2);
        let Self { p10, median, p90 } = self;
        write!(f, "{median:.digits$} ({p10:.digits$} to {p90:.digits$})")
    }
}
