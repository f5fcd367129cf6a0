//! The page: a picture of a given size with title, legend and panels. All drawings share this style.
//!
//! The layout measures all text with the widest font that a viewer shows it in, so that no two texts collide and none is
//! cut.

use std::convert::Infallible;

use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::font::{FAMILIES, LINE_HEIGHT, text_width};
use super::ink::{self, Ink, Role};
use super::lines;
use super::picture::{Picture, Recorder};

/// Units per pixel. `plotters` draws at whole units; several units per pixel keep lines smooth.
pub(super) const UNITS: i32 = 4;
/// Least space left of a panel for its labels (pixels). Titles and legends begin there.
pub(super) const LEFT: i32 = 64;
/// Least space right of a panel (pixels).
pub(super) const RIGHT: i32 = 18;
/// Space below a panel that has a labelled x axis (pixels).
pub(super) const BELOW: i32 = 44;

/// Height of the solid strip on top of a band (pixels). Without it a short band would not be visible.
pub(super) const STRIP: i32 = 4;

/// The colour of text.
pub(super) const TEXT: RGBColor = ink::BLACK;
const MUTED: RGBColor = RGBColor(96, 96, 96);
const GRID: RGBColor = RGBColor(228, 228, 228);
const FRAME: RGBColor = RGBColor(150, 150, 150);

/// What a drawing function gives. The list of a picture takes every call.
pub(super) type Drawn<T = ()> = Result<T, DrawingAreaErrorKind<Infallible>>;
/// The whole page or a part of it.
pub(super) type Area<'a> = DrawingArea<Recorder<'a>, Shift>;
/// A panel with its two axes.
pub(super) type Panel<'a, 'b> = ChartContext<'b, Recorder<'a>, Cartesian2d<Axis, Axis>>;

/// Sizes of the fonts (pixels): the title, the titles of panels, other text, and the labels of ticks.
const TITLE_SIZE: f64 = 16.0;
const PANEL_TITLE_SIZE: f64 = 12.0;
const TEXT_SIZE: f64 = 12.0;
const TICK_SIZE: f64 = 11.0;
/// Distance of two lines of text (pixels).
const LINE: i32 = 16;

