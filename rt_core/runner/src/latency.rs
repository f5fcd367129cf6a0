//! Histograms of times: the lateness of the tick, the duration of the tick, and the age of the local models.
//!
//! A histogram gets its memory and its bounds when it is made, and every page of its memory is written then. On the hot
//! path, recording is an index and an increment: it never allocates, resizes or fails. Values beyond the bound have a
//! count of their own, and still enter count, mean and maximum, so no value is lost.

mod recorder;

use hdrhistogram::Histogram;

pub use recorder::{LatencyReader, LatencyRecorder, recorder};

/// Significant digits of a histogram: a value is known to one part in a thousand.
const DIGITS: u8 = 3;

/// A histogram of times in ns.
///
/// ```
/// use runner::latency::LatencyHistogram;
///
/// let mut lateness = LatencyHistogram::new(1_000_000);
/// for ns in 1..=1000 {
///     lateness.record(ns);
/// }
/// lateness.record(2_000_000); // beyond the bound
/// let summary = lateness.summary();
/// assert_eq!((summary.count, summary.overflow), (1001, 1));
/// assert_eq!((summary.min, summary.max), (1, 2_000_000));
/// assert_eq!(summary.p50, 501);
/// ```
#[derive(Clone, Debug)]
pub struct LatencyHistogram {
    counts: Histogram<u64>,
    bound: u64,
    overflow: u64,
    min: u64,
    max: u64,
    /// Sum of all values: 584 years of nanoseconds before it saturates.
    sum: u64,
}

/// The summary of a histogram. Times in ns; all zero if no value was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Number of values, including those beyond the bound.
    pub count: u64,
    /// Number of values beyond the bound.
    pub overflow: u64,
    /// Smallest value, exact (ns).
    pub min: u64,
    /// Median (ns). The median and the next four quantiles are known to one part in a thousand.
    pub p50: u64,
    /// 90 % of the values lie at or below this one (ns).
    pub p90: u64,
    /// 99 % of the values lie at or below this one (ns).
    pub p99: u64,
    /// 99.9 % of the values lie at or below this one (ns).
    pub p99_9: u64,
    /// 99.99 % of the values lie at or below this one (ns).
    pub p99_99: u64,
    /// Largest value, exact even beyond the bound (ns).
    pub max: u64,
    /// Mean (ns).
    pub mean: f64,
}

impl LatencyHistogram {
    /// A histogram for values up to `bound_ns`, ten at least. This allocates (about 170 KB for a bound of one second).
    pub fn new(bound_ns: u64) -> Self {
        let bound = bound_ns.max(10);
        let Ok(mut counts) = Histogram::new_with_bounds(1, bound, DIGITS) else {
            unreachable!(
                "a lower bound of 1, an upper of 10 or more and 3 digits are always possible"
            )
        };
        // Fresh memory is mapped on first use. Writing the memory here keeps the mapping out of the tick.
        counts.clear();
        Self {
            counts,
            bound,
            overflow: 0,
            min: u64::MAX,
            max: 0,
            sum: 0,
        }
    }

    /// Counts one value (ns). Never allocates.
    pub fn record(&mut self, ns: u64) {
        if ns > self.bound || self.counts.record(ns).is_err() {
            self.overflow += 1;
        }
        self.min = self.min.min(ns);
        self.max = self.max.max(ns);
        self.sum = self.sum.saturating_add(ns);
    }

    /// Number of values, including those beyond the bound.
    pub fn count(&self) -> u64 {
        self.counts.len() + self.overflow
    }

    /// Number of values beyond the bound.
    pub fn overflow(&self) -> u64 {
        self.overflow
    }

    /// The largest value that the histogram distinguishes from others (ns).
    pub fn bound_ns(&self) -> u64 {
        self.bound
    }

    /// The value at or below which a fraction `quantile` (from zero to one) of all values lies (ns). If that value lies
    /// beyond the bound, the largest value. Zero if no value was recorded.
    pub(crate) fn value_at(&self, quantile: f64) -> u64 {
        let count = self.count();
        if count == 0 {
            return 0;
        }
        // By rank, so that values beyond the bound rank above all others.
        let rank = ((quantile * count as f64).ceil() as u64).clamp(1, count);
        let within = self.counts.len();
        if rank > within {
            return self.max;
        }
        // Half a rank less: rounding must not lead to the next value.
        let value = self
            .counts
            .value_at_quantile((rank as f64 - 0.5) / within as f64);
        value.clamp(self.min, self.max)
    }

    /// The summary of all values.
    pub fn summary(&self) -> Summary {
        let count = self.count();
        if count == 0 {
            return Summary::default();
        }
        Summary {
            count,
            overflow: self.overflow,
            min: self.min,
            p50: self.value_at(0.5),
            p90: self.value_at(0.9),
            p99: self.value_at(0.99),
            p99_9: self.value_at(0.999),
            p99_99: self.value_at(0.9999),
            max: self.max,
            mean: self.sum as f64 / count as f64,
        }
    }

