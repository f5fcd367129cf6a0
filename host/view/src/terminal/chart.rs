//! A moving chart: for each column of dots, a vertical line from the least to the greatest value of the ticks in that
//! column. A spike of one tick is as high as it was.

use super::dots::Dots;
use super::format::digits;
use super::palette::Palette;
use crate::history::History;
use host::live::{Folded, Range};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::Style;

/// Largest magnitude that is drawn, so that differences stay finite.
const LARGEST: f64 = 1e30;

/// One curve.
pub(super) struct Curve {
    /// The letter at its end; a space for none.
    pub(super) letter: char,
    pub(super) style: Style,
    /// The range of the values in each column of dots.
    pub(super) columns: Vec<Range>,
}

/// The window of time of a chart (ns).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    pub(super) from_ns: i64,
    pub(super) to_ns: i64,
}

/// A time as a number from which others can be subtracted. No run lasts 36 years.
pub(super) fn ns(time: u64) -> i64 {
    time.min(1 << 60) as i64
}

/// The ranges of a quantity in `count` columns over the window.
pub(super) fn columns(
    history: &History,
    window: Window,
    count: usize,
    of: impl Fn(&Folded) -> Range,
) -> Vec<Range> {
    let mut columns = vec![Range::EMPTY; count];
    let span = (window.to_ns - window.from_ns).max(1) as f64;
    let column = |time: u64| ((ns(time) - window.from_ns) as f64 / span * count as f64).floor();
    for piece in history.pieces() {
        let range = of(piece);
        let (first, last) = (column(piece.from_ns), column(piece.to_ns));
        if range.is_empty() || last < 0.0 || first > count as f64 {
            continue;
        }
        // The last moment of the window lies in the last column.
        let last = (last as usize).min(count.saturating_sub(1));
        let first = (first.max(0.0) as usize).min(last);
        let range = Range {
            least: range.least.clamp(-LARGEST, LARGEST),
            most: range.most.clamp(-LARGEST, LARGEST),
        };
        for column in columns.iter_mut().take(last + 1).skip(first) {
            column.merge(&range);
        }
    }
    columns
}

/// A step of 1, 2 or 5 times a power of ten, at least `least`.
fn nice(least: f64) -> f64 {
    let power = 10_f64.powf(least.max(1e-30).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * power);
    // The tolerance keeps 0.2 for 0.2 and a rounding error.
    let fits = steps.into_iter().find(|step| *step >= least * (1.0 - 1e-9));
    fits.unwrap_or(steps[3])
}

/// The ends of the axis for values in `range`: round numbers. `zero`: the axis begins at zero.
pub(super) fn axis(range: Range, zero: bool) -> (f64, f64) {
    if range.is_empty() {
        return (0.0, 1.0);
    }
    if zero && range.least >= 0.0 {
        // Finer steps than below: the curve has most of the height.
        let step = nice(range.most.max(1e-12) / 10.0);
        return (0.0, (range.most / step - 1e-9).ceil().max(1.0) * step);
    }
    let size = range.most.abs().max(range.least.abs());
    let step = nice(
        ((range.most - range.least) / 4.0)
            .max(1e-3 * size)
            .max(1e-12),
    );
    // A rounding error beyond a round number costs no step of the axis.
    let least = (range.least / step + 0.02).floor();
    let most = (range.most / step - 0.02).ceil();
    let most = if most > least { most } else { least + 1.0 };
    (least * step, most * step)
}

/// Leaves out the curves that hardly change if another one does: they would take the height of those that change.
pub(super) fn without_constants(curves: &mut Vec<Curve>) {
    let extent = |curve: &Curve| {
        let mut all = Range::EMPTY;
        for range in &curve.columns {
            all.merge(range);
        }
        if all.is_empty() {
            0.0
        } else {
            all.most - all.least
        }
    };
    let most = curves.iter().map(extent).fold(0.0, f64::max);
    curves.retain(|curve| extent(curve) >= 0.05 * most);
}

/// Width of the numbers at the left of a chart.
pub(super) const GUTTER: u16 = 7;

/// The columns of dots of a chart of this width.
pub(super) fn dots_across(width: u16) -> usize {
    2 * usize::from(width.saturating_sub(GUTTER + 2))
}

