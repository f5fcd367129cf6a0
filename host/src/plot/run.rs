//! The picture of a run: the force on the hands above, the displacement of the devices below, over the same time.
//!
//! Each device is drawn along the principal direction of its force, which the labels name. Bands mark the
//! intervals in which a limit or a fault acted on the force.

use nalgebra::Vector3;
use plotters::prelude::*;

use super::axis::Axis;
use super::direction::{Direction, first_usable, main_direction};
use super::page::{self, Area, Axes, Drawn, Entry, Key, Marker};
use super::reduce::{reduce, usable};

const WIDTH: i32 = 960;
const HEIGHT: i32 = 600;

/// The data of a run that are drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PlotData {
    /// The title: scene and scheme.
    pub title: String,
    /// The smaller line under the title.
    pub subtitle: String,
    /// Time of each sample (s), increasing.
    pub time: Vec<f64>,
    /// The devices.
    pub devices: Vec<DeviceSeries>,
    /// The intervals to mark.
    pub marks: Vec<Mark>,
}

/// One device of a [`PlotData`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct DeviceSeries {
    /// Its name in the legend.
    pub name: String,
    /// Force on the hand at each time (N).
    pub force: Vec<[f64; 3]>,
    /// Position of the device at each time (m).
    pub position: Vec<[f64; 3]>,
}

/// An interval in which a limit or a fault acted on the force.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mark {
    /// Its beginning (s).
    pub from: f64,
    /// End of the interval (s).
    pub to: f64,
    /// The cause, such as `force limited`. Marks of the same label have the same colour.
    pub label: String,
}

/// Draws force and displacement of all devices over time, 960 by 600 pixels. What is not a number is
/// left out.
pub(crate) fn force_and_position_svg(data: &PlotData) -> String {
    let devices: Vec<Trace> = data.devices.iter().map(Trace::new).collect();
    page::svg(WIDTH, HEIGHT, |area| draw(area, data, &devices))
}

/// One device along its direction.
struct Trace<'a> {
    series: &'a DeviceSeries,
    direction: Direction,
    start: Vector3<f64>,
}

impl<'a> Trace<'a> {
    fn new(series: &'a DeviceSeries) -> Self {
        let direction = main_direction(&series.force, &series.position);
        Self {
            series,
            direction,
            start: first_usable(&series.position),
        }
    }

    /// Force (N) over time.
    fn force(&self, time: &[f64]) -> Vec<(f64, f64)> {
        let force = self.series.force.iter();
        let along = force.map(|f| self.direction.axis.dot(&Vector3::from(*f)));
        time.iter().copied().zip(along).collect()
    }

    /// Displacement from the start (mm) over time.
    fn displacement(&self, time: &[f64]) -> Vec<(f64, f64)> {
        let moved = self
            .series
            .position
            .iter()
            .map(|p| Vector3::from(*p) - self.start);
        let along = moved.map(|d| 1e3 * self.direction.axis.dot(&d));
        time.iter().copied().zip(along).collect()
    }
}

fn draw(area: &Area, data: &PlotData, devices: &[Trace]) -> Drawn {
    page::title(area, &data.title, &data.subtitle)?;
    // The axes name a direction that all devices have in common. Otherwise the legend names each direction.
    let common = devices.first().map(|first| &first.direction.name);
    let common = common.filter(|name| devices.iter().all(|d| d.direction.name == **name));
    let along = common.map_or_else(String::new, |name| format!(" along {name}"));
    let bands = bands(&data.marks, &data.time);

    let lines = devices.iter().enumerate().map(|(i, device)| {
        let mut name = device.series.name.clone();
        if common.is_none() {
            name = format!("{name}, along {}", device.direction.name);
        }
        Entry {
            name,
            key: Key::Line(page::series_color(i), Marker::None),
        }
    });
    let patches = bands.iter().map(|band| Entry {
        name: band.label.to_owned(),
        key: Key::Band(band.color),
    });
    let legend_height = page::legend(area, WIDTH, 56, &lines.chain(patches).collect::<Vec<_>>())?;

    let top = 56 + legend_height;
    let panel_height = (HEIGHT - top - page::BELOW) / 2;
    let (_, below) = area.split_vertically(top * page::UNITS);
    let (upper, lower) = below.split_vertically(panel_height * page::UNITS);
    let time = Axis::linear(data.time.iter().copied(), 0.0, 12.0);

    let force: Vec<_> = devices.iter().map(|d| d.force(&data.time)).collect();
    let label = format!("Force{along} (N)");
    draw_panel(&upper, &time, None, &label, &force, &bands)?;

    let moved: Vec<_> = devices.iter().map(|d| d.displacement(&data.time)).collect();
    let label = format!("Displacement{along} (mm)");
    draw_panel(&lower, &time, Some("Time (s)"), &label, &moved, &bands)
}

