//! A histogram over logarithmic bins. The height of a bar grows with the logarithm of its count, so that a single late
//! tick among a million is visible.

use super::palette::Palette;
use host::live::Bins;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

/// Bins an octave, as in [`Bins`].
const OCTAVE: f64 = 4.0;

/// Index of the bin with this upper edge (ns).
fn index(edge: u64) -> i64 {
    ((edge.max(1) as f64).log2() * OCTAVE).round() as i64
}

/// The counts of each column of cells, and the first index and the indices a column.
fn columns(bins: &Bins, width: usize) -> Option<(Vec<u64>, i64, f64)> {
    let used = || bins.0.iter().filter(|(_, count)| *count > 0);
    let least = used().map(|(edge, _)| index(*edge)).min()?;
    let most = used().map(|(edge, _)| index(*edge)).max()?;
    // Whole octaves, at least eight: the axis stays while the counts grow.
    let octave = OCTAVE as i64;
    let first = (least - 1).div_euclid(octave) * octave;
    let last = ((most - 1).div_euclid(octave) + 1) * octave;
    let last = last.max(first + 8 * octave);
    let count = (last - first) as usize;
    let a_column = if width >= count {
        1.0 / (width / count) as f64
    } else {
        count.div_ceil(width.max(1)) as f64
    };
    let mut columns = vec![0_u64; width];
    for (edge, count) in used() {
        let (from, to) = (index(*edge) - 1 - first, index(*edge) - first);
        let begin = (from as f64 / a_column).floor() as usize;
        let end = ((to as f64 / a_column).ceil() as usize).max(begin + 1);
        for column in columns.iter_mut().take(end).skip(begin) {
            *column = column.saturating_add(*count);
        }
    }
    Some((columns, first, a_column))
}

/// Draws a histogram with its axis in the last row.
pub(super) fn draw(buffer: &mut Buffer, area: Rect, palette: Palette, bins: &Bins) {
    const BARS: [&str; 9] = [" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"];
    if area.height < 2 || area.width < 10 {
        return;
    }
    let Some((columns, first, a_column)) = columns(bins, usize::from(area.width)) else {
        let _ = buffer.set_stringn(area.x, area.y, "no values", 9, palette.faint());
        return;
    };
    let rows = area.height - 1;
    let most = columns.iter().copied().max().unwrap_or(1).max(1);
    for (x, count) in columns.iter().enumerate().filter(|(_, count)| **count > 0) {
        let whole = 8.0 * f64::from(rows);
        // A count of one has a visible bar.
        let part = (1.0 + *count as f64).log2() / (1.0 + most as f64).log2();
        let mut eighths = (part * whole).round().clamp(1.0, whole) as usize;
        for y in (area.y..area.y + rows).rev() {
            let here = eighths.min(8);
            eighths -= here;
            let x = area.x + x as u16;
            let _ = buffer.set_stringn(x, y, BARS[here], 1, palette.bar());
        }
    }
    axis(buffer, area, palette, first, a_column);
}

/// Marks the powers of ten.
fn axis(buffer: &mut Buffer, area: Rect, palette: Palette, first: i64, a_column: f64) {
    let y = area.y + area.height - 1;
    let end = area.x + area.width;
    let mut free = area.x;
    for power in 0..=12_i32 {
        let name = match power {
            0..=2 => format!("{} ns", 10_u64.pow(power as u32)),
            3..=5 => format!("{} µs", 10_u64.pow(power as u32 - 3)),
            6..=8 => format!("{} ms", 10_u64.pow(power as u32 - 6)),
            _ => format!("{} s", 10_u64.pow(power as u32 - 9)),
        };
        let at = (f64::from(power) * 10_f64.log2() * OCTAVE - first as f64) / a_column;
        if at < 0.0 || at >= f64::from(area.width) {
            continue;
        }
        let (x, mark) = (area.x + at as u16, format!("╵{name}"));
        let width = mark.chars().count() as u16;
        if x >= free && x + width <= end {
            let _ = buffer.set_stringn(x, y, &mark, usize::from(width), palette.faint());
            free = x + width + 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_count_has_its_column_and_none_is_lost() {
        // 1 us to 128 us: eight octaves with a count each.
        let bins = Bins((0..8).map(|k| (1024 << k, 1 + k)).collect());
        for width in [10, 32, 64, 100] {
            let (columns, _, _) = columns(&bins, width).unwrap();
            for (_, count) in &bins.0 {
                assert!(columns.iter().any(|c| c >= count), "{width}: {count}");
            }
        }
        assert!(columns(&Bins::default(), 10).is_none());
    }

    #[test]
    fn extreme_edges_draw_nothing_outside() {
        let bins = Bins(vec![(0, 1), (u64::MAX, u64::MAX)]);
        let mut buffer = Buffer::empty(Rect::new(0, 0, 20, 5));
        draw(
            &mut buffer,
            Rect::new(5, 1, 12, 3),
            Palette::default(),
            &bins,
        );
        for y in 0..5 {
            for x in (0..5).chain(17..20) {
                assert_eq!(buffer[(x, y)].symbol(), " ");
            }
        }
    }
}
