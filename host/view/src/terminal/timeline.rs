//! The timeline of a log: the state of the playback, and below it the whole log with its events.

use super::format::{digits, fit, instant};
use super::model::{Model, kind};
use super::palette::{HEAD, Palette};
use host::live::{Playback, Range};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};

/// Draws the two rows. The second row shows the largest force of any hand, and the letters of events.
pub(super) fn draw(buffer: &mut Buffer, area: Rect, model: &Model, palette: Palette) {
    if area.height < 2 || area.width == 0 {
        return;
    }
    let width = usize::from(area.width);
    let Some(playback) = &model.playback else {
        let _ = buffer.set_stringn(area.x, area.y, "no log yet", width, palette.faint());
        return;
    };
    let state = if playback.playing {
        "▶ plays"
    } else {
        "‖ paused"
    };
    let mut parts = vec![
        format!("{state} at {} x", digits(playback.speed)),
        format!("{} of {}", instant(playback.at_ns), instant(playback.to_ns)),
        format!("tick {}", playback.tick),
    ];
    if !playback.complete {
        parts.push("the log has no end: its writer was killed".into());
    }
    parts.extend(playback.notes.iter().cloned());
    parts.push("letters: T trip, M missed, S stale, W worst, R tear".into());
    let mut text = String::new();
    for part in parts {
        if text.chars().count() + part.chars().count() + 2 <= width {
            text = if text.is_empty() {
                part
            } else {
                format!("{text}  {part}")
            };
        }
    }
    let _ = buffer.set_stringn(area.x, area.y, fit(&text, width), width, HEAD);
    line(buffer, area, playback, palette);
}

fn line(buffer: &mut Buffer, area: Rect, playback: &Playback, palette: Palette) {
    const BARS: [&str; 8] = ["▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];
    let width = usize::from(area.width);
    let y = area.y + 1;
    let span = playback.to_ns.saturating_sub(playback.from_ns).max(1) as f64;
    let column = |ns: u64| {
        let part = ns.saturating_sub(playback.from_ns) as f64 / span;
        ((part * width as f64) as usize).min(width - 1)
    };
    let mut forces = vec![Range::EMPTY; width];
    for piece in &playback.overview {
        for hand in &piece.hands {
            let (first, last) = (column(piece.from_ns), column(piece.to_ns));
            for force in forces.iter_mut().take(last + 1).skip(first) {
                force.merge(&hand.force_norm);
            }
        }
    }
    let most = forces.iter().map(|f| f.most).fold(1e-9, f64::max);
    for (x, force) in (area.x..).zip(&forces) {
        let symbol = if force.is_empty() {
            "·"
        } else {
            let part = (force.most / most).clamp(0.0, 1.0);
            BARS[(part * 7.0).round() as usize]
        };
        let _ = buffer.set_stringn(x, y, symbol, 1, palette.faint());
    }
    for event in &playback.events {
        let x = area.x + column(event.time_ns) as u16;
        let letter = kind(event.kind).0.to_string();
        let style = palette.label().add_modifier(Modifier::BOLD);
        let _ = buffer.set_stringn(x, y, letter, 1, style);
    }
    let x = area.x + column(playback.at_ns) as u16;
    if let Some(cell) = buffer.cell_mut((x, y)) {
        cell.set_style(Style::new().add_modifier(Modifier::REVERSED));
    }
}
