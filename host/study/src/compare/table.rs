//! The forces and positions of all runs as one table (CSV).

use super::{Comparison, Record};
use host::table::{Columns, Line};

/// The ticks of all runs, one line for each tick: the time (s), then force (N) and position (m) of each device under each
/// scheme and in the reference, in the axes of the device. Columns have names such as `capped_250_Hz_left_force_x_N`, as
/// in the table of a run.
pub fn csv(found: &Comparison) -> String {
    let mut records: Vec<(String, &Record)> = Vec::new();
    let reference = found.reference_record.as_ref();
    records.extend(reference.map(|record| ("reference".to_owned(), record)));
    for run in &found.runs {
        let name = format!("{} {} Hz", run.scheme, run.publish_rate);
        records.push((name, &run.record));
    }
    let Some((_, first)) = records.first() else {
        return "time_s\n".to_owned();
    };
    let names = found
        .runs
        .first()
        .map(|run| &run.measures)
        .or(found.reference.as_ref());
    let names: Vec<_> = names.map_or_else(Vec::new, |measures| {
        measures
            .devices
            .iter()
            .map(|device| device.name.clone())
            .collect()
    });
    let mut columns = Columns::default();
    columns.add("", "time_s");
    for (record, _) in &records {
        for device in &names {
            let of = format!("{record} {device}");
            columns.vector(&of, "force", "N");
            columns.vector(&of, "position", "m");
        }
    }
    let mut text = columns.header();
    let mut line = Line::default();
    for tick in 0..first.out.len() {
        line.clear();
        line.seconds((1e9 * tick as f64 * first.period).round() as u64);
        for (_, record) in &records {
            for device in &record.devices {
                for value in [device.force.get(tick), device.position.get(tick)] {
                    line.numbers(value.copied().unwrap_or_default().iter().copied());
                }
            }
        }
        text.push_str(line.end());
    }
    text
}
