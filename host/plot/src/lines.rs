//! Lines with marks in a panel, as the line chart and the page of several panels draw them.

use plotters::prelude::*;

use super::axis::Axis;
use super::chart::Series;
use super::ink::{Ink, dashes};
use super::page::{self, Area, Drawn, Marker, UNITS};

/// Draws the lines. `page` and `panel` are the area of the page and the panel on it. Says whether something was drawn.
pub(super) fn draw(
    page: &Area,
    panel: &page::Panel,
    axes: [&Axis; 2],
    series: &[Series],
) -> Drawn<bool> {
    let mut drawn = false;
    for (i, one) in series.iter().enumerate() {
        let ink = one.role.ink(i);
        let place = |&(x, y): &(f64, f64)| axes[0].place(x).zip(axes[1].place(y));
        let at = |point: &(f64, f64)| place(point).map(|place| panel.backend_coord(&place));
        for (point, [from, to]) in one.points.iter().zip(&one.spread) {
            let ends = [*from, *to].map(|x| at(&(x, point.1)));
            if let [Some(from), Some(to)] = ends {
                whisker(page, from, to, ink.color)?;
            }
        }
        let points: Vec<_> = one.points.iter().filter_map(at).collect();
        drawn |= !points.is_empty();
        // A single point without a mark would not be visible.
        let marker = match (one.marker, points.len()) {
            (Marker::None, 1) => Marker::Circle,
            (marker, _) => marker,
        };
        line(page, &points, ink)?;
        for (x, y) in points {
            marker.draw(page, x, y, ink.color)?;
        }
    }
    Ok(drawn)
}

/// Draws a line through points of the page, with its dashes.
pub(super) fn line(page: &Area, path: &[(i32, i32)], ink: Ink) -> Drawn {
    if path.len() < 2 {
        return Ok(());
    }
    let pattern: Vec<f64> = ink.dash.iter().map(|d| d * f64::from(UNITS)).collect();
    let style = page::stroke(ink.color, ink.width);
    for piece in dashes(path, &pattern) {
        page.draw(&PathElement::new(piece, style))?;
    }
    Ok(())
}

/// Draws a range as a thin bar with ends.
fn whisker(page: &Area, from: (i32, i32), to: (i32, i32), color: RGBColor) -> Drawn {
    let style = page::stroke(color, 1.0);
    let half = 3 * UNITS;
    let bars = [
        [from, to],
        [(from.0, from.1 - half), (from.0, from.1 + half)],
        [(to.0, to.1 - half), (to.0, to.1 + half)],
    ];
    for bar in bars {
        page.draw(&PathElement::new(bar, style))?;
    }
    Ok(())
}
