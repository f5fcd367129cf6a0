//! Charts of a study, and of one of its cells.

use super::measure::{DeviceTrace, Outcome, Trace};
use super::summary::{Band, outcomes};
use super::{CellResult, SCHEMES};
use crate::stress::hold::{self, CellResult as HoldCell};
use host::plot::{self, Panel, Picture, Role, Scale, Series};
use std::collections::BTreeMap;

/// Largest number of points of a line over time: more would not be visible.
const POINTS: usize = 960;
/// Largest number of steps of a distribution: more would not be visible.
const STEPS: usize = 240;
/// Energies up to this bound are drawn together, before the logarithmic part of the axis (mJ). No hand feels them.
const LEAST_ENERGY: f64 = 1e-3;
/// The corresponding bound for errors (%), ripple (mN) and fractions (%).
const LEAST_ERROR: f64 = 1e-3;

/// A quantity of an outcome.
type Value = fn(&Outcome) -> f64;

/// The distributions of force error and net energy, for hosts at 20 and 30 Hz, at 60 Hz, and at higher rates.
pub(super) fn distributions(name: &str, cells: &BTreeMap<u64, CellResult>) -> Picture {
    let bands = [
        ("host at 20 and 30 Hz", Band::of(20.0, 30.0)),
        ("host at 60 Hz", Band::of(60.0, 60.0)),
        ("host at 125 to 1000 Hz", Band::of(125.0, 1000.0)),
    ];
    let values: [(&str, f64, Value); 2] = [
        ("Force error (%)", LEAST_ERROR, |o| 100.0 * o.error),
        ("Net energy (mJ)", LEAST_ENERGY, |o| 1e3 * o.net_energy),
    ];
    let mut panels = Vec::new();
    for (quantity, least, value) in values {
        let row = bands.map(|(label, band)| {
            let series = SCHEMES.iter().map(|(_, scheme)| {
                let found = outcomes(cells.iter(), scheme, band);
                distribution(scheme, found.iter().map(|(_, o)| value(o)).collect())
            });
            Panel {
                title: label.to_owned(),
                x_label: quantity.to_owned(),
                y_label: "Fraction of runs".to_owned(),
                x_scale: Scale::LogarithmicAbove(least),
                ..fractions(series)
            }
        });
        panels.extend(with_one_axis(row));
    }
    let title = format!("{name} under hands, rates and faults");
    let subtitle = format!(
        "distributions over the runs of {} trials: the fraction of runs up to a value",
        cells.len()
    );
    plot::panels(&title, &subtitle, 3, &panels)
}

/// The distributions of the study of holds: errors of the hold and of the run, ripple, and the fraction of ticks in
/// which the cap acts.
pub(in crate::stress) fn holds(cells: &BTreeMap<u64, HoldCell>) -> Picture {
    let values: [(&str, Value); 4] = [
        ("Error of the hold (%)", |o| {
            100.0 * o.force_errors.hold_error
        }),
        ("Error of the run, relative to its peak (%)", |o| {
            100.0 * o.force_errors.run_error
        }),
        ("Ripple in excess of the reference (mN)", |o| {
            1e3 * o.force_errors.worst_ripple
        }),
        ("Ticks capped (%)", |o| 100.0 * o.capped),
    ];
    let panels = values.map(|(quantity, value)| Panel {
        x_label: quantity.to_owned(),
        y_label: "Fraction of cells".to_owned(),
        x_scale: Scale::LogarithmicAbove(LEAST_ERROR),
        ..fractions(hold::SCHEMES.iter().map(|(_, scheme)| {
            let found = cells.values().filter_map(|cell| cell.schemes.get(*scheme));
            distribution(scheme, found.map(value).collect())
        }))
    });
    let subtitle = format!(
        "distributions over {} cells without faults: the fraction of cells up to a value",
        cells.len()
    );
    plot::panels("Presses, holds, rubs and tremors", &subtitle, 2, &panels)
}

