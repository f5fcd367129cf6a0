//! A still of a run: the deformed bodies in the hands, the curves of the last seconds, and the states.

use plotters::prelude::*;

use super::axis::Axis;
use super::ink::{self, Ink, Role};
use super::lines;
use super::page::{self, Area, Axes, Drawn, Entry, Key, Marker, UNITS};
use super::picture::Picture;
use super::reduce::usable;
use super::view::{self, HandMark, Obstacle, Shape, ToolMark};

/// Width of the page, and of its left part, the view (pixels).
const WIDTH: i32 = 900;
const VIEW: i32 = 440;
/// Height of the view, which is that of the two charts together (pixels).
const HEIGHT: i32 = 440;
/// Height of a row of states, and space around the rows (pixels).
const ROW: i32 = 17;
const AROUND_ROWS: i32 = 14;

/// The content of a still.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StillPicture {
    /// The title.
    pub title: String,
    /// The smaller text under the title.
    pub subtitle: String,
    /// The label of the scale of colours, with its unit.
    pub color_label: String,
    /// The bodies.
    pub shapes: Vec<Shape>,
    /// The obstacles.
    pub obstacles: Vec<Obstacle>,
    /// The hands. The curves are in their order.
    pub hands: Vec<HandMark>,
    /// The tools.
    pub tools: Vec<ToolMark>,
    /// Its time (s).
    pub time: f64,
    /// The upper and the lower chart.
    pub charts: [Ribbons; 2],
    /// Lines of text below the view, and below the charts.
    pub states: [Vec<String>; 2],
}

/// Curves over time, each as its least and its greatest value in pieces of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ribbons {
    /// The label of the vertical axis, with its unit.
    pub label: String,
    /// By curve: time (s), least and greatest value.
    pub curves: Vec<Vec<[f64; 3]>>,
}

/// Draws a still, 900 pixels wide. Numbers that are not finite are left out.
pub fn still(still: &StillPicture) -> Picture {
    let entries = entries(still);
    let head = page::title_height(WIDTH, &still.subtitle) + page::legend_height(WIDTH, &entries);
    let rows = still.states.iter().map(Vec::len).max().unwrap_or_default() as i32;
    let below = head + HEIGHT + AROUND_ROWS;
    let height = below + ROW * rows + AROUND_ROWS;
    page::picture(WIDTH, height, |area| {
        let top = page::title(area, &still.title, &still.subtitle)?;
        page::legend(area, WIDTH, top, &entries)?;
        let place = [20, head, VIEW - 20, HEIGHT];
        let surfaces = (&still.shapes[..], &still.obstacles[..]);
        let marks = (&still.hands[..], &still.tools[..]);
        view::draw(area, place, &still.color_label, surfaces, marks)?;
        let right = area.clone().shrink(
            (VIEW * UNITS, head * UNITS),
            ((WIDTH - VIEW) * UNITS, HEIGHT * UNITS),
        );
        charts(area, &right, still)?;
        for (lines, x) in still.states.iter().zip([28, VIEW + 24]) {
            for (k, line) in (0..).zip(lines) {
                let width = WIDTH / 2 - 40;
                let y = below + ROW * k + ROW / 2;
                page::write_fitted(area, line, x, y, width)?;
            }
        }
        Ok(())
    })
}

fn entries(still: &StillPicture) -> Vec<Entry> {
    let hands = still.hands.iter().enumerate();
    let hands = hands.map(|(index, hand)| Entry {
        name: hand.name.clone(),
        key: Key::Ink(Role::Number(index).ink(0), Marker::Circle),
    });
    let now = Entry {
        name: "this moment".to_owned(),
        key: Key::Ink(NOW, Marker::None),
    };
    hands.chain([now]).collect()
}

/// The line at the still.
const NOW: Ink = Ink {
    color: page::TEXT,
    dash: &[4.0, 3.0],
    width: ink::WIDTH,
};

fn charts(page: &Area, area: &Area, still: &StillPicture) -> Drawn {
    let curves = || still.charts.iter().flat_map(|chart| chart.curves.iter());
    let times = curves().flatten().map(|piece| piece[0]);
    let time = Axis::linear(times.chain([still.time]), 0.0, 6.0);
    let axes = still.charts.each_ref().map(|chart| {
        let values = chart.curves.iter().flatten();
        let values = values.flat_map(|piece| [piece[1], piece[2]]);
        Axis::linear(values.filter(|value| usable(*value)), 0.06, 5.0)
    });
    let left = axes.iter().map(page::left).max().unwrap_or(page::LEFT);
    let upper_height = (HEIGHT - page::BELOW) / 2;
    let (upper, lower) = area.split_vertically(upper_height * UNITS);
    let labels = [None, Some("Time (s)")];
    let charts = still.charts.iter().zip(&axes).zip(labels);
    for (area, ((chart, y), x_label)) in [upper, lower].iter().zip(charts) {
        let axes = Axes {
            x: &time,
            y,
            x_label,
            y_label: &chart.label,
        };
        let mut panel = page::panel_with(area, &axes, left)?;
        page::grid(&mut panel, &axes)?;
        let at = |time: f64, value: f64| {
            (usable(time) && usable(value)).then(|| panel.backend_coord(&(time, value)))
        };
        if chart.curves.iter().all(Vec::is_empty) {
            page::nothing(&panel)?;
        }
        let ends = [at(still.time, y.from), at(still.time, y.to)];
        let path: Vec<_> = ends.into_iter().flatten().collect();
        lines::line(page, &path, NOW)?;
        for (index, curve) in chart.curves.iter().enumerate() {
            ribbon(page, curve, &at, Role::Number(index).ink(0))?;
        }
    }
    Ok(())
}

/// Draws a curve: the space between its least and its greatest value, and both of them as lines, so that a spike of one
/// piece is visible.
fn ribbon(
    page: &Area,
    curve: &[[f64; 3]],
    at: &impl Fn(f64, f64) -> Option<(i32, i32)>,
    ink: Ink,
) -> Drawn {
    let color = ink.color;
    let side = |k: usize| curve.iter().filter_map(move |piece| at(piece[0], piece[k]));
    let (least, most): (Vec<_>, Vec<_>) = (side(1).collect(), side(2).collect());
    if let ([only], [other]) = (&least[..], &most[..]) {
        for point in [only, other] {
            page.draw(&Circle::new(*point, 2 * UNITS, color.filled()))?;
        }
        return Ok(());
    }
    if most.len() > 1 {
        let outline: Vec<_> = most.iter().chain(least.iter().rev()).copied().collect();
        page.draw(&Polygon::new(outline, color.mix(0.3)))?;
        for path in [least, most] {
            lines::line(page, &path, ink)?;
        }
    }
    Ok(())
}
