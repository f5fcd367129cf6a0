//! Curves with as many points as a picture shows.

/// The smallest and the largest of the values of several ticks of `period` (s), in their order in time: no peak is lost. At
/// most about `points` points.
pub(crate) fn thin(period: f64, values: &[f64], points: usize) -> Vec<(f64, f64)> {
    let every = (2 * values.len()).div_ceil(points).max(1);
    let mut kept = Vec::new();
    for (number, chunk) in values.chunks(every).enumerate() {
        let each = || chunk.iter().enumerate();
        let low = each().min_by(|a, b| a.1.total_cmp(b.1));
        let high = each().max_by(|a, b| a.1.total_cmp(b.1));
        let mut both: Vec<_> = [low, high].into_iter().flatten().collect();
        both.sort_unstable_by_key(|(at, _)| *at);
        both.dedup_by_key(|(at, _)| *at);
        let place = |(at, value): (usize, &f64)| ((number * every + at) as f64 * period, *value);
        kept.extend(both.into_iter().map(place));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_lines_keep_peaks_and_order() {
        let mut values: Vec<f64> = (0..10_000).map(|k| (f64::from(k) * 0.01).sin()).collect();
        values[1234] = 7.0;
        values[5678] = -7.0;
        let points = thin(0.5, &values, 320);
        assert!(points.len() <= 322, "{}", points.len());
        assert!(points.contains(&(617.0, 7.0)) && points.contains(&(2839.0, -7.0)));
        assert!(points.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!(thin(0.5, &[1.0, 2.0], 320), [(0.0, 1.0), (0.5, 2.0)]);
        assert_eq!(thin(0.5, &[], 320), []);
    }
}