/// A panel of distributions. A scheme that was not run has no line.
fn fractions(series: impl Iterator<Item = Series>) -> Panel {
    Panel {
        y_covers: vec![0.0, 1.0],
        series: series.filter(|one| !one.points.is_empty()).collect(),
        ..Panel::default()
    }
}

/// The panels of one quantity with one axis, so that they can be compared.
fn with_one_axis<const N: usize>(mut row: [Panel; N]) -> [Panel; N] {
    let series = row.iter().flat_map(|panel| &panel.series);
    let points = series.flat_map(|one| &one.points);
    let all: Vec<f64> = points.map(|point| point.0).collect();
    for panel in &mut row {
        panel.x_covers.clone_from(&all);
    }
    row
}

/// The cumulative distribution of `values` under a scheme, as steps: at each value, the fraction of the values up to it
/// rises.
fn distribution(scheme: &'static str, mut values: Vec<f64>) -> Series {
    // What a failed run did not measure is no value.
    values.retain(|value| !value.is_nan());
    values.sort_unstable_by(f64::total_cmp);
    let count = values.len();
    let every = count.div_ceil(STEPS).max(1);
    let mut points = Vec::new();
    let mut below = 0.0;
    for (i, value) in values.into_iter().enumerate() {
        if (i + 1) % every == 0 || i + 1 == count {
            let fraction = (i + 1) as f64 / count as f64;
            points.extend([(value, below), (value, fraction)]);
            below = fraction;
        }
    }
    Series {
        name: scheme.to_owned(),
        points,
        role: Role::Scheme(scheme),
        ..Series::default()
    }
}

const RUN: &str = "this run";
const REFERENCE: &str = "reference run";

/// One run beside its reference run: force and position of each device along the main direction of its force, and the
/// energy.
pub fn cell(title: &str, subtitle: &str, run: &Trace, reference: &Trace) -> Picture {
    let mut panels = Vec::new();
    let line = |name: &str, role, values: Vec<f64>| Series {
        name: name.to_owned(),
        points: thin(run.period, &values),
        role,
        ..Series::default()
    };
    let [
        reference_role,
        run_role,
        own_role,
        to_spend_role,
        stored_role,
    ] = [
        Role::Reference,
        Role::Number(1),
        Role::Number(2),
        Role::Number(0),
        Role::Number(4),
    ];
    let panel = |y_label: String, series| Panel {
        x_label: "Time (s)".to_owned(),
        y_label,
        // Zero is no force and no energy.
        y_covers: vec![0.0],
        series,
        ..Panel::default()
    };
    for (number, (device, expected)) in run.devices.iter().zip(&reference.devices).enumerate() {
        let axis = expected.main_direction();
        let along = |trace: &DeviceTrace| trace.force.iter().map(|f| f.dot(&axis)).collect();
        let own = device.own.iter().map(|own| own.force.dot(&axis));
        panels.push(panel(
            format!("Force of device {number} (N)"),
            vec![
                line(REFERENCE, reference_role, along(expected)),
                line(RUN, run_role, along(device)),
                line("the body's own along this run", own_role, own.collect()),
            ],
        ));
    }
    for (number, (device, expected)) in run.devices.iter().zip(&reference.devices).enumerate() {
        let axis = expected.main_direction();
        let along = |trace: &DeviceTrace| {
            let places = trace.position.iter();
            places.map(|p| 1e3 * p.dot(&axis)).collect()
        };
        let position = panel(
            format!("Position of device {number} (mm)"),
            vec![
                line(REFERENCE, reference_role, along(expected)),
                line(RUN, run_role, along(device)),
            ],
        );
        panels.push(Panel {
            y_covers: Vec::new(),
            ..position
        });
    }
    let milli = |values: &mut dyn Iterator<Item = f64>| values.map(|v| 1e3 * v).collect();
    panels.push(panel(
        "Net work on the hands (mJ)".to_owned(),
        vec![
            line(
                REFERENCE,
                reference_role,
                milli(&mut reference.out.iter().copied()),
            ),
            line(RUN, run_role, milli(&mut run.out.iter().copied())),
        ],
    ));
    panels.push(panel(
        "Energy of the account (mJ)".to_owned(),
        vec![
            line(
                "to spend",
                to_spend_role,
                milli(&mut run.account.iter().map(|a| a[0])),
            ),
            line(
                "stored",
                stored_role,
                milli(&mut run.account.iter().map(|a| a[1])),
            ),
        ],
    ));
    plot::panels(title, subtitle, 2, &panels)
}

