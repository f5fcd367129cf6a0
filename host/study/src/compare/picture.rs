//! The forces of all runs over time as a picture.

use super::{Comparison, Record, Run};
use crate::thin::thin;
use host::plot::{self, Panel, Picture, Role, Series};

/// Largest number of points of a line: more would not be visible.
const POINTS: usize = 320;

/// The force of each device over time along its main direction, one row of panels for each rate and device; beside it
/// the difference from the reference.
pub(super) fn picture(found: &Comparison) -> Picture {
    let mut rates: Vec<f64> = found.runs.iter().map(|run| run.publish_rate).collect();
    rates.dedup();
    let mut panels = Vec::new();
    for rate in rates {
        let runs = found.runs.iter().filter(|run| run.publish_rate == rate);
        let runs: Vec<_> = runs.collect();
        let devices = runs.first().map_or(0, |run| run.measures.devices.len());
        for device in 0..devices {
            panels.extend(row(found, &runs, device));
        }
    }
    let title = format!("{}: force schemes", found.scene);
    let subtitle = format!(
        "virtual time, seed {}; latency {:.1} ms; forces along the main direction of each device",
        found.seed,
        1e3 * found.latency
    );
    plot::panels(&title, &subtitle, 2, &panels)
}

/// The panels of one device in `runs`, which are of one rate: its force, and the difference from the reference.
fn row(found: &Comparison, runs: &[&Run], device: usize) -> Vec<Panel> {
    let reference = found.reference_record.as_ref();
    let first = &runs[0];
    let axis = reference.unwrap_or(&first.record).devices[device].main_direction();
    let along = |record: &Record| -> Vec<f64> {
        let force = record.devices[device].force.iter();
        force.map(|force| force.dot(&axis)).collect()
    };
    let line = |name: &str, role, from: f64, values: &[f64]| Series {
        name: name.to_owned(),
        points: thin(first.record.period, values, POINTS)
            .into_iter()
            .filter(|(time, _)| *time >= from)
            .collect(),
        role,
        ..Series::default()
    };
    let panel = |quantity: &str, series| Panel {
        title: format!(
            "{}, {} Hz: {}",
            first.measures.devices[device].name,
            first.publish_rate,
            quantity.to_lowercase()
        ),
        x_label: "Time (s)".to_owned(),
        y_label: format!("{quantity} (N)"),
        x_covers: vec![0.0, found.duration],
        series,
        ..Panel::default()
    };
    let expected = reference.map(along);
    // Errors are drawn as they are measured: without the time in which the first forces fade in.
    let from = found.measured_from;
    // The reference comes first: the others are drawn over it.
    let mut forces: Vec<_> = expected
        .iter()
        .map(|force| line("reference", Role::Reference, 0.0, force))
        .collect();
    let mut errors: Vec<_> = expected
        .iter()
        .map(|force| line("reference", Role::Reference, from, &vec![0.0; force.len()]))
        .collect();
    for run in runs {
        let force = along(&run.record);
        forces.push(line(run.scheme, Role::Scheme(run.scheme), 0.0, &force));
        if let Some(expected) = &expected {
            let pairs = force.iter().zip(expected);
            let off: Vec<_> = pairs.map(|(found, expected)| found - expected).collect();
            errors.push(line(run.scheme, Role::Scheme(run.scheme), from, &off));
        }
    }
    let mut panels = vec![panel("Force", forces)];
    if expected.is_some() {
        panels.push(panel("Force error", errors));
    }
    panels
}
