//! The page: an SVG of a given size with title, legend and panels. All drawings share this style.
//!
//! The colours are those of Okabe and Ito, which colour-blind readers can distinguish.

use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::font::FAMILIES;

/// Units per pixel. The SVG backend draws at whole units; several units per pixel keep lines smooth.
pub(super) const UNITS: i32 = 4;
/// Space left of a panel for its labels (pixels).
pub(super) const LEFT: i32 = 64;
/// Space right of a panel (pixels).
pub(super) const RIGHT: i32 = 18;
/// Space below a panel that has a labelled x axis (pixels).
pub(super) const BELOW: i32 = 44;

/// Height of the solid strip on top of a band (pixels). Without it a short band would not be visible.
pub(super) const STRIP: i32 = 4;

/// The colour of text.
pub(super) const TEXT: RGBColor = RGBColor(34, 34, 34);
const MUTED: RGBColor = RGBColor(96, 96, 96);
const GRID: RGBColor = RGBColor(228, 228, 228);
const FRAME: RGBColor = RGBColor(150, 150, 150);

/// The result of a drawing function. Drawing to a string cannot fail.
pub(super) type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;
/// The whole page or a part of it.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// A panel with its two axes.
pub(super) type Panel<'a, 'b> = ChartContext<'b, SVGBackend<'a>, Cartesian2d<Axis, Axis>>;

/// The colour of a series by its number.
pub(super) fn series_color(index: usize) -> RGBColor {
    const COLORS: [RGBColor; 6] = [
        RGBColor(0, 114, 178),
        RGBColor(213, 94, 0),
        RGBColor(0, 158, 115),
        RGBColor(204, 121, 167),
        RGBColor(86, 180, 233),
        RGBColor(230, 159, 0),
    ];
    COLORS[index % COLORS.len()]
}

/// The colour of a band by its number.
pub(super) fn band_color(index: usize) -> RGBColor {
    const COLORS: [RGBColor; 4] = [
        RGBColor(230, 159, 0),
        RGBColor(110, 110, 110),
        RGBColor(86, 180, 233),
        RGBColor(204, 121, 167),
    ];
    COLORS[index % COLORS.len()]
}

/// The fill of a band, behind the lines.
pub(super) fn band_fill(color: RGBColor) -> ShapeStyle {
    color.mix(0.22).filled()
}

/// The line through zero.
pub(super) fn zero_style() -> ShapeStyle {
    stroke(FRAME, 1.0)
}

/// Draws a page of `width` by `height` pixels on white.
pub(super) fn svg(width: i32, height: i32, draw: impl FnOnce(&Area) -> Drawn) -> String {
    let mut text = String::new();
    let size = ((width * UNITS) as u32, (height * UNITS) as u32);
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        // Writing to a string cannot fail. An error would leave the page incomplete.
        let _ = area
            .fill(&WHITE)
            .and_then(|()| draw(&area))
            .and_then(|()| area.present());
    }
    let inner = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
    // Without round joins, a noisy line would have long spikes.
    let outer = format!("width=\"{width}\" height=\"{height}\" stroke-linejoin=\"round\"");
    text.replacen(&inner, &outer, 1)
}

/// A font of `size` pixels.
pub(super) fn font(size: f64) -> FontDesc<'static> {
    // The backend treats sizes as line heights and divides them by 1.24.
    (FAMILIES, size * 1.24 * f64::from(UNITS)).into_font()
}

/// A line of `width` pixels.
pub(super) fn stroke(color: RGBColor, width: f64) -> ShapeStyle {
    color.stroke_width((width * f64::from(UNITS)).round() as u32)
}

/// The text with a blank in place of each control character, which XML cannot hold.
fn printable(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

/// Writes `text` with the middle of its left edge at (`x`, `y`) pixels.
pub(super) fn write(
    area: &Area,
    text: &str,
    x: i32,
    y: i32,
    font: FontDesc,
    color: RGBColor,
) -> Drawn {
    let style = TextStyle::from(font)
        .color(&color)
        .pos(Pos::new(HPos::Left, VPos::Center));
    area.draw(&Text::new(printable(text), (x * UNITS, y * UNITS), style))
}

/// Writes the title and the smaller line under the title.
pub(super) fn title(area: &Area, title: &str, subtitle: &str) -> Drawn {
    write(
        area,
        title,
        LEFT,
        20,
        font(16.0).style(FontStyle::Bold),
        TEXT,
    )?;
    write(area, subtitle, LEFT, 40, font(12.0), MUTED)
}

/// One entry of a legend.
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) key: Key,
}

/// The symbol that a legend shows before a name.
pub(super) enum Key {
    /// A segment of the series' line, with its mark.
    Line(RGBColor, Marker),
    /// A patch of a band's colour.
    Band(RGBColor),
}

/// The mark at the points of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Marker {
    /// No mark: the line alone.
    #[default]
    None,
    /// A filled circle.
    Circle,
    /// A filled square.
    Square,
    /// A filled triangle.
    Triangle,
    /// A diagonal cross.
    Cross,
}

