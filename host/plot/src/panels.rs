//! Several line charts on one page, in rows and columns, with one legend.

use super::axis::{Axis, Scale};
use super::chart::Series;
use super::lines;
use super::page::{self, Area, Axes, Drawn, Entry, Key, UNITS};
use super::picture::Picture;

/// Width and height of a panel (pixels), by the number of columns. No page is wider than a printed column can show.
const SIZES: [[i32; 2]; 3] = [[720, 400], [410, 280], [300, 250]];
/// Height of the title of a panel (pixels).
const TITLE: i32 = 24;

/// One of several charts on a page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// The title above the chart, or nothing.
    pub title: String,
    /// The label of the x axis, with its unit.
    pub x_label: String,
    /// The label of the y axis, with its unit.
    pub y_label: String,
    /// The scale of x. On a logarithmic one, points with x at or below zero are omitted.
    pub x_scale: Scale,
    /// The scale of y.
    pub y_scale: Scale,
    /// Values that the x axis covers in addition to those of the points, to give several panels one axis.
    pub x_covers: Vec<f64>,
    /// Values that the y axis covers in addition to those of the points.
    pub y_covers: Vec<f64>,
    /// The lines. A name occurs once in the legend, so lines of one name must have one role.
    pub series: Vec<Series>,
}

/// Draws `panels` row by row, `columns` (one to three) in each row. All panels have one size.
pub fn panels(title: &str, subtitle: &str, columns: usize, panels: &[Panel]) -> Picture {
    let columns = columns.clamp(1, SIZES.len());
    let [panel_width, panel_height] = SIZES[columns - 1];
    let rows = panels.len().div_ceil(columns).max(1) as i32;
    let width = panel_width * columns as i32;
    let titled = panels.iter().any(|panel| !panel.title.is_empty());
    let panel_height = panel_height + if titled { TITLE } else { 0 };
    let entries = entries(panels);
    let head = page::title_height(width, subtitle) + page::legend_height(width, &entries);
    page::picture(width, head + panel_height * rows, |area| {
        let top = page::title(area, title, subtitle)?;
        page::legend(area, width, top, &entries)?;
        let axes: Vec<[Axis; 2]> = panels.iter().map(axes).collect();
        // Panels below each other begin at one x.
        let lefts = axes.iter().map(|[_, y]| page::left(y));
        let left = lefts.max().unwrap_or(page::LEFT);
        for (k, (panel, axes)) in panels.iter().zip(&axes).enumerate() {
            let (row, column) = ((k / columns) as i32, (k % columns) as i32);
            let corner = (column * panel_width, head + row * panel_height);
            let place = area.clone().shrink(
                (corner.0 * UNITS, corner.1 * UNITS),
                (panel_width * UNITS, panel_height * UNITS),
            );
            let below = if titled {
                page::panel_title(&place, panel_width, &panel.title)?;
                place.split_vertically(TITLE * UNITS).1
            } else {
                place
            };
            draw(area, &below, panel, axes, left)?;
        }
        Ok(())
    })
}

/// The legend of all panels: each name once.
fn entries(panels: &[Panel]) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for panel in panels {
        for (i, one) in panel.series.iter().enumerate() {
            if entries.iter().all(|entry| entry.name != one.name) {
                entries.push(Entry {
                    name: one.name.clone(),
                    key: Key::Ink(one.role.ink(i), one.marker),
                });
            }
        }
    }
    entries
}

fn axes(panel: &Panel) -> [Axis; 2] {
    let points = || panel.series.iter().flat_map(|one| one.points.iter());
    let x = points().map(|point| point.0);
    let x = x.chain(panel.x_covers.iter().copied());
    // Curves over time fill the panel.
    let margin = if panel.x_scale == Scale::Linear {
        0.0
    } else {
        0.04
    };
    let y = points().map(|point| point.1);
    let y = y.chain(panel.y_covers.iter().copied());
    [
        Axis::new(panel.x_scale, x, margin, 5.0),
        Axis::new(panel.y_scale, y, 0.05, 6.0),
    ]
}

fn draw(page: &Area, area: &Area, panel: &Panel, [x, y]: &[Axis; 2], left: i32) -> Drawn {
    let axes = Axes {
        x,
        y,
        x_label: Some(&panel.x_label),
        y_label: &panel.y_label,
    };
    let mut drawn = page::panel_with(area, &axes, left)?;
    page::grid(&mut drawn, &axes)?;
    page::breaks(page, &drawn, &axes)?;
    if !lines::draw(page, &drawn, [x, y], &panel.series)? {
        page::nothing(&drawn)?;
    }
    Ok(())
}
