//! Maps over two quantities: coloured cells with lines and points on top, one panel per case.

use plotters::prelude::*;

use super::axis::Axis;
use super::page::{self, Area, Axes, Drawn, UNITS};

/// Width and height of a panel with its labels (pixels).
const PANEL: [i32; 2] = [330, 286];
/// Panels in a row.
const COLUMNS: usize = 3;
/// Space above the panels for title, subtitle and legend (pixels).
const ABOVE: i32 = 92;
/// Space below the panels for the scale of colours (pixels).
const BELOW: i32 = 58;

/// The colour of cells below the scale.
const NOTHING: RGBColor = RGBColor(226, 236, 243);
const LINE: RGBColor = RGBColor(20, 20, 20);
const SECOND: RGBColor = RGBColor(0, 90, 170);

/// One cell of a map: its edges and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapCell {
    /// Left and right edge.
    pub x: [f64; 2],
    /// Lower and upper edge, both above zero.
    pub y: [f64; 2],
    /// The value, which determines the colour.
    pub value: f64,
}

/// A boundary in a map: a line in theory, and the points measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapLine {
    /// Points of the line.
    pub line: Vec<(f64, f64)>,
    /// Measured points of the boundary.
    pub points: Vec<(f64, f64)>,
}

/// The map of one case.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapPanel {
    /// The title above the panel.
    pub title: String,
    /// The cells. Their edges determine the range of the panel.
    pub cells: Vec<MapCell>,
    /// The first boundary, drawn as a solid line.
    pub first: MapLine,
    /// The second boundary, drawn as a dashed line.
    pub second: MapLine,
}

/// A page of maps. Labels include the unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// The title of the page.
    pub title: String,
    /// The smaller line under the title.
    pub subtitle: String,
    /// The label of the horizontal axis.
    pub x_label: String,
    /// The label of the vertical axis, which is logarithmic.
    pub y_label: String,
    /// The label of the scale of colours.
    pub scale_label: String,
    /// The label of the colour of cells below the scale.
    pub below_label: String,
    /// Decimal exponents of the lower and the upper end of the scale of colours.
    pub decades: [i32; 2],
    /// Names of the first and the second boundary.
    pub lines: [String; 2],
    /// The panels.
    pub panels: Vec<MapPanel>,
}

/// Draws a page of maps, as SVG.
pub fn map_svg(map: &Map) -> String {
    let columns = map.panels.len().clamp(1, COLUMNS);
    let rows = map.panels.len().div_ceil(columns).max(1);
    let width = PANEL[0] * columns as i32 + 10;
    let height = ABOVE + PANEL[1] * rows as i32 + BELOW;
    page::svg(width.max(2 * PANEL[0]), height, |area| {
        page::title(area, &map.title, &map.subtitle)?;
        legend(area, map)?;
        for (k, panel) in map.panels.iter().enumerate() {
            let (row, column) = ((k / columns) as i32, (k % columns) as i32);
            let place = area.clone().shrink(
                (column * PANEL[0] * UNITS, (ABOVE + row * PANEL[1]) * UNITS),
                (PANEL[0] * UNITS, PANEL[1] * UNITS),
            );
            draw(area, &place, map, panel)?;
        }
        scale(area, map, height - BELOW + 10)
    })
}

fn draw(page: &Area, area: &Area, map: &Map, data: &MapPanel) -> Drawn {
    page::write(
        area,
        &data.title,
        page::LEFT,
        12,
        page::font(12.5).style(FontStyle::Bold),
        page::TEXT,
    )?;
    let (_, below) = area.split_vertically(20 * UNITS);
    let edges = |of: fn(&MapCell) -> [f64; 2]| data.cells.iter().flat_map(of).collect::<Vec<_>>();
    let x = Axis::linear(edges(|cell| cell.x).into_iter(), 0.0, 5.0);
    let y = Axis::logarithmic_to_the_edge(edges(|cell| cell.y).into_iter());
    let axes = Axes {
        x: &x,
        y: &y,
        x_label: Some(&map.x_label),
        y_label: &map.y_label,
    };
    let mut panel = page::panel(&below, &axes)?;
    page::grid(&mut panel, &axes)?;
    if data.cells.is_empty() {
        return page::nothing(&panel);
    }
    let place = |(across, up): (f64, f64)| x.place(across).zip(y.place(up));
    for cell in &data.cells {
        let corners = place((cell.x[0], cell.y[0])).zip(place((cell.x[1], cell.y[1])));
        if let Some((from, to)) = corners {
            let (a, b) = (panel.backend_coord(&from), panel.backend_coord(&to));
            // Each cell extends slightly up and to the right, so that no seams show. Its neighbours cover the
            // excess.
            let (right, top) = panel.backend_coord(&(x.to, y.to));
            let b = ((b.0 + UNITS).min(right), (b.1 - UNITS).max(top));
            page.draw(&Rectangle::new([a, b], color(map, cell.value).filled()))?;
        }
    }
    let inside = |&(across, up): &(f64, f64)| {
        let at = place((across, up))?;
        ((x.from..=x.to).contains(&at.0) && (y.from..=y.to).contains(&at.1)).then_some(at)
    };
    for (boundary, ink, dashed) in [(&data.first, LINE, false), (&data.second, SECOND, true)] {
        let MapLine { line, points } = boundary;
        let path: Vec<_> = line.iter().filter_map(inside).collect();
        let path: Vec<_> = path.iter().map(|at| panel.backend_coord(at)).collect();
        stroke(page, &path, ink, dashed)?;
        for at in points.iter().filter_map(inside) {
            mark(page, panel.backend_coord(&at), ink)?;
        }
    }
    Ok(())
}

