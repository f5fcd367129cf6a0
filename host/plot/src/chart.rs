//! A line chart, for the tables of benchmarks.

use super::axis::{Axis, Scale};
use super::ink::Role;
use super::lines;
use super::page::{self, Area, Axes, Drawn, Entry, Key, Marker};
use super::picture::Picture;

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
    /// The quantity that the line shows. It determines the look of the line.
    pub role: Role,
    /// For each point, the range of its x over repetitions; empty if nothing was repeated.
    pub spread: Vec<[f64; 2]>,
}

/// Draws lines on linear or logarithmic axes, 720 by 460 pixels. Labels include the unit. A point that
/// an axis cannot show (not a number, or not above zero on a logarithmic axis) is omitted. The legend states
/// the number of omitted points.
///
/// ```
/// use plot::{Marker, Series, line_chart};
///
/// let series = Series {
///     name: "linear".to_owned(),
///     points: vec![(30.0, 1e-2), (60.0, 3e-3)],
///     marker: Marker::Circle,
///     ..Series::default()
/// };
/// let picture = line_chart("Error", "Rate (Hz)", "Error (N)", true, true, &[series]);
/// assert!(picture.svg().contains("Rate (Hz)"));
/// ```
pub fn line_chart(
    title: &str,
    x_label: &str,
    y_label: &str,
    log_x: bool,
    log_y: bool,
    series: &[Series],
) -> Picture {
    let points = || series.iter().flat_map(|s| s.points.iter());
    let ranges = series.iter().flat_map(|s| s.spread.iter().flatten());
    let x = points().map(|point| point.0).chain(ranges.copied());
    let x = Axis::new(scale(log_x), x, 0.05, 8.0);
    let y = Axis::new(scale(log_y), points().map(|point| point.1), 0.05, 8.0);
    let axes = Axes {
        x: &x,
        y: &y,
        x_label: Some(x_label),
        y_label,
    };
    page::picture(WIDTH, HEIGHT, |area| draw(area, title, &axes, series))
}

fn scale(logarithmic: bool) -> Scale {
    if logarithmic {
        Scale::Logarithmic
    } else {
        Scale::Linear
    }
}

fn draw(area: &Area, title: &str, axes: &Axes, series: &[Series]) -> Drawn {
    let top = page::title(area, title, "")?;
    let entry = |(i, one): (usize, &Series)| {
        let shown = |(x, y): &&(f64, f64)| axes.x.place(*x).is_some() && axes.y.place(*y).is_some();
        let name = match one.points.len() - one.points.iter().filter(shown).count() {
            0 => one.name.clone(),
            left_out => format!("{} ({left_out} not drawn)", one.name),
        };
        Entry {
            name,
            key: Key::Ink(one.role.ink(i), one.marker),
        }
    };
    let entries: Vec<_> = series.iter().enumerate().map(entry).collect();
    let top = top + page::legend(area, WIDTH, top, &entries)?;
    let (_, below) = area.split_vertically(top * page::UNITS);
    let mut panel = page::panel(&below, axes)?;
    page::grid(&mut panel, axes)?;
    page::breaks(area, &panel, axes)?;
    if !lines::draw(area, &panel, [axes.x, axes.y], series)? {
        page::nothing(&panel)?;
    }
    Ok(())
}
