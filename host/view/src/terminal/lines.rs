//! Plain lines, if there is no terminal: one a second of the run's own time, and one for each event.

use super::format::{count, instant, scaled, time};
use super::model::{Model, Over, kind};
use super::{Ended, Options, TerminalError, signal};
use crate::feed::Feed;
use host::live::Message;
use std::fmt::Write as _;
use std::io::Write;
use std::time::{Duration, Instant};

/// Longest wait for a message before signals are looked at.
const WAIT: Duration = Duration::from_millis(100);

/// Writes the lines until the feed ends.
///
/// # Errors
/// [`TerminalError`] if the lines cannot be written, or the feed ended early.
pub fn lines(
    mut feed: Box<dyn Feed>,
    options: &Options,
    out: &mut dyn Write,
) -> Result<Ended, TerminalError> {
    let mut model = Model::default();
    let mut greeted = false;
    // The second of the next line.
    let mut next: Option<u64> = None;
    loop {
        if let Some(ended) = signal(&options.signal) {
            return Ok(ended);
        }
        let Some(message) = feed.next(WAIT)? else {
            continue;
        };
        if matches!(message, Message::Hello(_)) {
            // The first message of a run.
            (greeted, next) = (false, None);
        }
        let old = model.time_ns();
        model.take(message, Instant::now());
        let mut text = String::new();
        if !greeted && !model.hello.scene.is_empty() {
            greeted = true;
            let hello = &model.hello;
            let clock = format!("{} clock, scheme {}", hello.clock, hello.scheme);
            let _ = writeln!(text, "{}: {clock}", hello.scene);
        }
        // A list of events that is only written here has no need of a memory.
        for event in model.events.drain(..) {
            let (when, word) = (instant(event.time_ns), kind(event.kind).1);
            let _ = writeln!(text, "{when}  event {word}: {}", event.text);
        }
        if model.more_events > 0 {
            let _ = writeln!(text, "{} more events", model.more_events);
            model.more_events = 0;
        }
        let second = model.time_ns() / 1_000_000_000;
        // A log that jumps back begins again.
        if model.time_ns() < old {
            next = None;
        }
        let last = model.frame.as_ref().is_some_and(|frame| frame.last) && next != Some(u64::MAX);
        if model.frame.is_some() && (last || next.is_none_or(|next| second >= next)) {
            next = Some(if last { u64::MAX } else { second + 1 });
            text.push_str(&line(&model));
        }
        let ended = match &model.over {
            // A log ends at the tick after which it is not played any further.
            None if model
                .playback
                .as_ref()
                .is_some_and(|p| !p.playing && p.at_ns >= p.to_ns) =>
            {
                let _ = writeln!(text, "the end of the log, at {}", instant(model.time_ns()));
                Some(Ended::Over)
            }
            None => None,
            Some(Over::Ended(_)) => {
                let _ = writeln!(text, "the end, at {}", instant(model.time_ns()));
                Some(Ended::Over)
            }
            Some(Over::Broken(reason)) => {
                let _ = writeln!(text, "ended early: {reason}");
                Some(Ended::Over)
            }
        };
        let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        written.map_err(TerminalError::Lines)?;
        let waits = options.waits && matches!(model.over, Some(Over::Ended(_)));
        if let Some(ended) = ended.filter(|_| !waits) {
            return Ok(ended);
        }
    }
}

/// The line of the shown moment.
fn line(model: &Model) -> String {
    let Some(frame) = &model.frame else {
        return String::new();
    };
    let totals = &frame.totals;
    let mut text = format!(
        "{}  ticks {}  missed {}",
        instant(frame.time_ns),
        count(totals.ticks),
        count(totals.missed)
    );
    if let Some(lateness) = &totals.lateness {
        let whole = model.playback.as_ref().map_or("", |_| ", whole log");
        let _ = write!(text, "  lateness p99 {}{whole}", time(lateness.p99));
    }
    for (index, hand) in frame.hands.iter().enumerate() {
        let norm = hand.force.iter().map(|f| f * f).sum::<f64>().sqrt();
        let _ = write!(text, "  {} {}", model.device(index), scaled(norm, "N"));
    }
    for body in &frame.bodies {
        let _ = write!(text, "  model age {}", time(body.age));
    }
    if let Some(host) = &frame.host {
        // The first frame of a run has no step before it.
        if host.step_rate > 0.0 {
            let _ = write!(text, "  host {:.1} Hz", host.step_rate);
        }
    }
    text.push('\n');
    text
}