/// A line over coloured cells, solid or dashed, with a white edge.
fn stroke(page: &Area, path: &[(i32, i32)], ink: RGBColor, dashed: bool) -> Drawn {
    if path.len() < 2 {
        return Ok(());
    }
    let edge = page::stroke(WHITE, 4.5);
    let style = page::stroke(ink, 2.25);
    if !dashed {
        page.draw(&PathElement::new(path.to_vec(), edge))?;
        return page.draw(&PathElement::new(path.to_vec(), style));
    }
    let (dash, gap) = (7.0 * f64::from(UNITS), 5.0 * f64::from(UNITS));
    for pair in path.windows(2) {
        let [from, to] = [pair[0], pair[1]].map(|(x, y)| (f64::from(x), f64::from(y)));
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let length = libm::hypot(dx, dy);
        let mut at = 0.0;
        while at < length {
            let end = f64::min(at + dash, length);
            let ends = [at, end].map(|s| {
                let fraction = s / length;
                (
                    (from.0 + fraction * dx) as i32,
                    (from.1 + fraction * dy) as i32,
                )
            });
            page.draw(&PathElement::new(ends.to_vec(), edge))?;
            page.draw(&PathElement::new(ends.to_vec(), style))?;
            at = end + gap;
        }
    }
    Ok(())
}

/// A measured point.
fn mark(page: &Area, at: (i32, i32), ink: RGBColor) -> Drawn {
    page.draw(&Circle::new(at, 4 * UNITS + UNITS / 2, ink.filled()))?;
    page.draw(&Circle::new(at, 3 * UNITS, WHITE.filled()))
}

/// Pale yellow over orange to dark red (ColorBrewer's YlOrRd), by the decimal logarithm of a value.
fn color(map: &Map, value: f64) -> RGBColor {
    let [low, high] = map.decades.map(f64::from);
    let log = libm::log10(value.max(f64::MIN_POSITIVE));
    if log < low {
        return NOTHING;
    }
    shade(((log - low) / (high - low)).min(1.0))
}

/// The colour at a fraction of the scale.
fn shade(fraction: f64) -> RGBColor {
    const STOPS: [[f64; 3]; 6] = [
        [255.0, 247.0, 196.0],
        [254.0, 217.0, 118.0],
        [253.0, 165.0, 69.0],
        [246.0, 94.0, 46.0],
        [202.0, 20.0, 32.0],
        [110.0, 0.0, 34.0],
    ];
    let at = fraction.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let k = (at as usize).min(STOPS.len() - 2);
    let part = at - k as f64;
    let mix = |c: usize| (STOPS[k][c] + part * (STOPS[k + 1][c] - STOPS[k][c])).round() as u8;
    RGBColor(mix(0), mix(1), mix(2))
}

fn legend(page: &Area, map: &Map) -> Drawn {
    let (mut x, y) = (page::LEFT, 68);
    for (name, ink, dashed) in [(&map.lines[0], LINE, false), (&map.lines[1], SECOND, true)] {
        let (left, right, middle) = (x * UNITS, (x + 34) * UNITS, y * UNITS);
        stroke(page, &[(left, middle), (right, middle)], ink, dashed)?;
        let text = |name: &str, x| page::write(page, name, x, y, page::font(12.0), page::TEXT);
        text(name, x + 42)?;
        // Without font files, text widths are estimates, as in other legends.
        x += 42 + (name.chars().count() as f64 * 6.3) as i32 + 16;
        mark(page, (x * UNITS, middle), ink)?;
        text("measured", x + 12)?;
        x += 12 + 50 + 34;
    }
    Ok(())
}

/// The scale of colours, with one tick per decade.
fn scale(page: &Area, map: &Map, top: i32) -> Drawn {
    const WIDTH: i32 = 300;
    const HEIGHT: i32 = 12;
    const STEPS: i32 = 100;
    let text = |text: &str, x, y| page::write(page, text, x, y, page::font(11.0), page::TEXT);
    let patch = |x: i32, width: i32, color: RGBColor| {
        let corners = [
            (x * UNITS, top * UNITS),
            ((x + width) * UNITS, (top + HEIGHT) * UNITS),
        ];
        page.draw(&Rectangle::new(corners, color.filled()))
    };
    let mut x = page::LEFT;
    patch(x, 22, NOTHING)?;
    text(&map.below_label, x + 28, top + HEIGHT / 2)?;
    x += 28 + (map.below_label.chars().count() as f64 * 5.8) as i32 + 24;
    for k in 0..STEPS {
        let from = x + WIDTH * k / STEPS;
        patch(
            from,
            WIDTH / STEPS + 1,
            shade(f64::from(k) / f64::from(STEPS)),
        )?;
    }
    let [low, high] = map.decades;
    for decade in low..=high {
        let at = x + WIDTH * (decade - low) / (high - low).max(1);
        text(
            &super::axis::power_of_ten(decade),
            at - 8,
            top + HEIGHT + 11,
        )?;
    }
    text(&map.scale_label, x + WIDTH + 16, top + HEIGHT / 2)
}
