//! The measurements of all runs, side by side in a table for people.

use super::{Comparison, ForceError, Measures, Run};

/// One row for each run, and one for the reference. Each number is that of the worst device or body.
pub(super) fn words(found: &Comparison) -> String {
    let mut text = String::new();
    put!(
        text,
        "{}: {} runs of {} s in virtual time, seed {}; ticks at {} Hz, steps of the host at {} Hz, latency {:.1} ms",
        found.scene,
        found.runs.len(),
        found.duration,
        found.seed,
        found.tick_rate,
        found.step_rate,
        1e3 * found.latency
    );
    put!(
        text,
        "  force errors and ripple are measured from {:.3} s on",
        found.measured_from
    );
    for fault in &found.faults {
        put!(text, "  fault: {fault}");
    }
    put!(
        text,
        "\n| scheme | models a second | peak force N | force error N, RMS | force error % | largest force error N \
         | ripple N | net energy mJ | capped % | longest hold-back s | most withheld N | faded % | limited % \
         | model age ms: median, most |"
    );
    put!(text, "|{}", "---|".repeat(14));
    for run in &found.runs {
        write_run(&mut text, run);
    }
    if let Some(reference) = &found.reference {
        let [peak, ripple, energy, limited] = common(reference);
        put!(
            text,
            "| reference | | {peak} | | | | {ripple} | {energy} | | | | | {limited} | |"
        );
    }
    if let Some(why) = &found.no_reference {
        put!(text, "\nno reference: {why}");
    }
    for run in &found.runs {
        for failure in &run.failures {
            put!(
                text,
                "\nFAILED {} at {} Hz: {failure}",
                run.scheme,
                run.publish_rate
            );
        }
    }
    text
}

fn write_run(text: &mut String, run: &Run) {
    let measures = &run.measures;
    let [peak, ripple, energy, limited] = common(measures);
    let has_error = measures.devices.iter().any(|device| device.error.is_some());
    let error = |value: fn(&ForceError) -> f64, decimals: usize| {
        let worst = measures.worst(|device| device.error.as_ref().map_or(0.0, value));
        if has_error {
            format!("{worst:.decimals$}")
        } else {
            String::new()
        }
    };
    let ages = measures.bodies.iter().filter_map(|body| body.model_age);
    let age = ages.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]);
    let age = age.map_or(String::new(), |[median, most]| {
        format!("{:.1}, {:.1}", 1e3 * median, 1e3 * most)
    });
    put!(
        text,
        "| {} | {} | {peak} | {} | {} | {} | {ripple} | {energy} | {:.1} | {:.2} | {:.2} | {:.1} | {limited} | {age} |",
        run.scheme,
        run.publish_rate,
        error(|error| error.rms, 4),
        error(|error| 100.0 * error.relative, 1),
        error(|error| error.largest, 3),
        100.0 * measures.worst_body(|body| body.capped),
        measures.worst_body(|body| body.longest_hold_back),
        measures.worst_body(|body| body.most_withheld),
        100.0 * measures.worst_body(|body| body.faded),
    );
}

/// Peak force, ripple, net energy and the fraction of ticks at the limit of the device: what a run and a reference have.
fn common(measures: &Measures) -> [String; 4] {
    [
        format!("{:.2}", measures.worst(|device| device.peak_force)),
        format!("{:.3}", measures.worst(|device| device.ripple)),
        format!("{:.3}", 1e3 * measures.net_energy),
        format!("{:.1}", 100.0 * measures.worst(|device| device.limited)),
    ]
}