    /// The distribution, in ascending order: upper edge (ns) and count of each interval that holds values. Values
    /// beyond the bound are left out.
    pub fn intervals(&self) -> impl Iterator<Item = (u64, u64)> {
        self.counts
            .iter_recorded()
            .map(|step| (step.value_iterated_to(), step.count_at_value()))
    }
}

/// The histograms of one run.
#[derive(Clone, Debug)]
pub struct Latencies {
    /// Lateness of each tick (ns after its deadline).
    pub lateness: LatencyHistogram,
    /// Duration of each tick, from waking to the last write (ns). Only [`crate::thread`] measures it, and gives it at the
    /// end of the run.
    pub tick_time: LatencyHistogram,
    /// Time in which the wrenches were computed: from the last read to just before the first write. Empty under virtual time.
    pub compute: LatencyHistogram,
    /// Age of the local model in use at each tick (ns), by body. Empty before the first model.
    pub model_age: Vec<LatencyHistogram>,
    /// Times of the devices, in the controller's order. Empty unless [`crate::thread`] measures them.
    pub devices: Vec<DeviceTimes>,
}

/// The histograms of one device.
#[derive(Clone, Debug)]
pub struct DeviceTimes {
    /// Duration of each read (ns).
    pub read: LatencyHistogram,
    /// Duration of each write (ns). A device with a thread of its own only hands its wrench over.
    pub write: LatencyHistogram,
    /// Time from the reading of the encoders to the force that answers it (ns), in the clock of the device. Empty if
    /// the device does not report this time.
    pub motion_to_force: LatencyHistogram,
}

impl DeviceTimes {
    /// Empty histograms.
    pub fn new() -> Self {
        let [read, write, motion_to_force] =
            [(); 3].map(|()| LatencyHistogram::new(Latencies::TICK_BOUND_NS));
        Self {
            read,
            write,
            motion_to_force,
        }
    }
}

impl Default for DeviceTimes {
    fn default() -> Self {
        Self::new()
    }
}

impl Latencies {
    /// Bound of lateness and tick time (ns): a second.
    pub(crate) const TICK_BOUND_NS: u64 = 1_000_000_000;
    /// Bound of model ages (ns): ten seconds.
    pub(crate) const AGE_BOUND_NS: u64 = 10_000_000_000;

    /// Empty histograms for a run with `bodies` connected bodies.
    pub fn new(bodies: usize) -> Self {
        Self {
            lateness: LatencyHistogram::new(Self::TICK_BOUND_NS),
            compute: LatencyHistogram::new(Self::TICK_BOUND_NS),
            tick_time: LatencyHistogram::new(Self::TICK_BOUND_NS),
            model_age: (0..bodies)
                .map(|_| LatencyHistogram::new(Self::AGE_BOUND_NS))
                .collect(),
            devices: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_record_is_counted_once_within_or_beyond() {
        let mut histogram = LatencyHistogram::new(1_000);
        for ns in 0..3_000 {
            histogram.record(ns);
        }
        assert_eq!(histogram.count(), 3_000);
        // Values from 0 to 1000 are within the bound.
        assert_eq!(histogram.overflow(), 1_999);
        let within: u64 = histogram.intervals().map(|(_, count)| count).sum();
        assert_eq!(within + histogram.overflow(), histogram.count());
        let summary = histogram.summary();
        assert_eq!((summary.min, summary.max), (0, 2_999));
        assert_eq!(summary.mean, 1_499.5);
        // A third of the values lies within. Above the bound, only the largest value is known.
        assert_eq!((summary.p50, histogram.value_at(0.25)), (2_999, 749));
    }

    #[test]
    fn a_value_within_the_bound_is_known_though_others_lie_beyond() {
        let mut histogram = LatencyHistogram::new(1_000);
        histogram.record(10);
        histogram.record(2_000);
        assert_eq!(histogram.value_at(0.5), 10);
        assert_eq!(histogram.value_at(0.51), 2_000);
    }

    #[test]
    fn percentiles_of_a_ramp_are_known_to_three_digits() {
        let mut histogram = LatencyHistogram::new(Latencies::TICK_BOUND_NS);
        for us in 1..=10_000 {
            histogram.record(us * 1_000);
        }
        for (quantile, exact) in [
            (0.5, 5e6),
            (0.9, 9e6),
            (0.99, 9.9e6),
            (0.999, 9.99e6),
            (1.0, 1e7),
        ] {
            let value = histogram.value_at(quantile) as f64;
            assert!((value / exact - 1.0).abs() < 1e-3, "{quantile}: {value}");
        }
    }

    #[test]
    fn an_empty_histogram_has_zeros() {
        assert_eq!(LatencyHistogram::new(0).summary(), Summary::default());
        assert_eq!(LatencyHistogram::new(0).bound_ns(), 10);
    }
}