impl Marker {
    /// Draws the mark at (`x`, `y`) units.
    pub(super) fn draw(self, area: &Area, x: i32, y: i32, color: RGBColor) -> Drawn {
        let r = 4 * UNITS;
        match self {
            Self::None => Ok(()),
            Self::Circle => area.draw(&Circle::new((x, y), r, color.filled())),
            Self::Square => {
                let r = r - UNITS / 2;
                area.draw(&Rectangle::new(
                    [(x - r, y - r), (x + r, y + r)],
                    color.filled(),
                ))
            }
            Self::Triangle => {
                let corners = vec![(x, y - r - UNITS), (x - r - 2, y + r), (x + r + 2, y + r)];
                area.draw(&Polygon::new(corners, color))
            }
            Self::Cross => {
                let style = stroke(color, 1.75);
                area.draw(&PathElement::new([(x - r, y - r), (x + r, y + r)], style))?;
                area.draw(&PathElement::new([(x - r, y + r), (x + r, y - r)], style))
            }
        }
    }
}

/// Writes the legend in rows of the page's `width`, downwards from `top`. Returns the height of the legend
/// (pixels).
pub(super) fn legend(
    area: &Area,
    width: i32,
    top: i32,
    entries: &[Entry],
) -> Result<i32, DrawingAreaErrorKind<std::io::Error>> {
    const ROW: i32 = 20;
    const KEY: i32 = 26;
    let (mut x, mut y) = (LEFT, top + ROW / 2);
    for entry in entries {
        // Without font files, widths are estimates: 6.3 pixels is about the mean width of a character.
        let text = (entry.name.chars().count() as f64 * 6.3).ceil() as i32;
        if x > LEFT && x + KEY + text > width - RIGHT {
            (x, y) = (LEFT, y + ROW);
        }
        let (left, right, middle) = (x * UNITS, (x + KEY - 6) * UNITS, y * UNITS);
        match &entry.key {
            Key::Line(color, marker) => {
                let style = stroke(*color, 2.5);
                area.draw(&PathElement::new([(left, middle), (right, middle)], style))?;
                marker.draw(area, i32::midpoint(left, right), middle, *color)?;
            }
            Key::Band(color) => {
                let half = 6 * UNITS;
                let corners = [(left, middle - half), (right, middle + half)];
                area.draw(&Rectangle::new(corners, band_fill(*color)))?;
                let strip = [
                    (left, middle - half),
                    (right, middle - half + STRIP * UNITS),
                ];
                area.draw(&Rectangle::new(strip, color.filled()))?;
            }
        }
        write(area, &entry.name, x + KEY, y, font(12.0), TEXT)?;
        x += KEY + text + 18;
    }
    Ok(y + ROW / 2 - top)
}

/// The axes of a panel and their labels.
pub(super) struct Axes<'a> {
    pub(super) x: &'a Axis,
    pub(super) y: &'a Axis,
    /// `None` leaves the x axis unlabelled, for a panel above another one.
    pub(super) x_label: Option<&'a str>,
    pub(super) y_label: &'a str,
}

/// Lays out a panel on `area`. The background of its grid can be drawn before [`grid`] is called.
pub(super) fn panel<'a, 'b>(
    area: &'b Area<'a>,
    axes: &Axes,
) -> Result<Panel<'a, 'b>, DrawingAreaErrorKind<std::io::Error>> {
    let below = if axes.x_label.is_some() { BELOW } else { 0 };
    ChartBuilder::on(area)
        .set_label_area_size(LabelAreaPosition::Left, (LEFT - 10) * UNITS)
        .margin_left(10 * UNITS)
        .set_label_area_size(LabelAreaPosition::Bottom, below * UNITS)
        .margin_right(RIGHT * UNITS)
        .margin_top(6 * UNITS)
        .margin_bottom(6 * UNITS)
        .build_cartesian_2d(axes.x.clone(), axes.y.clone())
}

/// Writes "no data" into a panel.
pub(super) fn nothing(panel: &Panel) -> Drawn {
    let area = panel.plotting_area().strip_coord_spec();
    let (width, height) = area.dim_in_pixel();
    let style = TextStyle::from(font(14.0))
        .color(&MUTED)
        .pos(Pos::new(HPos::Center, VPos::Center));
    area.draw(&Text::new(
        "no data",
        (width as i32 / 2, height as i32 / 3),
        style,
    ))
}

/// Draws the grid, the frame and the labels of a panel.
pub(super) fn grid(panel: &mut Panel, axes: &Axes) -> Drawn {
    let mut mesh = panel.configure_mesh();
    mesh.bold_line_style(stroke(GRID, 1.0))
        .axis_style(stroke(FRAME, 1.0))
        .label_style(TextStyle::from(font(11.0)).color(&MUTED))
        .axis_desc_style(TextStyle::from(font(12.0)).color(&TEXT))
        .y_desc(printable(axes.y_label))
        .set_all_tick_mark_size(4 * UNITS);
    if let Some(label) = axes.x_label {
        mesh.x_desc(printable(label));
    }
    mesh.draw()
}