/// The colour of a series by its number.
pub(super) fn series_color(index: usize) -> RGBColor {
    Role::Number(index).ink(0).color
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
pub(super) fn picture(width: i32, height: i32, draw: impl FnOnce(&Area) -> Drawn) -> Picture {
    let mut picture = Picture {
        size: (width as u32, height as u32),
        calls: Vec::new(),
    };
    let area = Recorder(&mut picture).into_drawing_area();
    // The list takes every call. Any other error would leave the page incomplete.
    let _ = area.fill(&WHITE).and_then(|()| draw(&area));
    drop(area);
    picture
}

/// A font of `size` pixels.
pub(super) fn font(size: f64) -> FontDesc<'static> {
    (FAMILIES, size * LINE_HEIGHT * f64::from(UNITS)).into_font()
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

/// The label of an axis, which begins with a capital.
fn axis_label(text: &str) -> String {
    let mut letters = printable(text);
    if let Some(first) = letters.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    letters
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

/// Writes a line of a list, of at most `width` pixels, with the middle of its left edge at (`x`, `y`) pixels.
pub(super) fn write_fitted(area: &Area, text: &str, x: i32, y: i32, width: i32) -> Drawn {
    let text = fitted(text, TICK_SIZE, false, width);
    write(area, &text, x, y, font(TICK_SIZE), TEXT)
}

/// The text, or the beginning of it with an ellipsis, so that it is at most `width` pixels wide.
fn fitted(text: &str, size: f64, bold: bool, width: i32) -> String {
    let fits = |text: &str| text_width(text, size, bold) <= f64::from(width);
    let text = printable(text);
    if fits(&text) {
        return text;
    }
    let mut short: Vec<char> = text.chars().collect();
    loop {
        short.pop();
        let cut: String = short.iter().chain(['…'].iter()).collect();
        if short.is_empty() || fits(&cut) {
            return cut;
        }
    }
}

/// The lines of a text that is at most `width` pixels wide: as few as possible, and of about one length, so that no line
/// holds a single word.
fn wrapped(text: &str, size: f64, width: i32) -> Vec<String> {
    let full = filled(text, size, width);
    let even = (width / 2..width).find_map(|width| {
        let lines = filled(text, size, width);
        (lines.len() == full.len()).then_some(lines)
    });
    match full.len() {
        0 | 1 => full,
        _ => even.unwrap_or(full),
    }
}

/// The lines of a text, each with as many words as are at most `width` pixels wide.
fn filled(text: &str, size: f64, width: i32) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let longer = lines.last().map(|line| format!("{line} {word}"));
        match (longer, lines.last_mut()) {
            (Some(longer), Some(line)) if text_width(&longer, size, false) <= f64::from(width) => {
                *line = longer;
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Writes the title of a page and the smaller text under the title. Returns their height (pixels).
pub(super) fn title(area: &Area, title: &str, subtitle: &str) -> Drawn<i32> {
    let width = area.dim_in_pixel().0 as i32 / UNITS;
    let most = width - LEFT - RIGHT;
    let bold = font(TITLE_SIZE).style(FontStyle::Bold);
    let text = fitted(title, TITLE_SIZE, true, most);
    write(area, &text, LEFT, 20, bold, TEXT)?;
    for (k, line) in wrapped(subtitle, TEXT_SIZE, most).iter().enumerate() {
        let line = fitted(line, TEXT_SIZE, false, most);
        let y = 40 + LINE * k as i32;
        write(area, &line, LEFT, y, font(TEXT_SIZE), MUTED)?;
    }
    Ok(title_height(width, subtitle))
}

/// The height of a title with this text under it (pixels).
pub(super) fn title_height(width: i32, subtitle: &str) -> i32 {
    match wrapped(subtitle, TEXT_SIZE, width - LEFT - RIGHT).len() as i32 {
        0 => 36,
        lines => 40 + LINE * lines,
    }
}

/// Writes the title of a panel of `width` pixels at the top of its area.
pub(super) fn panel_title(area: &Area, width: i32, title: &str) -> Drawn {
    let bold = font(PANEL_TITLE_SIZE).style(FontStyle::Bold);
    let text = fitted(title, PANEL_TITLE_SIZE, true, width - LEFT - 4);
    write(area, &text, LEFT, 14, bold, TEXT)
}

/// One entry of a legend.
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) key: Key,
}

/// The symbol that a legend shows before a name.
pub(super) enum Key {
    /// A segment of a line with its look, and its mark.
    Ink(Ink, Marker),
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
    /// A ring, which shows what is below it.
    Ring,
}

impl Marker {
    /// The mark by place in a list of lines, for a chart whose lines all have marks.
    pub fn by_place(place: usize) -> Self {
        [
            Self::Circle,
            Self::Square,
            Self::Triangle,
            Self::Ring,
            Self::Cross,
        ][place % 5]
    }

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
            Self::Ring => area.draw(&Circle::new((x, y), r + UNITS, stroke(color, 1.75))),
        }
    }
}

/// Writes the smaller line under the title of a panel of `width` pixels.
pub(super) fn panel_subtitle(area: &Area, width: i32, subtitle: &str) -> Drawn {
    let text = fitted(subtitle, TICK_SIZE, false, width - LEFT - 4);
    write(area, &text, LEFT, 30, font(TICK_SIZE), MUTED)
}

const ROW: i32 = 20;
/// Width of the symbol with the gap after it (pixels).
const KEY: i32 = 38;

/// The entries of a legend on a page of `width` pixels: the left end and the middle of each, and its name. Then the height
/// (pixels).
fn legend_places(width: i32, entries: &[Entry]) -> (Vec<(i32, i32, String)>, i32) {
    let (mut x, mut y) = (LEFT, ROW / 2);
    let mut places = Vec::new();
    for entry in entries {
        let name = fitted(&entry.name, TEXT_SIZE, false, width - LEFT - KEY - RIGHT);
        let text = text_width(&name, TEXT_SIZE, false).ceil() as i32;
        if x > LEFT && x + KEY + text > width - RIGHT {
            (x, y) = (LEFT, y + ROW);
        }
        places.push((x, y, name));
        x += KEY + text + 18;
    }
    (places, y + ROW / 2)
}

/// The height of a legend (pixels).
pub(super) fn legend_height(width: i32, entries: &[Entry]) -> i32 {
    legend_places(width, entries).1
}

