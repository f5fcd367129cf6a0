//! A line chart, for the tables of benchmarks.

use plotters::prelude::*;

use super::axis::Axis;
use super::page::{self, Area, Axes, Drawn, Entry, Key, Marker};

const WIDTH: i32 = 720;
const HEIGHT: i32 = 460;

/// One line of a chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// The name of the line in the legend.
    pub name: String,
    /// The points of the line, in their order along the line.
    pub points: Vec<(f64, f64)>,
    /// The mark at each point.
    pub marker: Marker,
}

/// Draws lines on linear or logarithmic axes, 720 by 460 pixels. Labels include the unit. A point that
/// an axis cannot show (not a number, or not above zero on a logarithmic axis) is omitted. The legend states
/// the number of omitted points.
///
/// ```
/// use host::plot::{Marker, Series, line_chart_svg};
///
/// let series = Series {
///     name: "linear".to_owned(),
///     points: vec![(30.0, 1e-2), (60.0, 3e-3)],
///     marker: Marker::Circle,
/// };
/// let svg = line_chart_svg("Error", "rate (Hz)", "error (N)", true, true, &[series]);
/// assert!(svg.contains("rate (Hz)"));
/// ```
pub fn line_chart_svg(
    title: &str,
    x_label: &str,
    y_label: &str,
    log_x: bool,
    log_y: bool,
    series: &[Series],
) -> String {
    let points = || series.iter().flat_map(|s| s.points.iter());
    let x = axis(points().map(|point| point.0), log_x);
    let y = axis(points().map(|point| point.1), log_y);
    let axes = Axes {
        x: &x,
        y: &y,
        x_label: Some(x_label),
        y_label,
    };
    page::svg(WIDTH, HEIGHT, |area| draw(area, title, &axes, series))
}

fn axis(values: impl Iterator<Item = f64>, log: bool) -> Axis {
    if log {
        Axis::logarithmic(values)
    } else {
        Axis::linear(values, 0.05, 8.0)
    }
}

fn draw(area: &Area, title: &str, axes: &Axes, series: &[Series]) -> Drawn {
    page::title(area, title, "")?;
    let mut entries = Vec::new();
    let mut placed = Vec::new();
    for (i, one) in series.iter().enumerate() {
        let place = |&(x, y): &(f64, f64)| axes.x.place(x).zip(axes.y.place(y));
        let points: Vec<_> = one.points.iter().filter_map(place).collect();
        let name = match one.points.len() - points.len() {
            0 => one.name.clone(),
            left_out => format!("{} ({left_out} not drawn)", one.name),
        };
        entries.push(Entry {
            name,
            key: Key::Line(page::series_color(i), one.marker),
        });
        placed.push((points, one.marker));
    }
    let top = 36;
    let top = top + page::legend(area, WIDTH, top, &entries)?;
    let (_, below) = area.split_vertically(top * page::UNITS);
    let mut panel = page::panel(&below, axes)?;
    page::grid(&mut panel, axes)?;
    if placed.iter().all(|(points, _)| points.is_empty()) {
        page::nothing(&panel)?;
    }
    for (i, (points, marker)) in placed.into_iter().enumerate() {
        let color = page::series_color(i);
        let marks: Vec<_> = points
            .iter()
            .map(|point| panel.backend_coord(point))
            .collect();
        if points.len() > 1 {
            panel.draw_series([PathElement::new(points, page::stroke(color, 1.75))])?;
        }
        for (x, y) in marks {
            marker.draw(area, x, y, color)?;
        }
    }
    Ok(())
}
