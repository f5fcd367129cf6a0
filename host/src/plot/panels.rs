//! Several line charts on one page, in rows and columns, with one legend.

use plotters::prelude::*;

use super::axis::Axis;
use super::chart::Series;
use super::page::{self, Area, Axes, Drawn, Entry, Key};

const WIDTH: i32 = 400;
const HEIGHT: i32 = 270;
/// Height of title, subtitle and the margin of the legend (pixels).
const TOP: i32 = 56;

/// One of several charts on a page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// The label of the x axis, with its unit.
    pub x_label: String,
    /// The label of the y axis, with its unit.
    pub y_label: String,
    /// Whether x is logarithmic. Points with x at or below zero are then omitted.
    pub log_x: bool,
    /// The lines. The n-th line has the same colour in every panel. The legend takes the names from the first
    /// panel.
    pub series: Vec<Series>,
}

/// Draws `panels` row by row, `columns` in each row, as SVG. All panels have one size.
pub fn panels_svg(title: &str, subtitle: &str, columns: usize, panels: &[Panel]) -> String {
    let columns = columns.max(1);
    let rows = panels.len().div_ceil(columns).max(1);
    let width = WIDTH * columns as i32;
    let height = TOP + 30 + HEIGHT * rows as i32;
    page::svg(width, height, |area| {
        page::title(area, title, subtitle)?;
        let names = panels.first().map_or(&[][..], |panel| &panel.series);
        let entry = |(i, one): (usize, &Series)| Entry {
            name: one.name.clone(),
            key: Key::Line(page::series_color(i), one.marker),
        };
        let entries: Vec<_> = names.iter().enumerate().map(entry).collect();
        let top = TOP + page::legend(area, width, TOP, &entries)?;
        let (_, below) = area.split_vertically(top * page::UNITS);
        let parts = below.split_evenly((rows, columns));
        for (part, panel) in parts.iter().zip(panels) {
            draw(part, panel)?;
        }
        Ok(())
    })
}

fn draw(area: &Area, panel: &Panel) -> Drawn {
    let points = || panel.series.iter().flat_map(|one| one.points.iter());
    let x = points().map(|point| point.0);
    let x = if panel.log_x {
        Axis::logarithmic(x)
    } else {
        Axis::linear(x, 0.02, 6.0)
    };
    let y = Axis::linear(points().map(|point| point.1), 0.05, 6.0);
    let axes = Axes {
        x: &x,
        y: &y,
        x_label: Some(&panel.x_label),
        y_label: &panel.y_label,
    };
    let mut drawn = page::panel(area, &axes)?;
    page::grid(&mut drawn, &axes)?;
    let mut empty = true;
    for (i, one) in panel.series.iter().enumerate() {
        let place = |&(a, b): &(f64, f64)| x.place(a).zip(y.place(b));
        let points: Vec<_> = one.points.iter().filter_map(place).collect();
        if points.len() > 1 {
            empty = false;
            let style = page::stroke(page::series_color(i), 1.5);
            drawn.draw_series([PathElement::new(points, style)])?;
        }
    }
    if empty {
        page::nothing(&drawn)?;
    }
    Ok(())
}
