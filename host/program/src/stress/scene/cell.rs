//! One trial of `palpate stress scene`, or one cell of `palpate stress hold`, in words: what was drawn, and what was measured.

use study::stress::scene::draw::{Draw, Span, Task};
use study::stress::scene::measure::{Outcome, Stillness, Trace};
use study::stress::specimen::{self, Cause};

/// Prints what was drawn for the trial `cell`.
pub(super) fn print_draw(cell: u64, seed: u64, draw: &Draw) {
    let task = match draw.task {
        Task::Press => "press, come half back, and press again",
        Task::Tap => "move there and back several times",
        Task::Rub => "press, then rub across",
        Task::Shake => "press, then shake to and fro",
        Task::Carry => "press, then move together across",
    };
    outln!("trial {cell} of seed {seed}");
    outln!(
        "  host       {:.0} models a second, latency {:.1} ms; trouble: {}",
        draw.rate,
        1e3 * draw.latency,
        draw.trouble.name()
    );
    if draw.jitter + draw.models_lost + draw.records_lost > 0.0 {
        outln!(
            "  losses     {:.0} % of the models, {:.0} % of the records of the hands; models up to {:.0} % later",
            100.0 * draw.models_lost,
            100.0 * draw.records_lost,
            100.0 * draw.jitter
        );
    }
    for stall in &draw.stalls {
        outln!("  stall      {}", between(stall));
    }
    if let Some(softening) = draw.softening {
        outln!(
            "  softening  to {:.0} % of the stiffness at {:.3} s",
            100.0 * softening.left,
            softening.at
        );
    }
    if let Some(vanishing) = draw.vanishing {
        outln!(
            "  vanishing  of device {}, {}",
            vanishing.device + 1,
            between(&vanishing.span)
        );
    }
    outln!(
        "  hands      {task}; to {:.0} % of the way of the scene, haste {:.2} of 1",
        100.0 * draw.depth,
        draw.haste
    );
    for (number, grip) in (1..).zip(&draw.grips) {
        outln!(
            "  grip {number}     {:.2} kg, {:.1} N s/m, {:.0} N/m",
            grip.mass,
            grip.damping,
            grip.stiffness
        );
    }
}

/// Prints what was drawn for the cell `cell` of `palpate stress hold`.
pub(in crate::stress) fn print_specimen(cell: u64, seed: u64, draw: &specimen::Draw) {
    let task = match draw.task {
        specimen::Task::Press => "press, then stay",
        specimen::Task::Tremble => "press, then stay with tremor",
        specimen::Task::Rub => "press, then rub slowly across, then stay",
        specimen::Task::Stages => "press in three stages, then stay",
    };
    outln!("cell {cell} of seed {seed}: {}", draw.kind.name());
    outln!(
        "  body       {}, {}, {}; the stiffest motion is {:.2} times what the devices render",
        if draw.supported {
            "fixed, too"
        } else {
            "between hands alone"
        },
        if draw.weight {
            "with weight"
        } else {
            "without weight"
        },
        if draw.quadratic {
            "quadratic elements"
        } else {
            "linear elements"
        },
        draw.ratio
    );
    outln!(
        "  host       {:.0} models a second, {:.0} steps a second, latency {:.1} ms",
        draw.rate,
        draw.step_rate,
        1e3 * draw.latency
    );
    outln!(
        "  hands      {task}; to {:.0} % of the largest force of a device, haste {:.2} of 1",
        100.0 * draw.force,
        draw.haste
    );
    match draw.cause {
        Cause::Nothing => {}
        Cause::Slew => outln!(
            "  disturbed  slew limit: the whole force of a device takes {:.3} s",
            draw.span.duration
        ),
        cause => outln!("  disturbed  {} {}", cause.name(), between(&draw.span)),
    }
    for (number, hand) in (1..).zip(&draw.hands) {
        let [x, y, z] = hand.direction;
        outln!(
            "  hand {number}     {}, motion scale {:.2}, along ({x:.2}, {y:.2}, {z:.2}) for {:.0} % of the way",
            hand.device,
            hand.scale,
            100.0 * hand.share
        );
    }
}

/// Prints what was measured beside the reference, under the line `head`.
pub(in crate::stress) fn print_outcome(head: &str, outcome: &Outcome, reference: &Trace) {
    let percent = |fraction: f64| format!("{:.2} %", 100.0 * fraction);
    let or_none = |fraction: Option<f64>| fraction.map_or("no time".to_owned(), percent);
    outln!("{head}");
    outln!(
        "  energy     {:.3} mJ net (the reference {:.3}); a cap acted in {} of the ticks",
        1e3 * outcome.net_energy,
        1e3 * reference.net_energy(),
        percent(outcome.capped)
    );
    outln!("  hold       {}", still(&outcome.stillness));
    outln!(
        "             {} (the reference)",
        still(&reference.stillness())
    );
    outln!(
        "  force      off by {} of the reference (with a current model {}, without faults {})",
        percent(outcome.error),
        or_none(outcome.error_aware),
        or_none(outcome.error_untroubled)
    );
    let errors = &outcome.force_errors;
    outln!(
        "  body       hold off by {}; by {} with the handles where they are at rest; they lack {}",
        percent(outcome.stiffness_error),
        percent(errors.hold_error),
        percent(errors.leaves)
    );
    outln!(
        "  run        off by {} of the peak of {:.2} N; ripple of at most {:.3} N, jumps of {:.2} times the friction",
        percent(errors.run_error),
        errors.peak,
        errors.worst_ripple,
        errors.jump
    );
    if errors.run_moment > 0.0 {
        outln!(
            "  moment     off by {:.5} N m in the hold, {:.5} N m over the run",
            errors.hold_moment,
            errors.run_moment
        );
    }
}

fn between(span: &Span) -> String {
    format!("from {:.3} s on, for {:.3} s", span.at, span.duration)
}

fn still(found: &Stillness) -> String {
    format!(
        "ripple {:.4} N, motion {:.4} mm, at the limit of the device in {:.1} % of the ticks",
        found.ripple,
        1e3 * found.motion,
        100.0 * found.saturated
    )
}
