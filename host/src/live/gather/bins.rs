//! The intervals of a histogram, regrouped for a picture: four an octave.

use crate::live::Bins;
use runner::latency::LatencyHistogram;

/// The histogram in bins of a quarter of an octave. Values beyond the bound of the histogram are in the bin of the
/// greatest value.
pub(super) fn bins(histogram: &LatencyHistogram) -> Bins {
    let mut bins: Vec<(u64, u64)> = Vec::new();
    let mut push = |value: u64, count: u64| {
        let edge = upper_edge(value);
        match bins.last_mut() {
            Some(last) if last.0 == edge => last.1 += count,
            _ => bins.push((edge, count)),
        }
    };
    for (value, count) in histogram.intervals() {
        push(value, count);
    }
    if histogram.overflow() > 0 {
        push(histogram.summary().max, histogram.overflow());
    }
    Bins(bins)
}

/// The greatest value in the bin of `value` (ns): the integer part of `2^(k/4)` for the smallest `k` that encloses the
/// value.
fn upper_edge(value: u64) -> u64 {
    if value <= 1 {
        return value;
    }
    let octave = f64::from(value.ilog2()).exp2();
    (0..=4)
        .map(|quarter| (octave * (f64::from(quarter) / 4.0).exp2()) as u64)
        .find(|edge| *edge >= value)
        .unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octave_has_four_bins() {
        let edges: Vec<u64> = (1_025..=2_048).map(upper_edge).collect();
        assert!(edges.is_sorted());
        let mut distinct = edges;
        distinct.dedup();
        // 1024 times the fourth root of two, its powers, without their fractions.
        assert_eq!(distinct, [1_217, 1_448, 1_722, 2_048]);
        assert_eq!(
            [0, 1, 2, 3, 4, 5].map(upper_edge),
            [0, 1, 2, 3, 4, 5],
            "small bins are single values"
        );
        assert_eq!(upper_edge(u64::MAX), u64::MAX);
    }

    #[test]
    fn no_value_is_lost_and_edges_increase() {
        let mut histogram = LatencyHistogram::new(1_000_000);
        for k in 0..3_000_u64 {
            histogram.record(k * k / 3);
        }
        let Bins(bins) = bins(&histogram);
        let total: u64 = bins.iter().map(|bin| bin.1).sum();
        assert_eq!(total, 3_000);
        assert!(histogram.overflow() > 0);
        assert!(bins.is_sorted_by(|a, b| a.0 < b.0), "{bins:?}");
        // Twenty-two octaves have at most 88 bins.
        assert!(bins.len() < 88);
    }
}
