//! Rows of numbers: a name, and values of which those that fit are shown.

use super::format::{count, fit, instant, scaled, time};
use super::model::{Model, kind};
use super::palette::Palette;
use host::live::Event;
use host::record::Distribution;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};

/// Width of the names of rows.
pub(super) const NAME: usize = 10;

/// A row: the values are in the order of their importance.
pub(super) struct Row {
    pub(super) name: String,
    pub(super) style: Style,
    pub(super) values: Vec<(String, Style)>,
}

impl Row {
    fn new(name: impl Into<String>, style: Style) -> Self {
        Self {
            name: name.into(),
            style,
            values: Vec::new(),
        }
    }

    fn value(mut self, text: impl Into<String>) -> Self {
        self.values.push((text.into(), Style::new()));
        self
    }

    fn styled(mut self, text: impl Into<String>, style: Style) -> Self {
        self.values.push((text.into(), style));
        self
    }

    /// Draws the values that fit. A value is never cut.
    fn draw(&self, buffer: &mut Buffer, x: u16, y: u16, width: u16) {
        let width = usize::from(width);
        let name = fit(&self.name, NAME.min(width + 1) - 1);
        let _ = buffer.set_stringn(x, y, name, width, self.style);
        let mut at = NAME;
        for (text, style) in &self.values {
            let length = text.chars().count();
            if at + length > width {
                break;
            }
            let _ = buffer.set_stringn(x + at as u16, y, text, length, *style);
            at += length + 2;
        }
    }
}

/// Draws rows from the top; if they do not fit, the last row says how many are left out.
pub(super) fn draw(buffer: &mut Buffer, area: Rect, rows: &[Row], palette: Palette) {
    let room = usize::from(area.height);
    let shown = if rows.len() > room {
        room.saturating_sub(1)
    } else {
        rows.len()
    };
    for (y, row) in (area.y..).zip(&rows[..shown]) {
        row.draw(buffer, area.x, y, area.width);
    }
    if shown < rows.len() && room > 0 {
        let text = format!("{} more rows: keys 2 and 4", rows.len() - shown);
        let y = area.y + area.height - 1;
        let _ = buffer.set_stringn(area.x, y, text, usize::from(area.width), palette.faint());
    }
}

/// The times of a distribution: those up to now in a run, those of the whole log in a log.
fn distribution(row: Row, model: &Model, times: Option<&Distribution>, without: &str) -> Row {
    match times {
        None => row.value(without),
        Some(times) => whole_log(row, model)
            .value(format!("p50 {}", time(times.p50)))
            .value(format!("p99 {}", time(times.p99)))
            .value(format!("max {}", time(times.max)))
            .value(format!("p99.9 {}", time(times.p99_9))),
    }
}

/// The row, which says so if its times are those of a whole log.
fn whole_log(row: Row, model: &Model) -> Row {
    match model.playback {
        Some(_) => row.value("whole log:"),
        None => row,
    }
}

/// Ticks, lateness and tick time.
pub(super) fn ticks(model: &Model, palette: Palette) -> Vec<Row> {
    let Some(frame) = &model.frame else {
        return vec![Row::new("ticks", palette.label()).value("no frame yet")];
    };
    let totals = &frame.totals;
    let now = model.time_ns();
    let recent = model.history.pieces().any(|piece| {
        piece.missed > 0 && piece.to_ns.saturating_add(2_000_000_000) > now && piece.from_ns <= now
    });
    let missed = format!("missed {}", count(totals.missed));
    let style = if recent {
        palette.alarm()
    } else {
        Style::new()
    };
    let mut row = Row::new("ticks", palette.label()).value(count(totals.ticks));
    if let Some(rate) = model.rate() {
        row = row.value(format!("{rate:.1} Hz"));
    }
    row = row.styled(missed, style);
    if totals.lost > 0 {
        row = row.styled(format!("lost {}", count(totals.lost)), palette.alarm());
    }
    row = row.value(format!("in a row {}", count(totals.longest_miss)));
    let without = if model.hello.clock == "virtual" {
        "none in virtual time"
    } else {
        "not known"
    };
    vec![
        row,
        distribution(
            Row::new("lateness", palette.label()),
            model,
            totals.lateness.as_ref(),
            without,
        ),
        distribution(
            Row::new("tick time", palette.label()),
            model,
            totals.duration.as_ref(),
            without,
        ),
    ]
}

/// One row for each hand.
pub(super) fn hands(model: &Model, palette: Palette) -> Vec<Row> {
    let hands = model.frame.iter().flat_map(|frame| &frame.hands);
    let row = |(index, hand): (usize, &host::live::HandState)| {
        let name = format!("{} {}", index + 1, model.device(index));
        let style = palette.hand(index).add_modifier(Modifier::BOLD);
        let row = Row::new(name, style).value(format!("{:>7}", scaled(norm(hand.force), "N")));
        let state = hand.safety.replace('_', " ");
        let row = if hand.safety == "normal" {
            row.value(state)
        } else {
            row.styled(state, palette.alarm())
        };
        let row = if hand.fresh {
            row
        } else {
            row.styled("no reading", palette.alarm())
        };
        let row = row.value(format!("peak {}", scaled(hand.peak_force, "N")));
        // Many devices have no moment.
        let row = match norm(hand.moment) {
            0.0 => row,
            moment => row.value(scaled(moment, "N m")),
        };
        row.value(format!("work {}", scaled(hand.work, "J")))
            .value(format!("reach {}", scaled(hand.reach, "m")))
    };
    hands.enumerate().map(row).collect()
}

