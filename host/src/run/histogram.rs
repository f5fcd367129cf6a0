//! Distributions of lateness, tick time and model age as a file: every interval of the histograms as CSV, or a picture.
//!
//! The picture is the one that papers on latency draw: on logarithmic axes, the fraction of ticks that were later (took
//! longer) than a time. A rare long delay, which a histogram with linear axes hides, stands at the right end.

use crate::atomic_file::{AtomicFileError, write_atomically};
use crate::plot::{Picture, Role, Series, line_chart, write_picture};
use crate::scene::Scene;
use crate::table::quoted;
use runner::latency::{Latencies, LatencyHistogram};
use std::fmt::Write as _;
use std::path::Path;

/// Writes the distributions of a run of `scene` to `path`: a picture if the name ends in `.svg` or `.png`, else CSV.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write(
    path: &Path,
    scene: &Scene,
    latencies: &Latencies,
) -> Result<(), AtomicFileError> {
    let mut all = vec![
        ("lateness".to_owned(), &latencies.lateness),
        ("tick time".to_owned(), &latencies.tick_time),
    ];
    let ages = scene.bodies.iter().zip(&latencies.model_age);
    all.extend(ages.map(|(body, age)| (format!("model age of {}", body.name), age)));
    all.retain(|(_, histogram)| histogram.count() > 0);
    let ending = path.extension().unwrap_or_default();
    let drawn = ["svg", "png"].map(|picture| ending.eq_ignore_ascii_case(picture));
    if drawn.contains(&true) {
        // The age of models is of another kind: it is planned, and a thousand times as large.
        let period = 1e6 / scene.realtime.rate;
        let drawn = &all[..all.len().min(2)];
        write_picture(path, &picture(&scene.name, period, drawn))
    } else {
        write_atomically(path, table(&all).as_bytes())
    }
}

/// The steps of a distribution, in ascending order: a time (ns), and the number of values up to this time, all smaller
/// ones included. The last step has all values; if values lie beyond the histogram, its time is the largest value.
fn steps(histogram: &LatencyHistogram) -> Vec<(u64, u64)> {
    let mut up_to = 0;
    let mut steps: Vec<_> = histogram
        .intervals()
        .map(|(edge, count)| {
            up_to += count;
            (edge, up_to)
        })
        .collect();
    let summary = histogram.summary();
    if summary.overflow > 0 {
        steps.push((summary.max, summary.count));
    }
    steps
}

/// A row for each interval that holds values.
fn table(all: &[(String, &LatencyHistogram)]) -> String {
    let mut text = String::from("quantity,up_to_s,count,count_up_to,fraction_above\n");
    for (name, histogram) in all {
        let name = quoted(name);
        let all = histogram.count();
        let mut before = 0;
        for (edge, up_to) in steps(histogram) {
            let seconds = edge as f64 * 1e-9;
            let count = up_to - before;
            let above = (all - up_to) as f64 / all as f64;
            // Writing to a string does not fail.
            let _ = writeln!(text, "{name},{seconds:.9},{count},{up_to},{above:.6e}");
            before = up_to;
        }
    }
    text
}

/// The fraction of values above a time, as a staircase on logarithmic axes, with a line at the period (us).
fn picture(scene: &str, period: f64, all: &[(String, &LatencyHistogram)]) -> Picture {
    let mut series: Vec<_> = all
        .iter()
        .map(|(name, histogram)| Series {
            name: format!("{name}, {} ticks", histogram.count()),
            points: staircase(histogram),
            ..Series::default()
        })
        .collect();
    let fractions = series.iter().flat_map(|one| &one.points);
    let least = fractions.fold(1.0, |least: f64, point| least.min(point.1));
    series.push(Series {
        name: "period of the ticks".to_owned(),
        points: vec![(period, least), (period, 1.0)],
        role: Role::Limit,
        ..Series::default()
    });
    let title = format!("{scene}: lateness and duration of the ticks");
    line_chart(
        &title,
        "Time (µs)",
        "Fraction of ticks above",
        true,
        true,
        &series,
    )
}

/// The corners of the staircase: time (us), and the fraction of values above it. The last step ends at one value, because
/// a logarithmic axis has no zero.
fn staircase(histogram: &LatencyHistogram) -> Vec<(f64, f64)> {
    let all = histogram.count() as f64;
    let mut points = Vec::new();
    let mut above = 1.0;
    for (edge, up_to) in steps(histogram) {
        // A logarithmic axis has no zero either: the clock counts whole nanoseconds.
        let us = edge.max(1) as f64 * 1e-3;
        points.push((us, above));
        above = (all - up_to as f64).max(1.0) / all;
        points.push((us, above));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 98 values of 1 us, one of 1 ms and one beyond the bound.
    fn histogram() -> LatencyHistogram {
        let mut histogram = LatencyHistogram::new(10_000_000);
        for _ in 0..98 {
            histogram.record(1_000);
        }
        histogram.record(1_000_000);
        histogram.record(50_000_000);
        histogram
    }

    #[test]
    fn the_table_counts_every_value_once() {
        let histogram = histogram();
        // The name of a body may hold a comma.
        let text = table(&[("model age of a, b".to_owned(), &histogram)]);
        assert!(
            text.contains("\n\"model age of a, b\",0.050000000,1,100,0.000000e0\n"),
            "{text}"
        );
        let text = table(&[("lateness".to_owned(), &histogram)]);
        let rows: Vec<Vec<&str>> = text.lines().map(|row| row.split(',').collect()).collect();
        assert_eq!(rows[0].len(), 5);
        let counts: Vec<u64> = rows[1..]
            .iter()
            .map(|row| row[2].parse().unwrap())
            .collect();
        assert_eq!(counts, [98, 1, 1]);
        assert_eq!(
            rows[3],
            ["lateness", "0.050000000", "1", "100", "0.000000e0"]
        );
        // An interval is known to one part in a thousand.
        let second: f64 = rows[2][1].parse().unwrap();
        assert!((second / 1e-3 - 1.0).abs() < 2e-3 && rows[2][4] == "1.000000e-2");
    }

    #[test]
    fn the_picture_has_a_line_at_the_period() {
        let histogram = histogram();
        let picture = picture("a", 1e3, &[("lateness".to_owned(), &histogram)]);
        assert_eq!(plot::collisions(&picture), [""; 0]);
        let svg = picture.svg();
        for text in ["Time (µs)", "lateness, 100 ticks", "period of the ticks"] {
            assert!(svg.contains(text), "{text}");
        }
    }

    #[test]
    fn the_staircase_falls_from_all_values_to_one() {
        let corners = staircase(&histogram());
        let fractions: Vec<f64> = corners.iter().map(|corner| corner.1).collect();
        assert_eq!(fractions, [1.0, 0.02, 0.02, 0.01, 0.01, 0.01]);
        assert!(corners.is_sorted_by(|a, b| a.0 <= b.0));
        assert_eq!(corners.last(), Some(&(50_000.0, 0.01)));
    }
}
