//! The picture of a run: the force on the hands above, the displacement of the devices below, over the same time.
//!
//! Each device is drawn along the principal direction of its force, along a direction that a person chooses, or by the norm.
//! The labels name the choice. Bands mark the intervals in which the force was not that of the newest model: the cap, a limit
//! or a fault acted on it.

use nalgebra::Vector3;
use plotters::prelude::*;

use super::axis::Axis;
use super::direction::{Component, Direction, first_usable, main_direction};
use super::ink::{self, Role};
use super::lines;
use super::page::{self, Area, Axes, Drawn, Entry, Key, Marker};
use super::picture::Picture;
use super::reduce::{reduce, usable};

const WIDTH: i32 = 800;
const HEIGHT: i32 = 560;

/// The data of a run that are drawn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlotData {
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
    /// The component of forces and displacements that is drawn.
    pub component: Component,
}

/// One device of a [`PlotData`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeviceSeries {
    /// Its name in the legend.
    pub name: String,
    /// Force on the hand at each time (N).
    pub force: Vec<[f64; 3]>,
    /// Position of the device at each time (m).
    pub position: Vec<[f64; 3]>,
}

/// An interval in which the force was not that of the newest model, or in which a tear grew.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Its beginning (s).
    pub from: f64,
    /// End of the interval (s).
    pub to: f64,
    /// The cause.
    pub cause: Cause,
    /// The device or the body; empty if there is one only.
    pub of: String,
}

/// The cause of a difference of the force. A cause has the same colour in every picture, which is not that of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The host published no model for long.
    Stalled,
    /// The force faded: the model was too old, or the device too fast or out of reach.
    Fading,
    /// The model was too old, and only the safe hold was left.
    Held,
    /// The cap withheld force.
    Capped,
    /// The force or its slew was at a limit.
    Limited,
    /// The device was not armed, stopped, or without its dead-man button.
    Disengaged,
    /// The force came in after the device was engaged.
    Engaging,
    /// The device gave no state.
    Silent,
    /// The device said that it renders no force.
    LetGo,
    /// The device said that it has a fault.
    Fault,
    /// The force was not a number.
    NotANumber,
    /// A tear grew.
    Torn,
}

impl Cause {
    fn name(self) -> &'static str {
        match self {
            Self::Stalled => "host stalled",
            Self::Fading => "force fading",
            Self::Held => "safe hold",
            Self::Capped => "force capped",
            Self::Limited => "force or slew limited",
            Self::Disengaged => "device disengaged",
            Self::Engaging => "force coming in",
            Self::Silent => "device silent",
            Self::LetGo => "device let go",
            Self::Fault => "fault of the device",
            Self::NotANumber => "force not a number",
            Self::Torn => "tear grows",
        }
    }

    fn color(self) -> RGBColor {
        match self {
            Self::Stalled => RGBColor(165, 165, 165),
            Self::Fading => ink::YELLOW,
            Self::Held => RGBColor(90, 90, 90),
            Self::Capped => ink::PURPLE,
            Self::Limited => ink::SKY,
            Self::Disengaged => RGBColor(200, 120, 150),
            Self::Engaging => RGBColor(235, 185, 140),
            Self::Silent => RGBColor(0, 0, 0),
            Self::LetGo => RGBColor(60, 60, 120),
            Self::Fault => RGBColor(190, 30, 30),
            Self::NotANumber => RGBColor(130, 80, 60),
            Self::Torn => RGBColor(150, 200, 60),
        }
    }
}

/// Draws force and displacement of all devices over time, 800 by 560 pixels. Values that are not numbers
/// are left out.
pub fn force_and_position(data: &PlotData) -> Picture {
    let devices = data.devices.iter();
    let devices: Vec<_> = devices
        .map(|series| Trace::new(series, data.component))
        .collect();
    page::picture(WIDTH, HEIGHT, |area| draw(area, data, &devices))
}

