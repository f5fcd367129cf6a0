//! The whole screen: a head, the chosen panels, a timeline for a log, and the keys.

use super::body::{self, Layers};
use super::chart::{self, Curve, Window};
use super::format::{fit, instant, scaled};
use super::histogram;
use super::keys::{Tab, View, help};
use super::model::{Model, Over, SPAN};
use super::palette::{HEAD, Palette};
use super::rows;
use super::timeline;
use host::live::Range;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use std::time::Instant;

/// The least size of a terminal.
pub const LEAST: (u16, u16) = (80, 24);

/// Draws the display. `now` serves to tell how old the frame is.
pub fn draw(
    buffer: &mut Buffer,
    area: Rect,
    model: &Model,
    view: &View,
    palette: Palette,
    now: Instant,
) {
    if area.width < LEAST.0 || area.height < LEAST.1 {
        let text = format!(
            "palpate view needs {} x {} characters, found {} x {}; q quits",
            LEAST.0, LEAST.1, area.width, area.height
        );
        let _ = buffer.set_stringn(area.x, area.y, text, usize::from(area.width), Style::new());
        return;
    }
    let screen = Screen {
        model: view.stopped.as_deref().unwrap_or(model),
        view,
        palette,
    };
    // The age is that of the frame on the screen; the end is known although the display is stopped.
    screen.head(buffer, Rect { height: 1, ..area }, now);
    let foot = Rect {
        y: area.y + area.height - 1,
        height: 1,
        ..area
    };
    screen.foot(buffer, foot, model);
    let line = if model.is_log() { 2 } else { 0 };
    let middle = Rect {
        y: area.y + 1,
        height: area.height - 2 - line,
        ..area
    };
    if line > 0 {
        let at = Rect {
            y: middle.y + middle.height,
            height: line,
            ..area
        };
        timeline::draw(buffer, at, model, palette);
    }
    match view.tab {
        Tab::Overview if area.width >= 120 && area.height >= 30 => screen.wide(buffer, middle),
        Tab::Overview => screen.compact(buffer, middle),
        Tab::Body => screen.body_tab(buffer, middle),
        Tab::Charts => screen.charts_tab(buffer, middle),
        Tab::Timing => screen.timing_tab(buffer, middle),
        Tab::Events => screen.events_tab(buffer, middle),
    }
    if view.help {
        screen.help(buffer, middle);
    }
}

/// The cells of a display of this size, without a terminal.
pub fn cells(width: u16, height: u16, model: &Model, view: &View, palette: Palette) -> Buffer {
    let area = Rect::new(0, 0, width, height);
    let mut buffer = Buffer::empty(area);
    draw(&mut buffer, area, model, view, palette, Instant::now());
    buffer
}

/// Shortest span of a chart (ns).
const SHORTEST: i64 = 1_000_000_000;

/// A chart of the display.
#[derive(Clone, Copy)]
enum Chart {
    Force(usize),
    Position(usize),
    Age(usize),
    Energy(usize),
    Lateness,
}

struct Screen<'a> {
    model: &'a Model,
    view: &'a View,
    palette: Palette,
}

/// An area without its first `count` rows, and those rows.
fn split_rows(area: Rect, count: u16) -> (Rect, Rect) {
    let count = count.min(area.height);
    let rest = Rect {
        y: area.y + count,
        height: area.height - count,
        ..area
    };
    (
        Rect {
            height: count,
            ..area
        },
        rest,
    )
}

/// The left `width` columns, and the rest after a gap of one.
fn split_columns(area: Rect, width: u16) -> (Rect, Rect) {
    let width = width.min(area.width);
    let gap = (width + 1).min(area.width);
    let rest = Rect {
        x: area.x + gap,
        width: area.width - gap,
        ..area
    };
    (Rect { width, ..area }, rest)
}