fn draw_panel(
    area: &Area,
    time: &Axis,
    x_label: Option<&str>,
    y_label: &str,
    series: &[Vec<(f64, f64)>],
    bands: &[Band],
) -> Drawn {
    // The axis always includes zero, which is no force or no displacement.
    let values = series.iter().flatten().map(|point| point.1).chain([0.0]);
    let y = Axis::linear(values, 0.06, 8.0);
    let axes = Axes {
        x: time,
        y: &y,
        x_label,
        y_label,
    };
    let mut panel = page::panel(area, &axes)?;
    for band in bands {
        let fill = page::band_fill(band.color);
        let bars = band
            .spans
            .iter()
            .map(|span| Rectangle::new([(span.0, y.from), (span.1, y.to)], fill));
        panel.draw_series(bars)?;
    }
    page::grid(&mut panel, &axes)?;
    let height = panel.plotting_area().dim_in_pixel().1;
    let strip = y.to - (y.to - y.from) * f64::from(page::STRIP * page::UNITS) / f64::from(height);
    for band in bands {
        let fill = band.color.filled();
        let strips = band
            .spans
            .iter()
            .map(|span| Rectangle::new([(span.0, strip), (span.1, y.to)], fill));
        panel.draw_series(strips)?;
    }
    if series.iter().all(Vec::is_empty) {
        page::nothing(&panel)?;
    }
    let zero = PathElement::new([(time.from, 0.0), (time.to, 0.0)], page::zero_style());
    panel.draw_series([zero])?;
    for (i, points) in series.iter().enumerate() {
        let color = page::series_color(i);
        let lines = reduce(points.iter().copied(), |x| column(time, x));
        for line in lines {
            if let [(x, y)] = line[..] {
                let dot = Circle::new((x, y), 2 * page::UNITS, color.filled());
                panel.draw_series([dot])?;
            } else {
                panel.draw_series([PathElement::new(line, page::stroke(color, 1.25))])?;
            }
        }
    }
    Ok(())
}

/// The pixel column of a time.
fn column(time: &Axis, x: f64) -> i64 {
    let width = f64::from(WIDTH - page::LEFT - page::RIGHT);
    ((x - time.from) / (time.to - time.from) * width).floor() as i64
}

/// All marks of one label.
struct Band<'a> {
    label: &'a str,
    color: RGBColor,
    spans: Vec<(f64, f64)>,
}

/// The marks by label, in the order of first appearance. Marks closer than a pixel are merged.
fn bands<'a>(marks: &'a [Mark], time: &[f64]) -> Vec<Band<'a>> {
    let axis = Axis::linear(time.iter().copied(), 0.0, 12.0);
    let pixel = (axis.to - axis.from) / f64::from(WIDTH - page::LEFT - page::RIGHT);
    let mut bands: Vec<Band> = Vec::new();
    for mark in marks {
        let (from, to) = (mark.from.max(axis.from), mark.to.min(axis.to));
        if !(usable(mark.from) && usable(mark.to) && from <= to) {
            continue;
        }
        let at = bands
            .iter()
            .position(|band| band.label == mark.label)
            .unwrap_or_else(|| {
                let color = page::band_color(bands.len());
                bands.push(Band {
                    label: &mark.label,
                    color,
                    spans: Vec::new(),
                });
                bands.len() - 1
            });
        // A span is at least two pixels wide, so that a short mark is visible.
        let short = (pixel - 0.5 * (to - from)).max(0.0);
        bands[at]
            .spans
            .push(((from - short).max(axis.from), (to + short).min(axis.to)));
    }
    for band in &mut bands {
        band.spans.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut merged: Vec<(f64, f64)> = Vec::new();
        for (from, to) in band.spans.drain(..) {
            match merged.last_mut() {
                Some(last) if from <= last.1 + pixel => last.1 = last.1.max(to),
                _ => merged.push((from, to)),
            }
        }
        band.spans = merged;
    }
    bands
}