/// One device along its direction.
struct Trace<'a> {
    series: &'a DeviceSeries,
    component: Component,
    direction: Direction,
    start: Vector3<f64>,
}

impl<'a> Trace<'a> {
    fn new(series: &'a DeviceSeries, component: Component) -> Self {
        let direction = main_direction(&series.force, &series.position);
        Self {
            series,
            component,
            direction,
            start: first_usable(&series.position),
        }
    }

    /// The component of a vector that is drawn.
    fn value(&self, vector: &Vector3<f64>) -> f64 {
        match self.component {
            Component::Principal => self.direction.axis.dot(vector),
            component => component.of(vector),
        }
    }

    /// Force (N) over time.
    fn force(&self, time: &[f64]) -> Vec<(f64, f64)> {
        let force = self.series.force.iter();
        let along = force.map(|f| self.value(&Vector3::from(*f)));
        time.iter().copied().zip(along).collect()
    }

    /// Displacement from the start (mm) over time.
    fn displacement(&self, time: &[f64]) -> Vec<(f64, f64)> {
        let moved = self
            .series
            .position
            .iter()
            .map(|p| Vector3::from(*p) - self.start);
        let along = moved.map(|d| 1e3 * self.value(&d));
        time.iter().copied().zip(along).collect()
    }
}

fn draw(area: &Area, data: &PlotData, devices: &[Trace]) -> Drawn {
    let top = page::title(area, &data.title, &data.subtitle)?;
    // The axes name a direction that all devices have in common. Otherwise the legend names each direction.
    let common = devices.first().map(|first| &first.direction.name);
    let common = common.filter(|name| devices.iter().all(|d| d.direction.name == **name));
    let along = match data.component {
        Component::Principal => common.map(|name| format!(" along {name}")),
        component => Some(component.label()),
    };
    let bands = bands(&data.marks, &data.time);

    let lines = devices.iter().enumerate().map(|(i, device)| {
        let mut name = device.series.name.clone();
        if along.is_none() {
            name = format!("{name}, along {}", device.direction.name);
        }
        Entry {
            name,
            key: Key::Ink(Role::Number(i).ink(0), Marker::None),
        }
    });
    let along = along.clone().unwrap_or_default();
    let patches = bands.iter().map(|band| Entry {
        name: band.label(),
        key: Key::Band(band.cause.color()),
    });
    let entries: Vec<_> = lines.chain(patches).collect();
    let top = top + page::legend(area, WIDTH, top, &entries)?;
    let panel_height = (HEIGHT - top - page::BELOW) / 2;
    let (_, below) = area.split_vertically(top * page::UNITS);
    let (upper, lower) = below.split_vertically(panel_height * page::UNITS);
    let time = Axis::linear(data.time.iter().copied(), 0.0, 12.0);

    let force: Vec<_> = devices.iter().map(|d| d.force(&data.time)).collect();
    let moved: Vec<_> = devices.iter().map(|d| d.displacement(&data.time)).collect();
    // The axes always include zero, which is no force or no displacement.
    let [force_axis, moved_axis] = [&force, &moved].map(|series| {
        let values = series.iter().flatten().map(|point| point.1).chain([0.0]);
        Axis::linear(values, 0.06, 8.0)
    });
    let left = page::left(&force_axis).max(page::left(&moved_axis));
    let axes = Axes {
        x: &time,
        y: &force_axis,
        x_label: None,
        y_label: &format!("Force{along} (N)"),
    };
    draw_panel(area, &upper, &axes, left, &force, &bands)?;
    let axes = Axes {
        x: &time,
        y: &moved_axis,
        x_label: Some("Time (s)"),
        y_label: &format!("Displacement{along} (mm)"),
    };
    draw_panel(area, &lower, &axes, left, &moved, &bands)
}

