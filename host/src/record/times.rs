//! Distributions of measured times.

use serde::{Deserialize, Serialize};

/// Number of values from which on a ten-thousandth of them is at least one value.
const ENOUGH_FOR_P99_99: u64 = 10_000;

/// A distribution of times (s).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Number of values.
    pub count: u64,
    /// Smallest.
    pub min: f64,
    /// Median: half of the values lie at or below this time.
    pub p50: f64,
    /// 99 % of the values lie at or below this time.
    pub p99: f64,
    /// 99.9 % of the values lie at or below this time.
    pub p99_9: f64,
    /// 99.99 % of the values lie at or below this time; `None` for fewer than 10,000 values.
    pub p99_99: Option<f64>,
    /// Largest.
    pub max: f64,
    /// Values beyond the histogram's bound.
    pub overflow: u64,
}

impl From<runner::latency::Summary> for Distribution {
    /// Converts nanoseconds to seconds.
    fn from(s: runner::latency::Summary) -> Self {
        let seconds = |ns: u64| ns as f64 * 1e-9;
        Self {
            count: s.count,
            min: seconds(s.min),
            p50: seconds(s.p50),
            p99: seconds(s.p99),
            p99_9: seconds(s.p99_9),
            p99_99: (s.count >= ENOUGH_FOR_P99_99).then(|| seconds(s.p99_99)),
            max: seconds(s.max),
            overflow: s.overflow,
        }
    }
}