/// Draws the curves with their axis, which covers the values in `covers`, too. `cursor`: the part of the width at which the
/// shown moment lies.
pub(super) fn draw(
    buffer: &mut Buffer,
    area: Rect,
    palette: Palette,
    curves: &[Curve],
    (zero, covers): (bool, Range),
    cursor: Option<f64>,
) {
    if area.width <= GUTTER + 3 || area.height == 0 {
        return;
    }
    let mut all = covers;
    for range in curves.iter().flat_map(|curve| &curve.columns) {
        all.merge(range);
    }
    let (bottom, top) = axis(all, zero);
    let inner = Rect {
        x: area.x + GUTTER,
        width: area.width - GUTTER - 2,
        ..area
    };
    let end = area.y + area.height - 1;
    let number = |value: f64| {
        let text = digits(value);
        // Axes end at round numbers.
        let text = text.trim_end_matches(".00").trim_end_matches(".0");
        format!("{text:>width$}", width = usize::from(GUTTER) - 1)
    };
    let faint = palette.faint();
    for y in area.y..=end {
        let _ = buffer.set_stringn(inner.x - 1, y, "│", 1, faint);
    }
    let width = usize::from(GUTTER) - 1;
    let _ = buffer.set_stringn(area.x, area.y, number(top), width, faint);
    if end > area.y {
        let _ = buffer.set_stringn(area.x, end, number(bottom), width, faint);
    }
    let mut dots = Dots::new(inner);
    let high = dots.height() as f64 - 1.0;
    let row = |value: f64| ((top - value) / (top - bottom) * high).clamp(0.0, high);
    if let Some(cursor) = cursor {
        let x = inner.x + ((cursor * f64::from(inner.width)) as u16).min(inner.width - 1);
        for y in area.y..=end {
            let _ = buffer.set_stringn(x, y, "┊", 1, faint);
        }
    }
    let mut taken = vec![false; usize::from(area.height)];
    for curve in curves {
        let mut before = Range::EMPTY;
        for (x, range) in curve.columns.iter().enumerate() {
            if range.is_empty() {
                continue;
            }
            // A column reaches to the column before it, so that the curve has no gap.
            let (mut least, mut most) = (range.least, range.most);
            if !before.is_empty() {
                least = least.min(before.most);
                most = most.max(before.least);
            }
            before = *range;
            let (up, down) = (row(most).round() as usize, row(least).round() as usize);
            for y in up..=down {
                dots.set(x, y, curve.style);
            }
        }
        if curve.letter != ' ' && !before.is_empty() {
            let middle = f64::midpoint(before.least, before.most);
            let wanted = (row(middle) as usize / 4).min(taken.len() - 1);
            let free = (0..taken.len())
                .filter(|y| !taken[*y])
                .min_by_key(|y| y.abs_diff(wanted));
            let y = free.unwrap_or(wanted);
            taken[y] = true;
            let (x, y) = (inner.x + inner.width, area.y + y as u16);
            let _ = buffer.set_stringn(x, y, curve.letter.to_string(), 1, curve.style);
        }
    }
    dots.draw(buffer);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_ends_at_round_numbers_around_its_values() {
        let range = |least, most| Range { least, most };
        assert_eq!(axis(range(0.3, 3.2), true), (0.0, 3.5));
        assert_eq!(axis(range(-0.3, 3.2), true), (-1.0, 4.0));
        assert_eq!(axis(range(-0.001, 3.2), true), (0.0, 4.0));
        assert_eq!(axis(range(-31.0, 12.0), false), (-40.0, 20.0));
        assert_eq!(axis(Range::EMPTY, true), (0.0, 1.0));
        let (least, most) = axis(range(7.0, 7.0), false);
        assert!(least < most && least <= 7.0 && most >= 7.0);
        for huge in [LARGEST, -LARGEST] {
            let (least, most) = axis(range(huge, huge), false);
            assert!(least < most && (most - least).is_finite());
        }
    }

    #[test]
    fn curves_that_hardly_change_leave_the_height_to_others() {
        let curve = |letter, least, most| Curve {
            letter,
            style: Style::new(),
            columns: vec![Range { least, most }, Range::EMPTY],
        };
        let letters = |mut curves: Vec<Curve>| -> String {
            without_constants(&mut curves);
            curves.iter().map(|curve| curve.letter).collect()
        };
        let moving = curve('x', 90.0, 110.0);
        assert_eq!(
            letters(vec![moving, curve('y', 7.0, 7.5), curve('z', -2.0, -1.0)]),
            "xz"
        );
        // A hand that rests shows where it rests.
        assert_eq!(
            letters(vec![curve('x', 1.0, 1.0), curve('y', 7.0, 7.0)]),
            "xy"
        );
    }

    #[test]
    fn a_column_has_the_extremes_of_its_ticks_alone() {
        let mut history = History::new(10.0);
        for k in 0..10 {
            history.push(&Folded {
                ticks: 1,
                from_ns: k * 100,
                to_ns: k * 100 + 99,
                ..Folded::default()
            });
        }
        let window = Window {
            from_ns: 0,
            to_ns: 1000,
        };
        let columns = columns(&history, window, 10, |piece| {
            let spike = if piece.from_ns == 500 { 9.0 } else { 1.0 };
            Range {
                least: 0.0,
                most: spike,
            }
        });
        for (index, column) in columns.iter().enumerate() {
            assert_eq!(column.most, if index == 5 { 9.0 } else { 1.0 });
        }
    }
}