impl Screen<'_> {
    fn head(&self, buffer: &mut Buffer, area: Rect, now: Instant) {
        let model = self.model;
        let hello = &model.hello;
        let mut left = vec![fit(&hello.scene, 24)];
        if !hello.clock.is_empty() {
            left.push(format!("{} clock", hello.clock));
            left.push(hello.scheme.clone());
        }
        let file = hello.file.rsplit('/').next().unwrap_or_default();
        left.push(if model.is_log() {
            format!("log {}", fit(file, 20))
        } else {
            "run".into()
        });
        let mut right = Vec::new();
        if let Some(frame) = &model.frame {
            right.push(instant(frame.time_ns));
            if !model.is_log()
                && let Some(age) = model.frame_age(now)
            {
                right.push(format!("frame {:.1} s old", age.as_secs_f64()));
                right.push(format!("{} dropped", frame.dropped));
            }
        }
        let right = right.join("  ");
        let style = HEAD;
        let width = usize::from(area.width);
        let length = right.chars().count().min(width);
        let x = area.x + (width - length) as u16;
        let _ = buffer.set_stringn(x, area.y, &right, length, style);
        let mut room = width - length;
        let mut at = area.x;
        for part in left {
            let length = part.chars().count();
            if length + 2 > room {
                break;
            }
            let _ = buffer.set_stringn(at, area.y, &part, length, style);
            at += length as u16 + 2;
            room -= length + 2;
        }
    }

    fn foot(&self, buffer: &mut Buffer, area: Rect, newest: &Model) {
        let width = usize::from(area.width);
        let notice = match (&self.view.notice, &newest.over) {
            (Some(notice), _) => Some(notice.clone()),
            (None, Some(Over::Ended(_))) if self.view.waits => {
                Some("the run is over; the display waits for the next run; q quits".into())
            }
            (None, Some(Over::Ended(_))) => Some("the run is over; q quits".into()),
            (None, Some(Over::Broken(reason))) => Some(format!("{reason}; q quits")),
            (None, None) if self.view.stopped.is_some() => {
                Some("the display is stopped, the run goes on; p continues".into())
            }
            (None, None) if self.view.waits && newest.hello.scene.is_empty() => {
                Some("there is no run yet; the display waits for a run; q quits".into())
            }
            (None, None) => None,
        };
        let mut x = area.x;
        if let Some(notice) = notice {
            let text = fit(&format!(" {notice} "), width);
            let _ = buffer.set_stringn(x, area.y, text, width, self.palette.alarm());
            return;
        }
        for (index, (tab, name)) in Tab::ALL.iter().enumerate() {
            let style = if *tab == self.view.tab {
                Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD)
            } else {
                Style::new()
            };
            let text = format!(" {} {name} ", index + 1);
            (x, _) = buffer.set_stringn(x, area.y, &text, width, style);
        }
        let keys = "h help  q quit ";
        let at = area.x + area.width - keys.len() as u16;
        let _ = buffer.set_stringn(at, area.y, keys, keys.len(), self.palette.faint());
        let orders = " Enter stops ";
        let at = at.saturating_sub(orders.len() as u16 + 1);
        if self.view.operates && at > x {
            let _ = buffer.set_stringn(at, area.y, orders, orders.len(), self.palette.alarm());
        }
    }

    /// A rule with the title of a panel; the rest of the area.
    fn title(&self, buffer: &mut Buffer, area: Rect, title: &str, value: &str) -> Rect {
        let (head, rest) = split_rows(area, 1);
        if head.height == 0 {
            return rest;
        }
        let width = usize::from(area.width);
        let faint = self.palette.faint();
        let _ = buffer.set_stringn(head.x, head.y, "─".repeat(width), width, faint);
        let title = fit(title, width.saturating_sub(4));
        let title = format!(" {title} ");
        let length = title.chars().count();
        if width > 2 {
            let _ = buffer.set_stringn(head.x + 1, head.y, &title, width - 2, self.palette.label());
        }
        let value = format!(" {value} ");
        let room = width.saturating_sub(length + 2);
        let long = value.chars().count();
        if long > 2 && long < room {
            let x = head.x + (width - long - 1) as u16;
            let _ = buffer.set_stringn(x, head.y, &value, long, Style::new());
        }
        rest
    }

    fn body(&self, buffer: &mut Buffer, area: Rect) {
        let names: Vec<String> = (0..self.model.hello.bodies.len())
            .map(|body| self.model.body_name(body))
            .collect();
        let names = if names.is_empty() {
            "bodies".to_owned()
        } else {
            names.join(", ")
        };
        let inner = self.title(buffer, area, &names, "");
        let View {
            camera,
            wire,
            contacts,
            clusters,
            ..
        } = self.view;
        let layers = Layers {
            wire: *wire,
            contacts: *contacts,
            clusters: *clusters,
        };
        body::draw(buffer, inner, self.model, camera, layers, self.palette);
    }

    /// All rows of numbers, the most important first.
    fn numbers(&self) -> Vec<rows::Row> {
        let (model, palette) = (self.model, self.palette);
        let mut all = rows::ticks(model, palette);
        all.extend(rows::hands(model, palette));
        all.extend(rows::models(model, palette));
        all.extend(rows::host(model, palette));
        all.extend(rows::energy(model, palette));
        all
    }

    fn window(&self) -> (Window, Option<f64>) {
        let now = chart::ns(self.model.time_ns());
        let span = (SPAN * 1e9) as i64;
        let last = self.model.history.pieces().next_back();
        let last = last.map_or(now, |piece| chart::ns(piece.to_ns)).max(now);
        // A log knows what comes after the shown moment: at most half of the chart.
        let ahead = (last - now).min(span / 2);
        let to_ns = now + ahead;
        let first = self.model.history.pieces().next();
        let first = first.map_or(0, |piece| chart::ns(piece.from_ns));
        // The first seconds of a run fill the chart, too.
        let from_ns = first.min(to_ns - SHORTEST).max(to_ns - span);
        let cursor = (ahead > 0).then(|| 1.0 - ahead as f64 / (to_ns - from_ns) as f64);
        (Window { from_ns, to_ns }, cursor)
    }

    /// Whether there are times of the wall to show.
    fn has_times(&self) -> bool {
        let frame = self.model.frame.as_ref();
        let recorded = |frame: &host::live::Frame| {
            !frame.totals.lateness_bins.0.is_empty() || !frame.totals.duration_bins.0.is_empty()
        };
        frame.is_none_or(recorded)
    }

    fn chart(&self, buffer: &mut Buffer, area: Rect, chart: Chart) {
        let (model, palette) = (self.model, self.palette);
        let frame = model.frame.as_ref();
        let (title, value) = match chart {
            Chart::Force(k) => {
                let hand = frame.and_then(|frame| frame.hands.get(k));
                let norm = hand.map(|hand| hand.force.iter().map(|f| f * f).sum::<f64>().sqrt());
                let value = norm.map(|norm| scaled(norm, "N")).unwrap_or_default();
                (format!("force {} {} (N)", k + 1, model.device(k)), value)
            }
            Chart::Position(k) => (
                format!("position {} {} (mm)", k + 1, model.device(k)),
                String::new(),
            ),
            Chart::Age(k) => (
                format!("model age {} (ms)", model.body_name(k)),
                frame
                    .and_then(|f| f.bodies.get(k))
                    .map_or_else(String::new, |body| format!("trust {:.2}", body.trust)),
            ),
            Chart::Energy(k) => (
                format!("energy {} (mJ)", model.body_name(k)),
                "s supplied, v stored".into(),
            ),
            Chart::Lateness => ("lateness (µs)".to_owned(), String::new()),
        };
        let (window, cursor) = self.window();
        let span = (window.to_ns - window.from_ns) as f64 * 1e-9;
        let long = format!("{title}, {span:.0} s");
        let room = long.chars().count() + value.chars().count() + 8;
        let title = if room <= usize::from(area.width) {
            long
        } else {
            title
        };
        let inner = self.title(buffer, area, &title, &value);
        let count = chart::dots_across(inner.width);
        let curve =
            |letter, style, factor: f64, of: &dyn Fn(&host::live::Folded) -> Option<Range>| {
                let columns = chart::columns(&model.history, window, count, |piece| {
                    let range = of(piece).unwrap_or_default();
                    if range.is_empty() {
                        range
                    } else {
                        Range {
                            least: range.least * factor,
                            most: range.most * factor,
                        }
                    }
                });
                Curve {
                    letter,
                    style,
                    columns,
                }
            };
        let number = |k: usize| char::from_digit(k as u32 + 1, 10).unwrap_or(' ');
        let (mut curves, zero) = match chart {
            Chart::Force(k) => (
                vec![curve(number(k), palette.hand(k), 1.0, &|piece| {
                    Some(piece.hands.get(k)?.force_norm)
                })],
                true,
            ),
            Chart::Position(k) => (
                (0..3)
                    .map(|axis| {
                        let letter = ['x', 'y', 'z'][axis];
                        curve(letter, palette.axis(axis), 1e3, &|piece| {
                            Some(piece.hands.get(k)?.position[axis])
                        })
                    })
                    .collect(),
                false,
            ),
            Chart::Age(k) => (
                vec![curve(' ', palette.body(k), 1e3, &|piece| {
                    Some(piece.bodies.get(k)?.age)
                })],
                true,
            ),
            Chart::Energy(k) => (
                vec![
                    curve('s', palette.axis(0), 1e3, &|piece| {
                        Some(piece.bodies.get(k)?.supplied)
                    }),
                    curve('v', palette.axis(2), 1e3, &|piece| {
                        Some(piece.bodies.get(k)?.stored)
                    }),
                ],
                true,
            ),
            Chart::Lateness => (
                vec![curve(' ', palette.bar(), 1e6, &|piece| {
                    Some(piece.lateness)
                })],
                true,
            ),
        };
        if matches!(chart, Chart::Position(_)) {
            chart::without_constants(&mut curves);
        }
        // The forces of all hands have one axis, so that they can be compared.
        let mut covers = Range::EMPTY;
        if matches!(chart, Chart::Force(_)) {
            for hand in 0..self.hands() {
                let of = |piece: &host::live::Folded| {
                    piece
                        .hands
                        .get(hand)
                        .map_or(Range::EMPTY, |hand| hand.force_norm)
                };
                for range in chart::columns(&model.history, window, count, of) {
                    covers.merge(&range);
                }
            }
        }
        chart::draw(buffer, inner, palette, &curves, (zero, covers), cursor);
    }

    /// Charts below each other. Each has at least `least` rows. Charts that do not fit are reached by
    /// scrolling.
    fn stack(&self, buffer: &mut Buffer, area: Rect, charts: &[Vec<Chart>], least: u16) {
        if charts.is_empty() || area.height < 3 {
            return;
        }
        let fit = usize::from((area.height / least).max(1));
        let first = self.view.scroll.min(charts.len().saturating_sub(fit));
        let shown = &charts[first..charts.len().min(first + fit)];
        let count = shown.len() as u16;
        let mut rest = area;
        for (index, row) in shown.iter().enumerate() {
            let height = rest.height / (count - index as u16);
            let (mut here, below) = split_rows(rest, height);
            rest = below;
            for (index, chart) in row.iter().enumerate() {
                let left = (row.len() - index) as u16;
                let (area, right) = if left == 1 {
                    (here, here)
                } else {
                    split_columns(here, (here.width - left + 1) / left)
                };
                self.chart(buffer, area, *chart);
                here = right;
            }
        }
        if shown.len() < charts.len() {
            let text = format!(
                " {} to {} of {}: Tab ",
                first + 1,
                first + shown.len(),
                charts.len()
            );
            let length = text.chars().count() as u16;
            if area.width > length + 30 {
                let x = area.x + area.width - length - 12;
                let _ = buffer.set_stringn(x, area.y, text, 80, self.palette.label());
            }
        }
    }

    fn hands(&self) -> usize {
        let shown = self
            .model
            .frame
            .as_ref()
            .map_or(0, |frame| frame.hands.len());
        shown.max(self.model.hello.devices.len())
    }

    fn bodies(&self) -> usize {
        let shown = self
            .model
            .frame
            .as_ref()
            .map_or(0, |frame| frame.bodies.len());
        shown.max(self.model.hello.bodies.len())
    }

    /// The histograms of a log are those of the whole log.
    fn whole_log(&self) -> &'static str {
        self.model.playback.as_ref().map_or("", |_| "whole log")
    }

    fn lateness(&self, buffer: &mut Buffer, area: Rect) {
        let inner = self.title(buffer, area, "lateness of ticks", self.whole_log());
        if let Some(frame) = &self.model.frame {
            histogram::draw(buffer, inner, self.palette, &frame.totals.lateness_bins);
        }
    }

    fn durations(&self, buffer: &mut Buffer, area: Rect) {
        let inner = self.title(buffer, area, "tick time", self.whole_log());
        if let Some(frame) = &self.model.frame {
            histogram::draw(buffer, inner, self.palette, &frame.totals.duration_bins);
        }
    }

    fn events(&self, buffer: &mut Buffer, area: Rect, skip: usize) {
        let (events, _) = self.model.all_events();
        let all = self.model.more_events.saturating_add(events.len() as u64);
        let inner = self.title(buffer, area, "events", &all.to_string());
        rows::events(buffer, inner, self.model, self.palette, skip);
    }

    /// The overview of a small terminal.
    fn compact(&self, buffer: &mut Buffer, area: Rect) {
        let numbers = self.numbers();
        let (top, bottom) = split_rows(area, (area.height / 2 + 1).min(area.height));
        let (left, right) = split_columns(top, (top.width - 48).min(2 * top.height + 20));
        self.body(buffer, left);
        let inner = self.title(buffer, right, "state", "");
        rows::draw(buffer, inner, &numbers, self.palette);
        let (left, right) = split_columns(bottom, (bottom.width - 1) / 2);
        let charts: Vec<Vec<Chart>> = (0..self.hands()).map(|k| vec![Chart::Force(k)]).collect();
        self.stack(buffer, left, &charts, 4);
        let (up, down) = split_rows(right, right.height.div_ceil(2));
        if self.has_times() {
            self.lateness(buffer, up);
        } else {
            let hands = 0..self.hands();
            let charts: Vec<_> = hands.map(|k| vec![Chart::Position(k)]).collect();
            self.stack(buffer, up, &charts, 5);
        }
        self.events(buffer, down, 0);
    }

    /// The overview of a large terminal.
    fn wide(&self, buffer: &mut Buffer, area: Rect) {
        let side = (area.width / 3).clamp(47, 64);
        let charts = (area.width - side) * 9 / 20;
        let (left, rest) = split_columns(area, area.width - side - charts - 2);
        let (middle, right) = split_columns(rest, charts);
        let (top, bottom) = split_rows(left, left.height - (left.height / 4).max(6));
        self.body(buffer, top);
        self.events(buffer, bottom, 0);
        let hands = self.hands();
        let has_times = self.has_times();
        let positions = (0..hands).map(|k| vec![Chart::Position(k)]);
        let mut rows: Vec<Vec<Chart>> = Vec::new();
        for k in 0..hands {
            rows.push(vec![Chart::Force(k)]);
            rows.extend(has_times.then(|| vec![Chart::Position(k)]));
        }
        rows.extend((0..self.bodies()).map(|k| vec![Chart::Energy(k)]));
        self.stack(buffer, middle, &rows, 6);
        let numbers = self.numbers();
        let wanted = (numbers.len() as u16 + 1).min(right.height.saturating_sub(14));
        let (top, bottom) = split_rows(right, wanted);
        let inner = self.title(buffer, top, "state", "");
        rows::draw(buffer, inner, &numbers, self.palette);
        if has_times {
            let (up, down) = split_rows(bottom, bottom.height / 2);
            self.lateness(buffer, up);
            self.durations(buffer, down);
        } else {
            // In virtual time the age of the models is that of the scene, and shows nothing.
            self.stack(buffer, bottom, &positions.collect::<Vec<_>>(), 6);
        }
    }

    fn body_tab(&self, buffer: &mut Buffer, area: Rect) {
        let side = (area.width / 3).clamp(30, 60);
        let (left, right) = split_columns(area, area.width - side - 1);
        self.body(buffer, left);
        let hands = rows::hands(self.model, self.palette);
        let (top, bottom) = split_rows(right, hands.len() as u16 + 1);
        let inner = self.title(buffer, top, "hands", "");
        rows::draw(buffer, inner, &hands, self.palette);
        let mut bodies = rows::models(self.model, self.palette);
        if bodies.len() <= 4 {
            bodies.extend(rows::energy(self.model, self.palette));
        }
        let inner = self.title(buffer, bottom, "bodies", "");
        rows::draw(buffer, inner, &bodies, self.palette);
    }

    fn charts_tab(&self, buffer: &mut Buffer, area: Rect) {
        let mut all: Vec<Vec<Chart>> = (0..self.hands())
            .map(|k| vec![Chart::Force(k), Chart::Position(k)])
            .collect();
        all.extend((0..self.bodies()).map(|k| vec![Chart::Age(k), Chart::Energy(k)]));
        self.stack(buffer, area, &all, 6);
    }

    fn timing_tab(&self, buffer: &mut Buffer, area: Rect) {
        let (top, bottom) = split_rows(area, (area.height * 2 / 5).max(7));
        let (left, right) = split_columns(top, (area.width - 1) / 2);
        self.lateness(buffer, left);
        self.durations(buffer, right);
        let mut numbers = rows::ticks(self.model, self.palette);
        numbers.extend(rows::host(self.model, self.palette));
        numbers.extend(rows::medians(self.model, self.palette));
        numbers.extend(rows::models(self.model, self.palette));
        let (left, right) = split_columns(bottom, ((area.width - 1) / 2).max(47));
        let inner = self.title(buffer, left, "state", "");
        rows::draw(buffer, inner, &numbers, self.palette);
        let mut charts = vec![vec![Chart::Lateness]];
        charts.extend((0..self.bodies()).map(|k| vec![Chart::Age(k)]));
        self.stack(buffer, right, &charts, 6);
    }

    fn events_tab(&self, buffer: &mut Buffer, area: Rect) {
        let (_, past) = self.model.all_events();
        self.events(buffer, area, self.view.scroll.min(past.saturating_sub(1)));
    }

    fn help(&self, buffer: &mut Buffer, area: Rect) {
        let keys = help(self.model.is_log(), self.view.operates);
        let height = (keys.len() as u16 + 2).min(area.height);
        let width = 66.min(area.width);
        let at = Rect {
            x: area.x + (area.width - width) / 2,
            y: area.y + (area.height - height) / 2,
            width,
            height,
        };
        for y in at.y..at.y + height {
            let blank = " ".repeat(usize::from(width));
            let _ = buffer.set_stringn(at.x, y, blank, usize::from(width), Style::reset());
        }
        let inner = self.title(buffer, at, "keys", "");
        for (y, (key, text)) in (inner.y..inner.y + inner.height).zip(keys) {
            let _ = buffer.set_stringn(inner.x + 2, y, key, 12, self.palette.label());
            let _ =
                buffer.set_stringn(inner.x + 14, y, text, usize::from(width) - 15, Style::new());
        }
        let last = at.y + height - 1;
        let rule = "─".repeat(usize::from(width));
        let _ = buffer.set_stringn(at.x, last, rule, usize::from(width), self.palette.faint());
    }
}
