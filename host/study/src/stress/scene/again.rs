//! A trial of `palpate stress scene` or a cell of `palpate stress hold`, that is run again, for a person: what was drawn and measured
//! in words, the run as a picture, and every tick.

use super::draw::{Draw, Span, Task};
use super::measure::{Outcome, Stillness, Trace};
use super::picture;
use crate::stress::specimen::{self, Cause};
use host::plot::Picture;
use std::fmt::Write;

/// A cell that was run again under one scheme.
pub struct Again {
    /// What was drawn, and what was measured.
    pub text: String,
    /// The lines above the picture.
    pub(crate) title: String,
    pub(crate) subtitle: String,
    /// The run, and the reference run.
    pub(crate) run: Trace,
    pub(crate) reference: Trace,
}

impl Again {
    /// The run beside the reference run.
    pub fn picture(&self) -> Picture {
        picture::cell(&self.title, &self.subtitle, &self.run, &self.reference)
    }

    /// The ticks of the run as CSV, one line per tick: time, energies, then force and position of each device in the run
    /// and in the reference run.
    pub fn log(&self) -> String {
        log(&self.run, &self.reference)
    }
}

/// What was drawn for the trial `cell`.
pub(super) fn drawn(cell: u64, seed: u64, draw: &Draw) -> String {
    let mut text = String::new();
    let task = match draw.task {
        Task::Press => "press, come half back, and press again",
        Task::Tap => "move there and back several times",
        Task::Rub => "press, then rub across",
        Task::Shake => "press, then shake to and fro",
        Task::Carry => "press, then move together across",
    };
    put!(text, "trial {cell} of seed {seed}");
    put!(
        text,
        "  host       {:.0} models a second, latency {:.1} ms; trouble: {}",
        draw.rate,
        1e3 * draw.latency,
        draw.trouble.name()
    );
    if draw.jitter + draw.models_lost + draw.records_lost > 0.0 {
        put!(
            text,
            "  losses     {:.0} % of the models, {:.0} % of the records of the hands; models up to {:.0} % later",
            100.0 * draw.models_lost,
            100.0 * draw.records_lost,
            100.0 * draw.jitter
        );
    }
    for stall in &draw.stalls {
        put!(text, "  stall      {}", between(stall));
    }
    if let Some(softening) = draw.softening {
        put!(
            text,
            "  softening  to {:.0} % of the stiffness at {:.3} s",
            100.0 * softening.left,
            softening.at
        );
    }
    if let Some(vanishing) = draw.vanishing {
        put!(
            text,
            "  vanishing  of device {}, {}",
            vanishing.device + 1,
            between(&vanishing.span)
        );
    }
    put!(
        text,
        "  hands      {task}; to {:.0} % of the way of the scene, haste {:.2} of 1",
        100.0 * draw.depth,
        draw.haste
    );
    for (number, grip) in (1..).zip(&draw.grips) {
        put!(
            text,
            "  grip {number}     {:.2} kg, {:.1} N s/m, {:.0} N/m",
            grip.mass,
            grip.damping,
            grip.stiffness
        );
    }
    text
}

/// What was drawn for the cell `cell` of `palpate stress hold`.
pub(crate) fn drawn_specimen(cell: u64, seed: u64, draw: &specimen::Draw) -> String {
    let mut text = String::new();
    let task = match draw.task {
        specimen::Task::Press => "press, then stay",
        specimen::Task::Tremble => "press, then stay with tremor",
        specimen::Task::Rub => "press, then rub slowly across, then stay",
        specimen::Task::Stages => "press in three stages, then stay",
    };
    put!(text, "cell {cell} of seed {seed}: {}", draw.kind.name());
    put!(
        text,
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
    put!(
        text,
        "  host       {:.0} models a second, {:.0} steps a second, latency {:.1} ms",
        draw.rate,
        draw.step_rate,
        1e3 * draw.latency
    );
    put!(
        text,
        "  hands      {task}; to {:.0} % of the largest force of a device, haste {:.2} of 1",
        100.0 * draw.force,
        draw.haste
    );
    match draw.cause {
        Cause::Nothing => {}
        Cause::Slew => put!(
            text,
            "  disturbed  slew limit: the whole force of a device takes {:.3} s",
            draw.span.duration
        ),
        cause => put!(
            text,
            "  disturbed  {} {}",
            cause.name(),
            between(&draw.span)
        ),
    }
    for (number, hand) in (1..).zip(&draw.hands) {
        let [x, y, z] = hand.direction;
        put!(
            text,
            "  hand {number}     {}, motion scale {:.2}, along ({x:.2}, {y:.2}, {z:.2}) for {:.0} % of the way",
            hand.device,
            hand.scale,
            100.0 * hand.share
        );
    }
    text
}

/// What was measured beside the reference, under the line `head`.
pub(crate) fn measured(head: &str, outcome: &Outcome, reference: &Trace) -> String {
    let mut text = String::new();
    let percent = |fraction: f64| format!("{:.2} %", 100.0 * fraction);
    let or_none = |fraction: Option<f64>| fraction.map_or("no time".to_owned(), percent);
    put!(text, "{head}");
    put!(
        text,
        "  energy     {:.3} mJ net (the reference {:.3}); a cap acted in {} of the ticks",
        1e3 * outcome.net_energy,
        1e3 * reference.net_energy(),
        percent(outcome.capped)
    );
    put!(text, "  hold       {}", still(&outcome.stillness));
    put!(
        text,
        "             {} (the reference)",
        still(&reference.stillness())
    );
    put!(
        text,
        "  force      off by {} of the reference (with a current model {}, without faults {})",
        percent(outcome.error),
        or_none(outcome.error_aware),
        or_none(outcome.error_untroubled)
    );
    let errors = &outcome.force_errors;
    put!(
        text,
        "  body       hold off by {}; by {} with the handles where they are at rest; they lack {}",
        percent(outcome.stiffness_error),
        percent(errors.hold_error),
        percent(errors.leaves)
    );
    put!(
        text,
        "  run        off by {} of the peak of {:.2} N; ripple of at most {:.3} N, jumps of {:.2} times the friction",
        percent(errors.run_error),
        errors.peak,
        errors.worst_ripple,
        errors.jump
    );
    if errors.run_moment > 0.0 {
        put!(
            text,
            "  moment     off by {:.5} N m in the hold, {:.5} N m over the run",
            errors.hold_moment,
            errors.run_moment
        );
    }
    text
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

fn log(run: &Trace, reference: &Trace) -> String {
    let mut text = String::from("time,out,reference_out,to_spend,stored");
    for device in 0..run.devices.len() {
        for column in [
            "force",
            "position",
            "body",
            "own",
            "reference_force",
            "reference_position",
        ] {
            for axis in ["x", "y", "z"] {
                let _ = write!(text, ",{column}_{device}_{axis}");
            }
        }
    }
    for tick in 0..run.out.len() {
        let [to_spend, stored] = run.account[tick];
        let time = tick as f64 * run.period;
        let (out, expected) = (run.out[tick], reference.out[tick]);
        let _ = write!(
            text,
            "\n{time:.4},{out:.9},{expected:.9},{to_spend:.9},{stored:.9}"
        );
        for (device, expected) in run.devices.iter().zip(&reference.devices) {
            for value in [
                device.force[tick],
                device.position[tick],
                device.body[tick],
                device.own[tick].force,
                expected.force[tick],
                expected.position[tick],
            ] {
                let _ = write!(text, ",{:.6},{:.6},{:.6}", value.x, value.y, value.z);
            }
        }
    }
    text + "\n"
}
