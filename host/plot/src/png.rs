//! The pixels of a picture.

use std::io;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;
use plotters_backend::{BackendColor, BackendCoord, BackendStyle};
use tiny_skia::{
    Color, FillRule, LineJoin, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, Transform,
};

use super::font::{Font, LINE_HEIGHT};
use super::page::UNITS;
use super::picture::{Call, Picture};

/// Pixels of the PNG for each pixel of the page: 300 to the inch if a page of 720 pixels is printed 12 cm wide.
const SCALE: u32 = 2;

/// The picture as PNG, on white.
///
/// # Errors
/// The page has no pixels, or too many.
pub(super) fn png(picture: &Picture) -> io::Result<Vec<u8>> {
    let (width, height) = picture.size;
    let pixels = Pixmap::new(width * SCALE, height * SCALE);
    let mut pixels = pixels.ok_or_else(|| {
        io::Error::other(format!(
            "a PNG cannot show a page of {width} by {height} pixels"
        ))
    })?;
    pixels.fill(Color::WHITE);
    let scale = SCALE as f32 / UNITS as f32;
    let mut canvas = Canvas {
        pixels,
        place: Transform::from_scale(scale, scale),
        fonts: [Font::new(false), Font::new(true)],
    };
    picture.calls.iter().for_each(|call| canvas.draw(call));
    canvas.pixels.encode_png().map_err(io::Error::other)
}

/// The page while it is drawn.
struct Canvas {
    pixels: Pixmap,
    /// From units of the page to pixels.
    place: Transform,
    fonts: [Font; 2],
}

impl Canvas {
    fn draw(&mut self, call: &Call) {
        match call {
            Call::Line(ends, style) => self.shape(through(ends, false), style),
            Call::Path(points, style) => self.shape(through(points, style.filled), style),
            Call::Rectangle([from, to], style) => {
                let [left, top, right, bottom] = [from.0, from.1, to.0, to.1].map(|at| at as f32);
                let area = Rect::from_ltrb(left, top, right, bottom);
                self.shape(area.map(PathBuilder::from_rect), style);
            }
            Call::Circle((x, y), radius, style) => {
                let path = PathBuilder::from_circle(*x as f32, *y as f32, *radius as f32);
                self.shape(path, style);
            }
            Call::Text(text, at, style) => self.write(text, *at, style),
        }
    }

    /// Draws a shape. A path without an extent is not drawn.
    fn shape(&mut self, path: Option<Path>, style: &ShapeStyle) {
        let Some(path) = path else { return };
        let paint = paint(BackendStyle::color(style));
        if style.filled {
            self.pixels
                .fill_path(&path, &paint, FillRule::Winding, self.place, None);
        } else {
            let stroke = Stroke {
                width: style.stroke_width as f32,
                line_join: LineJoin::Round,
                ..Stroke::default()
            };
            self.pixels
                .stroke_path(&path, &paint, &stroke, self.place, None);
        }
    }

    fn write(&mut self, text: &str, (x, y): BackendCoord, style: &TextStyle) {
        let paint = paint(style.color);
        let bold = matches!(style.font.get_style(), FontStyle::Bold);
        let font = &self.fonts[usize::from(bold)];
        let size = (style.font.get_size() / LINE_HEIGHT) as f32;
        let width = size * font.width(text) as f32;
        let left = match style.pos.h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * width,
            HPos::Right => -width,
        };
        let down = size * font.baseline(style.pos.v_pos) as f32;
        let turn = match style.font.get_transform() {
            FontTransform::Rotate90 => 90.0,
            FontTransform::Rotate180 => 180.0,
            FontTransform::Rotate270 => 270.0,
            FontTransform::None => 0.0,
        };
        // The text turns about its anchor.
        let base = self
            .place
            .pre_translate(x as f32, y as f32)
            .pre_rotate(turn);
        let pixels = &mut self.pixels;
        font.outlines(text, |at, units, outline| {
            let mut glyph = Glyph(PathBuilder::new());
            outline(&mut glyph);
            let Some(path) = glyph.0.finish() else { return };
            let scale = size / units as f32;
            let place = base
                .pre_translate(left + size * at as f32, down)
                .pre_scale(scale, -scale);
            pixels.fill_path(&path, &paint, FillRule::Winding, place, None);
        });
    }
}