/// Writes the legend in rows of the page's `width`, downwards from `top`. Returns the height of the legend
/// (pixels).
pub(super) fn legend(area: &Area, width: i32, top: i32, entries: &[Entry]) -> Drawn<i32> {
    let (places, height) = legend_places(width, entries);
    for (entry, (x, y, name)) in entries.iter().zip(places) {
        let y = top + y;
        let (left, right, middle) = (x * UNITS, (x + KEY - 6) * UNITS, y * UNITS);
        let center = i32::midpoint(left, right);
        match &entry.key {
            Key::Ink(ink, marker) => {
                lines::line(area, &[(left, middle), (right, middle)], *ink)?;
                marker.draw(area, center, middle, ink.color)?;
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
        write(area, &name, x + KEY, y, font(TEXT_SIZE), TEXT)?;
    }
    Ok(height)
}

/// The axes of a panel and their labels.
pub(super) struct Axes<'a> {
    pub(super) x: &'a Axis,
    pub(super) y: &'a Axis,
    /// `None` leaves the x axis unlabelled, for a panel above another one.
    pub(super) x_label: Option<&'a str>,
    pub(super) y_label: &'a str,
}

/// The space left of a panel for its label and the labels of this axis (pixels).
pub(super) fn left(y: &Axis) -> i32 {
    let widths = y.labels().into_iter();
    let widest = widths.fold(0.0, |most: f64, label| {
        most.max(text_width(&label, TICK_SIZE, false))
    });
    // The label of the axis, turned, the gaps and the tick take 36 pixels.
    LEFT.max(widest.ceil() as i32 + 36)
}

/// The space right of a panel, where half of the last label of this axis may end (pixels).
fn right(x: &Axis) -> i32 {
    let last = x.labels().pop().unwrap_or_default();
    RIGHT.max((0.5 * text_width(&last, TICK_SIZE, false)).ceil() as i32 + 4)
}

/// Lays out a panel on `area`. The background of its grid can be drawn before [`grid`] is called.
pub(super) fn panel<'a, 'b>(area: &'b Area<'a>, axes: &Axes) -> Drawn<Panel<'a, 'b>> {
    panel_with(area, axes, left(axes.y))
}

/// Lays out a panel with this space left of it (pixels), so that panels below each other begin at one x.
pub(super) fn panel_with<'a, 'b>(
    area: &'b Area<'a>,
    axes: &Axes,
    left: i32,
) -> Drawn<Panel<'a, 'b>> {
    let below = if axes.x_label.is_some() { BELOW } else { 0 };
    ChartBuilder::on(area)
        .set_label_area_size(LabelAreaPosition::Left, (left - 10) * UNITS)
        .margin_left(10 * UNITS)
        .set_label_area_size(LabelAreaPosition::Bottom, below * UNITS)
        .margin_right(right(axes.x) * UNITS)
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
        .label_style(TextStyle::from(font(TICK_SIZE)).color(&MUTED))
        .axis_desc_style(TextStyle::from(font(TEXT_SIZE)).color(&TEXT))
        .y_desc(axis_label(axes.y_label))
        .set_all_tick_mark_size(4 * UNITS);
    if let Some(label) = axes.x_label {
        mesh.x_desc(axis_label(label));
    }
    mesh.draw()
}

/// Marks where an axis is broken between zero and its logarithmic part: two short strokes across the axis.
pub(super) fn breaks(page: &Area, panel: &Panel, axes: &Axes) -> Drawn {
    let corner = (axes.x.from, axes.y.from);
    let places = [
        axes.x.broken().map(|x| (x, corner.1)),
        axes.y.broken().map(|y| (corner.0, y)),
    ];
    for (place, upright) in places.into_iter().zip([true, false]) {
        let Some(place) = place else { continue };
        let (x, y) = panel.backend_coord(&place);
        // From one stroke to the other, and from the middle of a stroke to its end.
        let (gap, along, across) = (2 * UNITS, UNITS, 4 * UNITS);
        let turned = |dx: i32, dy: i32| {
            if upright {
                (x + dx, y + dy)
            } else {
                (x + dy, y + dx)
            }
        };
        let hole = [turned(-gap, -UNITS), turned(gap, UNITS)];
        page.draw(&Rectangle::new(hole, WHITE.filled()))?;
        for side in [-gap, gap] {
            let ends = [turned(side - along, across), turned(side + along, -across)];
            page.draw(&PathElement::new(ends, stroke(FRAME, 1.0)))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_text_is_shortened_or_wrapped_to_its_width() {
        let long = "a scene of a very long name ".repeat(20);
        let short = fitted(&long, 16.0, true, 300);
        assert!(short.ends_with('…') && text_width(&short, 16.0, true) <= 300.0);
        assert_eq!(fitted("short", 16.0, true, 300), "short");
        let lines = wrapped(&long, 12.0, 300);
        assert!(lines.len() > 5);
        assert!(
            lines
                .iter()
                .all(|line| text_width(line, 12.0, false) <= 300.0)
        );
        assert_eq!(lines.join(" "), long.trim());
        let lines = wrapped(
            "one line of words, and then just one more word that wraps",
            12.0,
            300,
        );
        let widths = lines.iter().map(|line| text_width(line, 12.0, false));
        assert!(
            lines.len() == 2 && widths.fold(f64::MAX, f64::min) > 100.0,
            "{lines:?}"
        );
    }
}
