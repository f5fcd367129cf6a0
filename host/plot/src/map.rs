//! Maps over two quantities: coloured cells with lines and points on top, one panel per case.

use plotters::prelude::*;

use super::axis::Axis;
use super::font::text_width;
use super::ink::dashes;
use super::page::{self, Area, Axes, Drawn, UNITS};
use super::picture::Picture;

/// Width and height of a panel with its labels (pixels).
const PANEL: [i32; 2] = [300, 286];
/// Panels in a row.
const COLUMNS: usize = 3;
/// Height of the title and the subtitle of a panel (pixels).
const HEAD: i32 = 40;
/// Height of the legend, and of the gap below it (pixels).
const LEGEND: i32 = 36;
/// Space below the panels for the scale of colours (pixels).
const BELOW: i32 = 58;

/// The scale of colours needs this width (pixels).
const MIN_WIDTH: i32 = 640;
/// Name of the marks of a boundary in the legend.
const MEASURED: &str = "measured";
/// Width of the line of a boundary with the gap after it, and of its mark, in the legend (pixels).
const LEGEND_KEYS: [i32; 2] = [42, 12];
/// Gaps after the name of a boundary and after that of its marks (pixels).
const LEGEND_GAPS: [i32; 2] = [16, 30];

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
    /// The smaller line under the title.
    pub subtitle: String,
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

/// Draws a page of maps.
pub fn map(map: &Map) -> Picture {
    let columns = map.panels.len().clamp(1, COLUMNS);
    let rows = map.panels.len().div_ceil(columns).max(1);
    let width = (PANEL[0] * columns as i32)
        .max(MIN_WIDTH)
        .max(legend_width(map));
    let above = page::title_height(width, &map.subtitle) + LEGEND;
    let height = above + PANEL[1] * rows as i32 + BELOW;
    let axes: Vec<[Axis; 2]> = map.panels.iter().map(axes).collect();
    let left = axes.iter().map(|[_, y]| page::left(y)).max();
    let left = left.unwrap_or(page::LEFT);
    page::picture(width, height, |area| {
        let top = page::title(area, &map.title, &map.subtitle)?;
        legend(area, map, top + 12)?;
        for (k, (panel, axes)) in map.panels.iter().zip(&axes).enumerate() {
            let (row, column) = ((k / columns) as i32, (k % columns) as i32);
            let place = area.clone().shrink(
                (column * PANEL[0] * UNITS, (above + row * PANEL[1]) * UNITS),
                (PANEL[0] * UNITS, PANEL[1] * UNITS),
            );
            draw(area, &place, map, panel, axes, left)?;
        }
        scale(area, map, height - BELOW + 10)
    })
}

fn axes(data: &MapPanel) -> [Axis; 2] {
    let edges = |of: fn(&MapCell) -> [f64; 2]| data.cells.iter().flat_map(of).collect::<Vec<_>>();
    [
        Axis::linear(edges(|cell| cell.x).into_iter(), 0.0, 5.0),
        Axis::logarithmic_to_the_edge(edges(|cell| cell.y).into_iter(), 7.0),
    ]
}

fn draw(
    page: &Area,
    area: &Area,
    map: &Map,
    data: &MapPanel,
    [x, y]: &[Axis; 2],
    left: i32,
) -> Drawn {
    page::panel_title(area, PANEL[0], &data.title)?;
    page::panel_subtitle(area, PANEL[0], &data.subtitle)?;
    let (_, below) = area.split_vertically(HEAD * UNITS);
    let axes = Axes {
        x,
        y,
        x_label: Some(&map.x_label),
        y_label: &map.y_label,
    };
    let mut panel = page::panel_with(&below, &axes, left)?;
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
    let pattern = [7.0 * f64::from(UNITS), 5.0 * f64::from(UNITS)];
    let pattern = if dashed { &pattern[..] } else { &[] };
    for piece in dashes(path, pattern) {
        page.draw(&PathElement::new(piece.clone(), edge))?;
        page.draw(&PathElement::new(piece, style))?;
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

fn text_pixels(text: &str) -> i32 {
    text_width(text, 12.0, false).ceil() as i32
}

/// The width of a page with the legend (pixels).
fn legend_width(map: &Map) -> i32 {
    let keys: i32 = LEGEND_KEYS.iter().chain(&LEGEND_GAPS).sum();
    let entries = map.lines.iter();
    let entries = entries.map(|name| keys + text_pixels(name) + text_pixels(MEASURED));
    page::LEFT + entries.sum::<i32>()
}

fn legend(page: &Area, map: &Map, y: i32) -> Drawn {
    let mut x = page::LEFT;
    for (name, ink, dashed) in [(&map.lines[0], LINE, false), (&map.lines[1], SECOND, true)] {
        let (left, right, middle) = (x * UNITS, (x + 34) * UNITS, y * UNITS);
        stroke(page, &[(left, middle), (right, middle)], ink, dashed)?;
        let text = |name: &str, x| page::write(page, name, x, y, page::font(12.0), page::TEXT);
        text(name, x + LEGEND_KEYS[0])?;
        x += LEGEND_KEYS[0] + text_pixels(name) + LEGEND_GAPS[0];
        mark(page, (x * UNITS, middle), ink)?;
        text(MEASURED, x + LEGEND_KEYS[1])?;
        x += LEGEND_KEYS[1] + text_pixels(MEASURED) + LEGEND_GAPS[1];
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
    x += 28 + text_width(&map.below_label, 11.0, false).ceil() as i32 + 24;
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
        let label = super::axis::power_of_ten(decade);
        let half = (0.5 * text_width(&label, 11.0, false)) as i32;
        text(&label, at - half, top + HEIGHT + 11)?;
    }
    text(&map.scale_label, x + WIDTH + 16, top + HEIGHT / 2)
}