fn paint(color: BackendColor) -> Paint<'static> {
    let (red, green, blue) = color.rgb;
    let opacity = color.alpha.clamp(0.0, 1.0) as f32;
    let mut paint = Paint::default();
    paint.set_color_rgba8(red, green, blue, (255.0 * opacity).round() as u8);
    paint
}

fn through(points: &[BackendCoord], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for (k, (x, y)) in points.iter().enumerate() {
        match k {
            0 => path.move_to(*x as f32, *y as f32),
            _ => path.line_to(*x as f32, *y as f32),
        }
    }
    if closed {
        path.close();
    }
    path.finish()
}

/// The outline of a letter.
struct Glyph(PathBuilder);

impl ttf_parser::OutlineBuilder for Glyph {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}

#[cfg(test)]
mod tests {
    use plotters::style::Color as _;
    use plotters::style::text_anchor::{Pos, VPos};

    use super::*;
    use crate::page::{self, Area, Drawn};

    /// A page of 20 by 10 pixels, four units to a pixel.
    fn pixels(draw: impl FnOnce(&Area) -> Drawn) -> Pixmap {
        let png = page::picture(20, 10, draw).png();
        Pixmap::decode_png(&png.expect("a picture")).expect("a PNG")
    }

    fn at(pixels: &Pixmap, x: u32, y: u32) -> [u8; 3] {
        let found = pixels.pixel(x, y).expect("a pixel").demultiply();
        [found.red(), found.green(), found.blue()]
    }

    #[test]
    fn shapes_are_where_the_page_has_them() {
        let drawn = pixels(|area| {
            area.draw(&Rectangle::new([(0, 0), (40, 20)], RED.filled()))?;
            let corners = vec![(40, 0), (80, 0), (80, 20), (40, 20)];
            area.draw(&Polygon::new(corners, BLACK.mix(0.5)))?;
            area.draw(&PathElement::new(
                [(0, 30), (80, 30)],
                page::stroke(BLUE, 2.0),
            ))
        });
        assert_eq!((drawn.width(), drawn.height()), (40, 20));
        assert_eq!(at(&drawn, 10, 5), [255, 0, 0]);
        let half = at(&drawn, 30, 5);
        assert!(half.iter().all(|c| c.abs_diff(127) <= 1), "{half:?}");
        // The line is 2 pixels of the page wide, around 7.5.
        assert_eq!([13, 15, 16].map(|y| at(&drawn, 20, y)), [[0, 0, 255]; 3]);
        assert_eq!([12, 18].map(|y| at(&drawn, 20, y)), [[255; 3]; 2]);
    }

    #[test]
    fn text_has_its_anchor_and_its_turn() {
        let text = |anchor, turn| {
            let drawn = pixels(|area| {
                let font = page::font(10.0).transform(turn);
                let style = TextStyle::from(font).pos(Pos::new(anchor, VPos::Center));
                area.draw(&Text::new("&", (40, 20), style))
            });
            let mut ink = [0, 0, 0, 0];
            for (x, y) in (0..40).flat_map(|x| (0..20).map(move |y| (x, y))) {
                if at(&drawn, x, y)[0] < 128 {
                    let sides = [x < 20, x >= 20, y < 10, y >= 10];
                    for (side, count) in sides.into_iter().zip(&mut ink) {
                        *count += u32::from(side);
                    }
                }
            }
            ink
        };
        let [left, right, ..] = text(HPos::Left, FontTransform::None);
        assert!(left == 0 && right > 20, "{left} {right}");
        let [left, right, ..] = text(HPos::Right, FontTransform::None);
        assert!(left > 20 && right == 0, "{left} {right}");
        // Turned by a quarter against the clock about its start, it goes upwards.
        let [_, _, up, down] = text(HPos::Left, FontTransform::Rotate270);
        assert!(up > 20 && down == 0, "{up} {down}");
    }

    #[test]
    fn a_page_without_pixels_is_refused() {
        assert!(page::picture(0, 10, |_| Ok(())).png().is_err());
    }
}