/// The model of each body.
pub(super) fn models(model: &Model, palette: Palette) -> Vec<Row> {
    let Some(frame) = &model.frame else {
        return Vec::new();
    };
    let one = frame.bodies.len() == 1;
    let row = |(index, body): (usize, &host::live::BodyState)| {
        let name = if one {
            "model".to_owned()
        } else {
            model.body_name(index)
        };
        let state = if body.state == "live" {
            Style::new()
        } else {
            palette.alarm()
        };
        let row = Row::new(name, palette.label())
            .value(format!("age {}", time(body.age)))
            .value(format!("trust {:.2}", body.trust))
            .styled(body.state.clone(), state);
        let row = if body.withheld > 0.0 {
            row.value(format!("withheld {}", scaled(body.withheld, "N")))
        } else {
            row
        };
        match frame.totals.model_age.get(index) {
            Some(ages) => whole_log(row, model)
                .value(format!("p99 {}", time(ages.p99)))
                .value(format!("max {}", time(ages.max))),
            None => row,
        }
    };
    frame.bodies.iter().enumerate().map(row).collect()
}

/// The energy of each body.
pub(super) fn energy(model: &Model, palette: Palette) -> Vec<Row> {
    let Some(frame) = &model.frame else {
        return Vec::new();
    };
    let one = frame.bodies.len() == 1;
    let row = |(index, body): (usize, &host::live::BodyState)| {
        let name = if one {
            "energy".to_owned()
        } else {
            format!("J {}", model.body_name(index))
        };
        let mut row = Row::new(name, palette.label());
        for name in ["supplied", "stored", "raised", "credited"] {
            if let Some(value) = body.energy.get(name) {
                row = row.value(format!("{name} {}", scaled(*value, "J")));
            }
        }
        row
    };
    let with = frame.bodies.iter().enumerate();
    with.filter(|(_, body)| !body.energy.is_empty())
        .map(row)
        .collect()
}

/// The host.
pub(super) fn host(model: &Model, palette: Palette) -> Vec<Row> {
    let Some(frame) = &model.frame else {
        return Vec::new();
    };
    let Some(host) = &frame.host else {
        let text = if model.is_log() {
            "not in a log"
        } else {
            "not known"
        };
        return vec![Row::new("host", palette.label()).value(text)];
    };
    let some = |count: u64| {
        if count > 0 {
            palette.alarm()
        } else {
            Style::new()
        }
    };
    let rate = Row::new("host", palette.label())
        .value(format!(
            "{:.1} Hz of {:.0}",
            host.step_rate, model.hello.step_rate
        ))
        .styled(format!("skipped {}", count(host.skipped)), Style::new())
        .styled(format!("faults {}", count(host.faults)), some(host.faults))
        .value(format!("{} steps", count(host.steps)))
        .value(format!("{} models", count(host.publications)))
        .value(format!("{} factors", count(host.factors)));
    let mut stages = Row::new("stages", palette.label());
    for (name, seconds) in ["solve", "condense"].iter().zip(host.stages) {
        if let Some(seconds) = seconds {
            stages = stages.value(format!("{name} {}", time(seconds)));
        }
    }
    stages = stages.value(format!("{} iterations", host.iterations));
    vec![rate, stages]
}

/// The medians of the stages.
pub(super) fn medians(model: &Model, palette: Palette) -> Vec<Row> {
    let host = model.frame.as_ref().and_then(|frame| frame.host.as_ref());
    let Some(host) = host else {
        return Vec::new();
    };
    let mut row = Row::new("medians", palette.label());
    for (name, seconds) in ["solve", "condense"].iter().zip(host.medians) {
        if seconds > 0.0 {
            row = row.value(format!("{name} {}", time(seconds)));
        }
    }
    let host = Row::new("host", palette.label())
        .value(format!("{} steps", count(host.steps)))
        .value(format!("{} models", count(host.publications)))
        .value(format!("{} factors", count(host.factors)));
    vec![row, host]
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The last events, newest first; `skip` events are scrolled past.
pub(super) fn events(
    buffer: &mut Buffer,
    area: Rect,
    model: &Model,
    palette: Palette,
    skip: usize,
) {
    let (events, past) = model.all_events();
    let width = usize::from(area.width);
    if past == 0 {
        let text = if events.is_empty() {
            "none"
        } else {
            "none up to this moment"
        };
        let _ = buffer.set_stringn(area.x, area.y, text, width, palette.faint());
        return;
    }
    let now = model.time_ns();
    for (y, event) in (area.y..area.y + area.height).zip(events[..past].iter().rev().skip(skip)) {
        // Whatever happened in the last two seconds stands out.
        let recent = event.time_ns.saturating_add(2_000_000_000) > now;
        self::event(
            buffer,
            Rect {
                y,
                height: 1,
                ..area
            },
            event,
            palette,
            recent,
        );
    }
}

fn event(buffer: &mut Buffer, area: Rect, event: &Event, palette: Palette, recent: bool) {
    let width = usize::from(area.width);
    let (_, word) = kind(event.kind);
    let when = format!("{:>10} ", instant(event.time_ns));
    let (x, _) = buffer.set_stringn(area.x, area.y, &when, width, palette.faint());
    let left = width.saturating_sub(when.chars().count());
    let style = if recent {
        palette.alarm()
    } else {
        palette.label()
    };
    let word = format!("{word:<6}");
    let _ = buffer.set_stringn(x, area.y, word, left, style);
    let text = fit(&event.text, left.saturating_sub(7));
    let _ = buffer.set_stringn(
        x + 7.min(left as u16),
        area.y,
        text,
        left.saturating_sub(7),
        Style::new(),
    );
}
