//! The forces and positions of all runs as one table (CSV).

use super::{Comparison, Record};
use host::table::quoted;
use std::fmt::Write;

/// The ticks of all runs, one line for each tick: the time (s), then force (N) and position (m) of each device under each
/// scheme and in the reference, in the axes of the device. Names of columns are such as `capped 250 Hz left force x`.
pub fn csv(found: &Comparison) -> String {
    let mut records: Vec<(String, &Record)> = Vec::new();
    let reference = found.reference_record.as_ref();
    records.extend(reference.map(|record| ("reference".to_owned(), record)));
    for run in &found.runs {
        let name = format!("{} {} Hz", run.scheme, run.publish_rate);
        records.push((name, &run.record));
    }
    let Some((_, first)) = records.first() else {
        return "time\n".to_owned();
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
    let mut text = String::from("time");
    for (record, _) in &records {
        for device in &names {
            for column in ["force", "position"] {
                for axis in ["x", "y", "z"] {
                    text.push(',');
                    text.push_str(&quoted(&format!("{record} {device} {column} {axis}")));
                }
            }
        }
    }
    for tick in 0..first.out.len() {
        let _ = write!(text, "\n{:.6}", tick as f64 * first.period);
        for (_, record) in &records {
            for device in &record.devices {
                let values = [device.force.get(tick), device.position.get(tick)];
                for value in values.map(|value| value.copied().unwrap_or_default()) {
                    let _ = write!(text, ",{:.6},{:.6},{:.6}", value.x, value.y, value.z);
                }
            }
        }
    }
    text + "\n"
}
