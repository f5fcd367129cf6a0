//! The distribution of lateness as the realtime community draws it: time in microseconds against the number of deadlines, on
//! a logarithmic axis, all loads together. (The plots of cyclictest by the Open Source Automation Development Lab.)

use super::result::{Latency, Time};
use host::plot::{Picture, Series, line_chart};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Ratio of the longest to the smallest lateness from which on the time has a logarithmic axis.
const WIDE: f64 = 50.0;
/// The bottom of the chart, below one deadline.
const BOTTOM: f64 = 0.5;

/// The chart of the lateness under all loads.
pub fn chart(latency: &Latency) -> Picture {
    let lateness = || {
        latency
            .loads
            .iter()
            .filter_map(|load| Some((load, load.times.first()?)))
    };
    let longest = lateness().map(|(_, time)| time.max).fold(0.0, f64::max);
    let least = lateness()
        .map(|(_, time)| time.min)
        .fold(f64::INFINITY, f64::min);
    let series: Vec<_> = lateness()
        .map(|(load, time)| Series {
            name: format!("{}, longest {:.0} µs", load.load, 1e6 * time.max),
            points: staircase(time),
            ..Series::default()
        })
        .collect();
    let title = format!("{}: lateness of the wake-up", latency.scene);
    let wide = longest > WIDE * least;
    line_chart(
        &title,
        "Lateness (µs)",
        "Deadlines a microsecond",
        wide,
        true,
        &series,
    )
}

/// A stair for each microsecond that has deadlines.
fn staircase(time: &Time) -> Vec<(f64, f64)> {
    let mut bins: BTreeMap<u64, u64> = BTreeMap::new();
    for &(edge, count) in &time.histogram {
        *bins.entry((1e6 * edge).floor() as u64).or_default() += count;
    }
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (bin, count) in bins {
        let (from, to) = (bin as f64, (bin + 1) as f64);
        // A logarithmic axis has no zero.
        let from = from.max(0.1);
        if points.last().is_none_or(|last| last.0 < from) {
            points.extend(points.last().map(|last| (last.0, BOTTOM)));
            points.push((from, BOTTOM));
        }
        points.extend([(from, count as f64), (to, count as f64)]);
    }
    points.extend(points.last().map(|last| (last.0, BOTTOM)));
    points
}

/// Every interval of every histogram that has values, as CSV.
pub fn table(latency: &Latency) -> String {
    let mut text = String::from("load,time,up_to_s,count,count_up_to,fraction_above\n");
    for load in &latency.loads {
        for time in &load.times {
            let names = [&load.load, &time.name].map(|name| host::table::quoted(name));
            let mut up_to = 0;
            for (edge, count) in &time.histogram {
                up_to += count;
                let above = (time.count - up_to) as f64 / time.count as f64;
                // Writing to a string does not fail.
                let _ = writeln!(
                    text,
                    "{},{},{edge:.9},{count},{up_to},{above:.6e}",
                    names[0], names[1]
                );
            }
        }
    }
    text
}