fn draw_panel(
    page: &Area,
    area: &Area,
    axes: &Axes,
    left: i32,
    series: &[Vec<(f64, f64)>],
    bands: &[Band],
) -> Drawn {
    let (time, y) = (axes.x, axes.y);
    let mut panel = page::panel_with(area, axes, left)?;
    for band in bands {
        let fill = page::band_fill(band.cause.color());
        let bars = band
            .spans
            .iter()
            .map(|span| Rectangle::new([(span.0, y.from), (span.1, y.to)], fill));
        panel.draw_series(bars)?;
    }
    page::grid(&mut panel, axes)?;
    // The strips of causes that act at one time are in rows below each other.
    let height = panel.plotting_area().dim_in_pixel().1;
    let strip = (y.to - y.from) * f64::from(page::STRIP * page::UNITS) / f64::from(height);
    for (band, row) in bands.iter().zip(rows(bands)) {
        let fill = band.cause.color().filled();
        let top = y.to - strip * row as f64;
        let strips = band
            .spans
            .iter()
            .map(|span| Rectangle::new([(span.0, top - strip), (span.1, top)], fill));
        panel.draw_series(strips)?;
    }
    if series.iter().all(Vec::is_empty) {
        page::nothing(&panel)?;
    }
    let zero = PathElement::new([(time.from, 0.0), (time.to, 0.0)], page::zero_style());
    panel.draw_series([zero])?;
    for (i, points) in series.iter().enumerate() {
        let ink = Role::Number(i).ink(0);
        for line in reduce(points.iter().copied(), |x| column(time, x)) {
            let path: Vec<_> = line.iter().map(|at| panel.backend_coord(at)).collect();
            match path[..] {
                [(x, y)] => Marker::Circle.draw(page, x, y, ink.color)?,
                _ => lines::line(page, &path, ink)?,
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

/// All marks of one cause.
struct Band<'a> {
    cause: Cause,
    /// The devices or bodies, in the order of first appearance.
    of: Vec<&'a str>,
    spans: Vec<(f64, f64)>,
}

impl Band<'_> {
    /// Whether both causes act at one time. Both lists of spans are in order, and neither has overlaps.
    fn overlaps(&self, other: &Self) -> bool {
        let (mut mine, mut others) = (self.spans.iter().peekable(), other.spans.iter().peekable());
        while let (Some(a), Some(b)) = (mine.peek(), others.peek()) {
            if a.0 < b.1 && b.0 < a.1 {
                return true;
            }
            if a.1 <= b.0 {
                mine.next();
            } else {
                others.next();
            }
        }
        false
    }

    fn label(&self) -> String {
        match self.of[..] {
            [] => self.cause.name().to_owned(),
            _ => format!("{}: {}", self.cause.name(), self.of.join(", ")),
        }
    }
}

/// For each band the row of its strips: the first row without a band that acts at the same time.
fn rows(bands: &[Band]) -> Vec<usize> {
    let mut rows: Vec<usize> = Vec::new();
    for (k, band) in bands.iter().enumerate() {
        let earlier = bands[..k].iter().zip(&rows);
        let taken: Vec<usize> = earlier
            .filter(|(other, _)| band.overlaps(other))
            .map(|(_, row)| *row)
            .collect();
        rows.push((0..k).find(|row| !taken.contains(row)).unwrap_or(k));
    }
    rows
}

/// The marks by cause, in the order of first appearance. Marks closer than a pixel are merged.
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
            .position(|band| band.cause == mark.cause)
            .unwrap_or_else(|| {
                bands.push(Band {
                    cause: mark.cause,
                    of: Vec::new(),
                    spans: Vec::new(),
                });
                bands.len() - 1
            });
        let band = &mut bands[at];
        if !mark.of.is_empty() && !band.of.contains(&mark.of.as_str()) {
            band.of.push(&mark.of);
        }
        // A span is at least two pixels wide, so that a short mark is visible.
        let short = (pixel - 0.5 * (to - from)).max(0.0);
        band.spans
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