/// One point for several ticks: the value of largest magnitude, so that no peak is lost.
fn thin(period: f64, values: &[f64]) -> Vec<(f64, f64)> {
    let every = values.len().div_ceil(POINTS).max(1);
    let each = values.chunks(every).enumerate();
    each.filter_map(|(i, chunk)| {
        let peak = chunk.iter().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        Some(((i * every) as f64 * period, *peak))
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distribution_rises_in_a_step_at_each_value() {
        let found = distribution("linear", vec![3.0, f64::NAN, 0.0, 1.0, 1.0]);
        let expected = [
            (0.0, 0.0),
            (0.0, 0.25),
            (1.0, 0.25),
            (1.0, 0.5),
            (1.0, 0.5),
            (1.0, 0.75),
            (3.0, 0.75),
            (3.0, 1.0),
        ];
        assert_eq!(found.points, expected);
        assert!(distribution("hold", vec![f64::NAN]).points.is_empty());
        // Many values: few steps, and the last one ends at one.
        let many = distribution("hold", (0..10_001).map(f64::from).collect());
        assert!(many.points.len() <= 2 * (STEPS + 1));
        assert_eq!(many.points.last(), Some(&(10_000.0, 1.0)));
    }

    #[test]
    fn panels_of_one_quantity_have_one_axis() {
        let panel = |values| Panel {
            x_scale: Scale::LogarithmicAbove(1e-3),
            ..fractions([distribution("hold", values)].into_iter())
        };
        let row = with_one_axis([panel(vec![0.0, 5.0]), panel(vec![700.0]), panel(Vec::new())]);
        assert_eq!(row[0].x_covers, row[2].x_covers);
        assert!(row[2].series.is_empty() && row[2].x_covers.contains(&700.0));
        let picture = plot::panels("sheet under hands", "", 3, &row);
        let svg = picture.svg();
        assert_eq!(plot::collisions(&picture), [""; 0]);
        // Only the panel without a run has no data.
        assert_eq!(svg.matches("no data").count(), 1);
    }

    #[test]
    fn a_study_without_a_cell_is_a_page_without_data() {
        let picture = distributions("a scene", &BTreeMap::new());
        assert_eq!(picture.svg().matches("no data").count(), 6);
        assert_eq!(plot::collisions(&picture), [""; 0]);
        let picture = holds(&BTreeMap::new());
        assert_eq!(picture.svg().matches("no data").count(), 4);
        assert_eq!(plot::collisions(&picture), [""; 0]);
    }

    #[test]
    fn a_cell_names_its_lines_once() {
        let trace = |out: f64| {
            let axis = DeviceTrace::default().main_direction();
            let device = DeviceTrace {
                force: (0..100).map(|k| axis * f64::from(k)).collect(),
                position: vec![axis; 100],
                ..DeviceTrace::default()
            };
            Trace {
                period: 1e-3,
                devices: vec![device.clone(), device],
                out: vec![out; 100],
                account: vec![[2.0, 1.0]; 100],
                ..Trace::default()
            }
        };
        let picture = cell("Cell 3", "125 Hz, 59 ms late", &trace(-1e-4), &trace(-2e-4));
        let svg = picture.svg();
        assert_eq!(plot::collisions(&picture), [""; 0]);
        for name in [RUN, REFERENCE, "to spend", "stored"] {
            assert_eq!(svg.matches(&format!("\n{name}\n")).count(), 1, "{name}");
        }
    }
}
