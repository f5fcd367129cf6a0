//! Charts of a study, and of one of its cells.

use host::plot::{self, Marker, Panel, Series};
use std::collections::BTreeMap;
use study::stress::hold::{self, CellResult as HoldCell};
use study::stress::scene::measure::{DeviceTrace, Outcome, Trace};
use study::stress::scene::summary::{Band, outcomes};
use study::stress::scene::{CellResult, SCHEMES};

/// Largest number of points of a line: more would not be visible.
const POINTS: usize = 240;
/// Net energies below this bound are drawn at the bound (mJ), because a logarithmic axis has no zero.
const LEAST_ENERGY: f64 = 1e-3;

/// The corresponding bound for errors (%), ripple (mN) and fractions (%).
const LEAST_ERROR: f64 = 1e-3;

/// A quantity of an outcome.
type Value = fn(&Outcome) -> f64;

/// The distributions of force error and net energy, for hosts at 20 and 30 Hz, at 60 Hz, and at higher rates.
pub(super) fn distributions(name: &str, cells: &BTreeMap<u64, CellResult>) -> String {
    let bands = [
        ("20 and 30 Hz", Band::of(20.0, 30.0)),
        ("60 Hz", Band::of(60.0, 60.0)),
        ("125 to 1000 Hz", Band::of(125.0, 1000.0)),
    ];
    let values: [(&str, Value); 2] = [
        ("force error (%)", |o| 100.0 * o.error),
        ("net energy (mJ)", |o| {
            (1e3 * o.net_energy).max(LEAST_ENERGY)
        }),
    ];
    let mut panels = Vec::new();
    for (quantity, value) in values {
        for (label, band) in bands {
            let series = SCHEMES.iter().map(|(_, scheme)| {
                let found = outcomes(cells.iter(), scheme, band);
                Series {
                    name: (*scheme).to_owned(),
                    points: distribution(found.iter().map(|(_, o)| value(o)).collect()),
                    marker: Marker::None,
                }
            });
            panels.push(Panel {
                x_label: format!("{quantity}, host at {label}"),
                y_label: "fraction of runs".to_owned(),
                log_x: true,
                series: series.collect(),
            });
        }
    }
    let title = format!("{name} under hands, rates and faults");
    let subtitle = format!("{} drawn worlds; distributions over the runs", cells.len());
    plot::panels_svg(&title, &subtitle, 3, &panels)
}

/// The distributions of the study of holds: errors of the hold and of the run, ripple, and the fraction of ticks in
/// which the cap acts.
pub(in crate::stress) fn holds(cells: &BTreeMap<u64, HoldCell>) -> String {
    let values: [(&str, Value); 4] = [
        ("error of the hold (%)", |o| {
            (100.0 * o.force_errors.hold_error).max(LEAST_ERROR)
        }),
        ("error of the run, relative to its peak (%)", |o| {
            (100.0 * o.force_errors.run_error).max(LEAST_ERROR)
        }),
        ("ripple in excess of the reference (mN)", |o| {
            (1e3 * o.force_errors.worst_ripple).max(LEAST_ERROR)
        }),
        ("ticks capped (%)", |o| (100.0 * o.capped).max(LEAST_ERROR)),
    ];
    let panels = values.map(|(quantity, value)| Panel {
        x_label: quantity.to_owned(),
        y_label: "fraction of cells".to_owned(),
        log_x: true,
        series: hold::SCHEMES
            .iter()
            .map(|(_, scheme)| {
                let found = cells.values().filter_map(|cell| cell.schemes.get(*scheme));
                Series {
                    name: (*scheme).to_owned(),
                    points: distribution(found.map(value).collect()),
                    marker: Marker::None,
                }
            })
            .collect(),
    });
    let subtitle = format!(
        "{} cells without faults; distributions over the cells",
        cells.len()
    );
    plot::panels_svg("Presses, holds, rubs and tremors", &subtitle, 2, &panels)
}

/// The cumulative distribution of `values`: for each value, the fraction of the values at or below it.
fn distribution(mut values: Vec<f64>) -> Vec<(f64, f64)> {
    values.sort_unstable_by(f64::total_cmp);
    let count = values.len();
    let every = count.div_ceil(POINTS).max(1);
    let each = values.into_iter().enumerate();
    each.filter(|(i, _)| i % every == 0 || i + 1 == count)
        .map(|(i, value)| (value, (i + 1) as f64 / count as f64))
        .collect()
}

/// One run beside its reference run: force and position of each device along the main direction of its force, and the
/// energy.
pub(in crate::stress) fn cell(
    title: &str,
    subtitle: &str,
    run: &Trace,
    reference: &Trace,
) -> String {
    let mut panels = Vec::new();
    let line = |name: &str, values: Vec<f64>| Series {
        name: name.to_owned(),
        points: thin(run.period, &values),
        marker: Marker::None,
    };
    let panel = |y_label: String, series| Panel {
        x_label: "time (s)".to_owned(),
        y_label,
        log_x: false,
        series,
    };
    for (number, (device, expected)) in run.devices.iter().zip(&reference.devices).enumerate() {
        let axis = expected.main_direction();
        let along = |trace: &DeviceTrace| trace.force.iter().map(|f| f.dot(&axis)).collect();
        let own = device.own.iter().map(|own| own.force.dot(&axis));
        panels.push(panel(
            format!("force of device {number} (N)"),
            vec![
                line("this run", along(device)),
                line("reference", along(expected)),
                line("the body's own along this run", own.collect()),
            ],
        ));
    }
    for (number, (device, expected)) in run.devices.iter().zip(&reference.devices).enumerate() {
        let axis = expected.main_direction();
        let along = |trace: &DeviceTrace| {
            let places = trace.position.iter();
            places.map(|p| 1e3 * p.dot(&axis)).collect()
        };
        panels.push(panel(
            format!("position of device {number} (mm)"),
            vec![
                line("this run", along(device)),
                line("reference", along(expected)),
            ],
        ));
    }
    let milli = |values: &mut dyn Iterator<Item = f64>| values.map(|v| 1e3 * v).collect();
    panels.push(panel(
        "net work on the hands (mJ)".to_owned(),
        vec![
            line("this run", milli(&mut run.out.iter().copied())),
            line("reference", milli(&mut reference.out.iter().copied())),
        ],
    ));
    panels.push(panel(
        "to spend (blue), stored (mJ)".to_owned(),
        vec![
            line("to spend", milli(&mut run.account.iter().map(|a| a[0]))),
            line("stored", milli(&mut run.account.iter().map(|a| a[1]))),
        ],
    ));
    plot::panels_svg(title, subtitle, 2, &panels)
}

/// One point for several ticks: the value of largest magnitude, so that no peak is lost.
fn thin(period: f64, values: &[f64]) -> Vec<(f64, f64)> {
    let every = values.len().div_ceil(4 * POINTS).max(1);
    let each = values.chunks(every).enumerate();
    each.filter_map(|(i, chunk)| {
        let peak = chunk.iter().max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        Some(((i * every) as f64 * period, *peak))
    })
    .collect()
}
